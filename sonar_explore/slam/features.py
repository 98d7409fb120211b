"""Features of one scan: wall segments, corners and edges (section II, READING section 4)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from sonar_explore.beam import Beam
from sonar_explore.geometry import Segment, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.ends import Ends, neighbours
from sonar_explore.slam.rcd import Rcd, compensated_ranges, regions_of_constant_depth

__all__ = ["Feature", "FeatureConfig", "FeatureKind", "compensated_ranges", "extract_features"]

ASIDE_M = 0.15  # a corner on the continuation of a wall lies at least this far from the wall's own foot
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
    sweep_rad: float = 0.0
    """How far the robot had turned when it was heard, on average, signed: an error of the turns shows in the
    bearing the more, the later, [rad]."""
    discs: int = 1
    """How many of the robot's sonar discs agree on it."""

    def turned(self, angle_rad: float) -> Feature:
        """The same feature at another bearing."""
        c, s, ends = math.cos(angle_rad), math.sin(angle_rad), self.segment
        x1, y1, x2, y2 = ends.x1, ends.y1, ends.x2, ends.y2
        return Feature(
            self.kind,
            wrap_angle(self.bearing_rad + angle_rad),
            self.range_m,
            self.width_rad,
            Segment(c * x1 - s * y1, s * x1 + c * y1, c * x2 - s * y2, s * x2 + c * y2),
            self.readings,
            self.sweep_rad,
            self.discs,
        )


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
    """A wall's segment is cut from no more than this, however wide the run."""
    run_max_beams: float = 4.0
    """A run wider than this is no wall: the robot is surrounded by something."""
    range_min_m: float = 0.20
    """Nearest reliable range from the disc (section III.F), [m]."""
    range_max_m: float = 2.00
    """Farthest reliable range from the disc (section III.F), [m]."""
    edge_width_min_rad: float = math.radians(4.0)
    """A narrower RCD is not even an edge, [rad]."""
    jump_m: float = 0.10
    """Two things heard side by side differ by this much; less is the shoulder of one thing, [m]."""
    corner_right_angle_rad: float = math.radians(10.0)
    """How far from 90 degrees apart the normals of a corner's walls may be, [rad]."""
    corner_range_m: float = 0.08
    """How far from sqrt(d1^2 + d2^2) a corner may be heard, [m]."""
    corner_bearing_rad: float = math.radians(8.0)
    """How far from psi1 + atan2(d2, d1) a corner may be heard, [rad]."""
    beam_check: bool = False
    """Beyond the paper: a wall is heard as widely as the beam pattern says a plane is at its distance, less what
    something nearer hides; the rest are edges and columns, or two things that touch."""
    beam: Beam = field(default_factory=Beam)
    """The pattern that these two options go by."""
    beam_bearing: bool = False
    """Beyond the paper: where something nearer hides one end of an RCD, the normal is found from the other end."""
    corner_on_wall: bool = False
    """Beyond the paper: what is heard on the straight continuation of a nearer wall is a corner."""
    corner_on_wall_m: float = 0.06
    """How far off that continuation, [m]."""


def extract_features(scan: Scan, config: FeatureConfig) -> tuple[Feature, ...]:
    """Walls, corners and edges that one disc heard, by bearing.

    A run wider than 1.5 beams is a near plane that the beam's skirts hear as well: half a metre away, real
    sonars show it often. Its middle is still the normal. Cut in two, it would make two walls that are not
    there; left out, the nearest walls would be missing. What it costs: two oblique planes at nearly equal
    distance, whose runs touch, count as one.
    """
    regions = _regions(scan, config)
    plateaus = _plateaus(regions, scan, config)
    corners = {r for r in plateaus if _is_corner(r, plateaus, config)}
    features = [
        _feature(r, FeatureKind.CORNER if r in corners else FeatureKind.WALL, scan, config) for r in plateaus
    ]
    taken = {r.readings for r in plateaus}
    features += [
        _feature(r, FeatureKind.EDGE, scan, config)
        for r in regions
        if r.readings not in taken and _is_edge(r, scan, config)
    ]
    return tuple(sorted(features, key=lambda feature: feature.bearing_rad))


def _regions(scan: Scan, config: FeatureConfig) -> tuple[Rcd, ...]:
    """Regions of constant depth within the reliable range."""
    regions = regions_of_constant_depth(scan, config.tolerance_m)
    return tuple(r for r in regions if config.range_min_m <= r.echo_m <= config.range_max_m)


def _plateaus(regions: Sequence[Rcd], scan: Scan, config: FeatureConfig) -> list[Rcd]:
    """Those wide enough for a wall or a corner."""
    wide = [r for r in regions if r.width_rad >= config.width_min_rad - ANGLE_SLACK_RAD]
    plateaus = [r for r in wide if _is_plateau(r, wide, scan, config)]
    heard = {r: Ends.of(r, scan, config.jump_m, config.beam) for r in plateaus}
    if config.beam_check:
        plateaus = [r for r in plateaus if heard[r].like_a_plane(r)]
    if config.beam_bearing:
        plateaus = [heard[r].centred(r) for r in plateaus]
    return plateaus


def _is_plateau(region: Rcd, wide: Iterable[Rcd], scan: Scan, config: FeatureConfig) -> bool:
    """Whether a region stands alone: neither all around the robot nor the shoulder of a nearer region.

    Beside its plateau a wide beam hears the same wall a little farther away. First echoes of two things
    differ by a jump.
    """
    if region.width_rad > config.run_max_beams * config.beam_rad + ANGLE_SLACK_RAD:
        return False
    before, after = neighbours(region.readings, len(scan.ranges_m))
    touching = (other for other in wide if other.readings[-1] == before or other.readings[0] == after)
    return not any(0.0 < region.depth_m - other.depth_m < config.jump_m for other in touching)


def _is_corner(region: Rcd, wide: Iterable[Rcd], config: FeatureConfig) -> bool:
    """Whether it is heard where two walls about 90 degrees apart must meet.

    A corner is farther than both its walls, so no wall can be taken for the corner of two corners.
    """
    near = [other for other in wide if other.depth_m < region.depth_m]
    if config.corner_on_wall and any(_on_continuation(region, wall, config) for wall in near):
        return True
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


def _on_continuation(region: Rcd, wall: Rcd, config: FeatureConfig) -> bool:
    """Whether the foot of a region lies on the line of a nearer wall, well aside of that wall's own foot."""
    apart = region.bearing_rad - wall.bearing_rad
    aside = region.depth_m * abs(math.sin(apart))
    off = abs(region.depth_m * math.cos(apart) - wall.depth_m)
    return math.cos(apart) > 0.0 and aside > ASIDE_M and off <= config.corner_on_wall_m


def _is_edge(region: Rcd, scan: Scan, config: FeatureConfig) -> bool:
    """Whether a narrow RCD stands in front of what its neighbours hear."""
    if region.width_rad < config.edge_width_min_rad - ANGLE_SLACK_RAD:
        return False
    behind = max(scan.ranges_m[i] for i in neighbours(region.readings, len(scan.ranges_m)))
    return bool(behind - region.echo_m >= config.jump_m)


def _feature(region: Rcd, kind: FeatureKind, scan: Scan, config: FeatureConfig) -> Feature:
    return Feature(
        kind=kind,
        bearing_rad=wrap_angle(region.bearing_rad),
        range_m=region.depth_m,
        width_rad=region.width_rad,
        segment=tangent(kind, region.bearing_rad, region.depth_m, region.width_rad, config),
        readings=region.readings,
        sweep_rad=sum(float(scan.headings_rad[i]) for i in region.readings) / len(region.readings),
    )


def tangent(
    kind: FeatureKind, bearing_rad: float, range_m: float, width_rad: float, config: FeatureConfig
) -> Segment:
    """The piece of a wall's tangent at the foot of its normal that was heard; a point for corner and edge."""
    width = min(width_rad, config.width_max_beams * config.beam_rad) if kind is FeatureKind.WALL else 0.0
    half = range_m * math.tan(0.5 * width)  # L = 2 r tan(W / 2)
    c, s = math.cos(bearing_rad), math.sin(bearing_rad)
    x, y = range_m * c, range_m * s
    return Segment(x + half * s, y - half * c, x - half * s, y + half * c)
