# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Specular scans of convex rooms: the first echo above threshold, by READING section 2. No occlusion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Pose, Segment
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import Feature, FeatureKind
from sonar_explore.slam.residuals import residuals_to_lines

BEAM_SIGMA = math.radians(6.4)
THRESHOLD = math.exp(-((12.5 / 6.4) ** 2))  # a plane 1 m away is just heard at 12.5 degrees
EDGE_STRENGTH = 0.1
RANGE_MAX = 5.0
ROBOT = AmigoBot()
CENTRED = Pose(0.0, 0.0, 0.0)

Point = tuple[float, float]


def half_angle(range_m: float, strength: float = 1.0, falloff: float = 1.0) -> float:
    """Farthest off the axis that an echo source is heard, [rad]; negative where it is never heard."""
    ratio = strength * range_m**-falloff / THRESHOLD
    return BEAM_SIGMA * math.sqrt(math.log(ratio)) if ratio > 1.0 else -1.0


def ping(
    disc: Pose, walls: Sequence[Segment], corners: Sequence[Point] = (), edges: Sequence[Point] = ()
) -> float:
    """Range of the first echo, [m]; RANGE_MAX where nothing is heard."""
    echoes = [RANGE_MAX]
    for wall in walls:
        foot = _foot(disc, wall)
        if foot is not None and _off_axis(disc, foot) <= half_angle(_range(disc, foot)):
            echoes.append(_range(disc, foot))
    echoes += [_range(disc, p) for p in corners if _off_axis(disc, p) <= half_angle(_range(disc, p))]
    echoes += [
        _range(disc, p)
        for p in edges
        if _off_axis(disc, p) <= half_angle(_range(disc, p), EDGE_STRENGTH, 1.5)
    ]
    return min(echoes)


def scan_room(
    pose: Pose,
    walls: Sequence[Segment],
    corners: Sequence[Point] = (),
    edges: Sequence[Point] = (),
    *,
    n: int = 90,
    spin: int = 1,
    sonar: Pose = ROBOT.sonars[2],
    odometry: Pose | None = None,
    smear: float = 1.0,
    rng: np.random.Generator | None = None,
) -> Scan:
    """A full turn at `pose`; `smear` is true turn over odometry's turn; noise where `rng` is given."""
    headings = spin * np.arange(n) * math.tau / n
    discs = [Pose(pose.x, pose.y, pose.heading + smear * float(h)) @ sonar for h in headings]
    ranges = np.array([ping(disc, walls, corners, edges) for disc in discs])
    if rng is not None:
        noise = rng.normal(0.0, 1.0, n) * (0.005 + 0.004 * ranges)
        ranges = np.where(ranges < RANGE_MAX, (ranges + noise).round(3), ranges)
    return Scan(pose if odometry is None else odometry, headings, ranges, sonar, RANGE_MAX)


def rectangle(width: float, height: float) -> tuple[list[Segment], list[Point]]:
    """Walls and corners of a room with one corner at the origin."""
    points = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    walls = [Segment(*a, *b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    return walls, points


def wall_feature(bearing_rad: float, range_m: float, width_rad: float = math.radians(20.0)) -> Feature:
    """A wall as an extractor would report it, with its normal at this bearing and distance."""
    half = range_m * math.tan(0.5 * width_rad)
    c, s = math.cos(bearing_rad), math.sin(bearing_rad)
    x, y = range_m * c, range_m * s
    tangent = Segment(x + half * s, y - half * c, x - half * s, y + half * c)
    return Feature(FeatureKind.WALL, bearing_rad, range_m, width_rad, tangent, ())


def residuals_to_roots(pose, features, associations, chains):
    """ADR and NDR of every association, to the roots as they were heard, as the paper has it (III.C)."""
    roots = np.array([chains[a.chain].root.segment.as_row() for a in associations]).reshape(-1, 4)
    return residuals_to_lines(pose, features, associations, chains, roots)


def _foot(disc: Pose, wall: Segment) -> Point | None:
    dx, dy = (wall.x2 - wall.x1) / wall.length, (wall.y2 - wall.y1) / wall.length
    along = (disc.x - wall.x1) * dx + (disc.y - wall.y1) * dy
    return (wall.x1 + along * dx, wall.y1 + along * dy) if 0.0 <= along <= wall.length else None


def _range(disc: Pose, point: Point) -> float:
    return math.hypot(point[0] - disc.x, point[1] - disc.y)


def _off_axis(disc: Pose, point: Point) -> float:
    return abs(math.remainder(math.atan2(point[1] - disc.y, point[0] - disc.x) - disc.heading, math.tau))
