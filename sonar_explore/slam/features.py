"""Features of one scan: wall segments, corners and edges (section II, READING section 4)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from sonar_explore.geometry import Segment, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.rcd import Rcd, compensated_ranges, regions_of_constant_depth, split

__all__ = ["Feature", "FeatureConfig", "FeatureKind", "compensated_ranges", "extract_features"]

ANGLE_SLACK_RAD = 1e-6  # a width of exactly the limit passes, whatever the rounding of the headings


class FeatureKind(StrEnum):
    """What an RCD is taken for. Only walls make chains; some corners and edges pass for walls (III.C)."""

    WALL = "wall"
    CORNER = "corner"
    EDGE = "edge"


@dataclass(frozen=True)
class Feature:
    """One feature of one scan, in the robot frame at the start of the scan."""

    kind: FeatureKind
    bearing_rad: float
    """Direction of the foot of the normal, in (-pi, pi], [rad]."""
    range_m: float
    """Perpendicular distance from the robot's centre, [m]."""
    width_rad: float
    """From the first to the last heading of the RCD, [rad]."""
    segment: Segment
    """Tangent at the foot of the normal, cut by the first and last heading; a point for corner and edge."""
    readings: tuple[int, ...]
    """Indices of the scan's readings that heard it, counter-clockwise."""


@dataclass(frozen=True)
class FeatureConfig:
    """What passes for what (READING section 4)."""

    tolerance_m: float = 0.03
    """Largest distance of a reading from the median of its RCD, [m]."""
    width_min_rad: float = math.radians(10.0)
    """A wall's RCD is at least this wide, [rad]."""
    beam_rad: float = math.radians(25.0)
    """Width of one sonar beam, [rad]."""
    width_max_beams: float = 1.5
    """A wider run cannot be one plane: it is cut into equal parts that can."""
    range_min_m: float = 0.20
    """Nearest reliable range from the disc (section III.F), [m]."""
    range_max_m: float = 2.00
    """Farthest reliable range from the disc (section III.F), [m]."""
    edge_width_min_rad: float = math.radians(4.0)
    """A narrower RCD is not even an edge, [rad]."""
    edge_jump_m: float = 0.10
    """Beside an edge, on one side at least, the next reading is farther by this much, [m]."""
    corner_right_angle_rad: float = math.radians(10.0)
    """How far from 90 degrees apart the normals of a corner's walls may be, [rad]."""
    corner_range_m: float = 0.08
    """How far from sqrt(d1^2 + d2^2) a corner may be heard, [m]."""
    corner_bearing_rad: float = math.radians(8.0)
    """How far from psi1 + atan2(d2, d1) a corner may be heard, [rad]."""


def extract_features(scan: Scan, config: FeatureConfig) -> tuple[Feature, ...]:
    """Walls, corners and edges of one scan, by bearing.

    A run wider than 1.5 beams is not one plane: it is a curved wall around the robot, or two planes at nearly
    equal distance whose RCDs touch. Cut into the fewest equal parts that are narrow enough, the first
    becomes a polygon of tangents and the second its two walls.
    """
    regions = _narrow_enough(scan, config)
    regions = [r for r in regions if config.range_min_m <= r.echo_m <= config.range_max_m]
    wide = [r for r in regions if r.width_rad >= config.width_min_rad - ANGLE_SLACK_RAD]
    corners = {r for r in wide if _is_corner(r, wide, config)}
    walls = [_wall(r) for r in wide if r not in corners]
    edges = [_point(r, FeatureKind.EDGE) for r in regions if r not in wide and _is_edge(r, scan, config)]
    points = [_point(r, FeatureKind.CORNER) for r in corners]
    return tuple(sorted([*walls, *points, *edges], key=lambda feature: feature.bearing_rad))


def _narrow_enough(scan: Scan, config: FeatureConfig) -> list[Rcd]:
    widest = config.width_max_beams * config.beam_rad + ANGLE_SLACK_RAD
    regions: list[Rcd] = []
    for region in regions_of_constant_depth(scan, config.tolerance_m):
        parts = math.ceil(region.width_rad / widest)
        regions += [region] if parts <= 1 else split(scan, region, parts)
    return regions


def _is_corner(region: Rcd, wide: Iterable[Rcd], config: FeatureConfig) -> bool:
    """Whether it is heard where two walls about 90 degrees apart must meet.

    A corner is farther than both its walls, so no wall can be taken for the corner of two corners.
    """
    near = [other for other in wide if other.depth_m < region.depth_m]
    return any(_meet_at(first, second, region, config) for first in near for second in near)


def _meet_at(first: Rcd, second: Rcd, corner: Rcd, config: FeatureConfig) -> bool:
    apart = wrap_angle(second.bearing_rad - first.bearing_rad)
    if abs(apart - math.pi / 2) > config.corner_right_angle_rad:
        return False
    bearing = first.bearing_rad + math.atan2(second.depth_m, first.depth_m)
    return (
        abs(math.hypot(first.depth_m, second.depth_m) - corner.depth_m) <= config.corner_range_m
        and abs(wrap_angle(corner.bearing_rad - bearing)) <= config.corner_bearing_rad
    )


def _is_edge(region: Rcd, scan: Scan, config: FeatureConfig) -> bool:
    """Whether a narrow RCD stands in front of what its neighbours hear."""
    if region.width_rad < config.edge_width_min_rad - ANGLE_SLACK_RAD:
        return False
    behind = max(scan.ranges_m[i] for i in _neighbours(region.readings, len(scan.ranges_m)))
    return bool(behind - region.echo_m >= config.edge_jump_m)


def _neighbours(readings: Sequence[int], n: int) -> tuple[int, int]:
    """The readings just before and just after a run, which may run either way round."""
    step = 1 if (readings[1] - readings[0]) % n == 1 else -1
    return (readings[0] - step) % n, (readings[-1] + step) % n


def _wall(region: Rcd) -> Feature:
    half = region.depth_m * math.tan(0.5 * region.width_rad)  # L = 2 r tan(W / 2)
    return _feature(region, FeatureKind.WALL, half)


def _point(region: Rcd, kind: FeatureKind) -> Feature:
    return _feature(region, kind, 0.0)


def _feature(region: Rcd, kind: FeatureKind, half_length: float) -> Feature:
    c, s = math.cos(region.bearing_rad), math.sin(region.bearing_rad)
    x, y = region.depth_m * c, region.depth_m * s
    ends = Segment(x + half_length * s, y - half_length * c, x - half_length * s, y + half_length * c)
    return Feature(
        kind=kind,
        bearing_rad=wrap_angle(region.bearing_rad),
        range_m=region.depth_m,
        width_rad=region.width_rad,
        segment=ends,
        readings=region.readings,
    )
