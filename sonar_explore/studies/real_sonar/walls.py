"""Extracted walls judged against true ones: which of them are true, and which of those to be seen were found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sonar_explore.geometry import Pose, Segment, wrap_undirected
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import Feature, FeatureConfig, FeatureKind, extract_features

WITHIN_M, WITHIN_RAD = 0.10, math.radians(10.0)
"""An extracted wall is true where its foot is this near to a true wall, and its direction this near to that one's."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """One scan, what was extracted from it, and how that fares."""

    scan: Scan
    pose: Pose
    """`pose_robot_in_map`, fitted to the walls."""
    features: FeatureConfig
    extracted: tuple[Feature, ...]
    walls: tuple[Feature, ...]
    true: tuple[bool, ...]
    """Of each extracted wall."""
    found: tuple[bool, ...]
    """Of each true wall whose foot can be seen from here."""


def judged(scan: Scan, pose: Pose, walls: Sequence[Segment], features: FeatureConfig) -> Verdict:
    """Extract and compare."""
    extracted = extract_features(scan, features)
    found = [f for f in extracted if f.kind is FeatureKind.WALL]
    placed = [f.segment.transformed(pose) for f in found]
    seen = visible_walls(pose, walls, features.range_min_m, features.range_max_m)
    return Verdict(
        scan=scan,
        pose=pose,
        features=features,
        extracted=extracted,
        walls=tuple(found),
        true=tuple(any(lies_on(segment, wall) for wall in walls) for segment in placed),
        found=tuple(any(lies_on(segment, wall) for segment in placed) for wall in seen),
    )


def lies_on(segment: Segment, wall: Segment) -> bool:
    """Whether an extracted wall is a piece of a true one."""
    x, y = segment.midpoint
    return (
        abs(wall.signed_distance(x, y)) <= WITHIN_M
        and abs(wrap_undirected(wall.direction - segment.direction)) <= WITHIN_RAD
        and -WITHIN_M <= _along(wall, x, y) <= wall.length + WITHIN_M
    )


def visible_walls(pose: Pose, walls: Sequence[Segment], nearest_m: float, farthest_m: float) -> list[Segment]:
    """True walls within range with the foot of their normal on them and nothing in between."""
    seen = []
    for wall in walls:
        distance = wall.signed_distance(pose.x, pose.y)
        nx, ny = wall.unit_normal
        foot = Segment(pose.x, pose.y, pose.x - distance * nx, pose.y - distance * ny)
        on_it = 0.0 <= _along(wall, foot.x2, foot.y2) <= wall.length
        hidden = any(_cross(foot, other) for other in walls if other is not wall)
        if on_it and not hidden and nearest_m <= abs(distance) <= farthest_m:
            seen.append(wall)
    return seen


def _along(wall: Segment, x: float, y: float) -> float:
    """How far from its first end towards its second, [m]."""
    return ((x - wall.x1) * (wall.x2 - wall.x1) + (y - wall.y1) * (wall.y2 - wall.y1)) / wall.length


def _cross(a: Segment, b: Segment) -> bool:
    """Whether two segments meet between their ends."""
    return (
        a.signed_distance(b.x1, b.y1) * a.signed_distance(b.x2, b.y2) < 0.0
        and b.signed_distance(a.x1, a.y1) * b.signed_distance(a.x2, a.y2) < 0.0
    )
