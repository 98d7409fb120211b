"""What one scan says of space, in the robot frame of that scan: the evidence that a map is drawn from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import Feature, FeatureKind, compensated_ranges

BINS = 360
"""Directions in which a scan position keeps how far it is clear."""
_BINS_RAD = (np.arange(BINS) + 0.5) * (2.0 * math.pi / BINS)


@dataclass(frozen=True)
class MappingConfig:
    """What a cell needs to be called free or occupied."""

    resolution_m: float = 0.05
    """Side of a cell, [m]."""
    free_range_m: float = 1.5
    """How far a reading without a region of constant depth may clear, [m]."""
    wall_margin_m: float = 0.05
    """Cells nearer than this before an echo are not cleared by it, [m]."""
    continuation_rad: float = math.radians(60.0)
    """How far off the normal a wall is taken to go on straight, for the scan that saw it, [rad]."""
    core_rad: float = math.radians(5.0)
    """Half-width of the sector about the normal that a region of constant depth clears for certain, [rad]."""
    pivot_m: float = 0.10
    """Feet of two wall features this close are one place, [m]."""
    pivot_turn_rad: float = math.radians(15.0)
    """Normals that differ by this much at one place belong to an edge, a corner or a column, [rad]."""
    trim_m: float = 0.08
    """An edge or a corner this near to a wall feature's line ends its segment, [m]."""
    goes_on_m: float = 1.2
    """A wall goes on to the edge, the corner or the wall that ends it, if that is no farther than this, [m]."""
    far_wall_m: float = 3.5
    """Walls heard from farther off than is reliable, up to this, bound what scans clear, [m]."""
    on_line_m: float = 0.12
    """What lies no farther beside the line of a wall ends it, [m]."""
    sure_m: float = 0.10
    """How far about the foot of its normal a wall is believed where the map is doubted, [m]."""
    wall_weight: float = 2.0
    """Evidence of one wall feature for the cells of its segment."""
    point_weight: float = 1.0
    """Evidence of a corner or an edge for its cell."""
    core_weight: float = 1.0
    """Evidence of one certain sector against a wall."""
    still_m: float = 0.01
    """A scan that no point of moved farther than this since it was drawn stays as it is drawn, [m];"""
    far_still_m: float = 0.05
    """and one far away if it was no farther than this, until all of the map is asked for, [m]."""
    fresh_scans: int = 4
    """What the last scans saw stands where they saw it, whatever older ones say: the pose drifts, the walls near
    by are where they are."""
    fresh_weight: float = 100.0
    """Extra evidence of a wall feature of those scans."""
    body_weight: float = 4.0
    """Evidence against a wall where the body has been."""


@dataclass(frozen=True, eq=False)
class Look:
    """What one scan says of space, in the robot frame of that scan."""

    clear_m: Array
    """How far each bin may be cleared by its reading, before walls cut it, shape (BINS,), [m]."""
    core_m: Array
    """How far each bin is certainly clear, 0 outside the cores, shape (BINS,), [m]."""
    walls: Array
    """Segments of the scan's wall features, shape (n, 4), [m]."""
    continuations: Array
    """The same walls as taken to go on straight, shape (n, 4), [m]."""
    points: Array
    """Corners and edges x y, shape (k, 2), [m]."""
    bounds: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """Pieces of wall that are not drawn but bound what scans clear, shape (m, 4), [m]: heard from farther off than is
    reliable, and those that the ring passed on the drive that followed."""

    @cached_property
    def reach_m(self) -> float:
        """How far the clearest bin may be cleared, [m]."""
        return float(self.clear_m.max())

    @property
    def kinds(self) -> tuple[Array, Array, Array, Array]:
        """Walls, continuations, bounds and points."""
        return self.walls, self.continuations, self.bounds, self.points

    @cached_property
    def outline(self) -> Array:
        """Ends of walls, continuations and bounds, and points, one after the other, shape (n, 2), [m]."""
        return np.concatenate([part.reshape(-1, 2) for part in self.kinds])


def look_of(scan: Scan, features: Sequence[Feature], config: MappingConfig) -> Look:
    """Turn a scan and its features into evidence."""
    bearings, ranges = _from_centre(scan, config.free_range_m)
    clear = ranges[_nearest(bearings.tobytes())]
    clear = np.minimum(clear - config.wall_margin_m, config.free_range_m)
    core = np.zeros(BINS)
    walls = [f for f in features if f.kind is FeatureKind.WALL]
    heard = [(f.bearing_rad, f.width_rad, f.range_m, f.kind is FeatureKind.WALL) for f in features]
    rows = np.array(heard, dtype=float).reshape(-1, 4)
    _hear(rows, _BINS_RAD, config.wall_margin_m, config.core_rad, clear, core)
    return Look(
        clear_m=np.maximum(clear, 0.0),
        core_m=core,
        walls=np.array([f.segment.as_row() for f in walls], dtype=float).reshape(-1, 4),
        continuations=np.array([_continuation(f, config) for f in walls], dtype=float).reshape(-1, 4),
        points=np.array(
            [f.segment.midpoint for f in features if f.kind is not FeatureKind.WALL], dtype=float
        ).reshape(-1, 2),
    )


@lean_kernel
def _hear(features, bins, margin, core_rad, clear, core):  # type: ignore[no-untyped-def]
    """What features say of the bins about them; each is bearing, width [rad], range [m] and whether it is a wall."""
    for k in range(len(features)):
        range_m = features[k, 2] - margin
        for b in range(len(bins)):
            off = abs((bins[b] - features[k, 0] + math.pi) % (2.0 * math.pi) - math.pi)
            if off <= 0.5 * features[k, 1]:
                clear[b] = min(clear[b], range_m)
            if features[k, 3] > 0.0 and off <= core_rad:
                core[b] = max(core[b], range_m)


def _from_centre(scan: Scan, reach_m: float) -> tuple[Array, Array]:
    """Bearing [rad] and range [m] of each reading as if heard from the robot's centre, shape (n,) each.

    The disc of the paper's scan sits a centimetre off its beam's line through the centre; those of a ring up to eight:
    there it is the end of the reading, or the point `reach_m` along it, that is seen from the centre.
    """
    if scan.ring is None:
        return scan.bearings_rad, compensated_ranges(scan)
    length = np.minimum(scan.ranges_m, reach_m)
    beams = np.column_stack([np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)])
    x, y = (scan.origins + length[:, None] * beams).T
    return np.arctan2(y, x), np.hypot(x, y)


def _continuation(f: Feature, config: MappingConfig) -> tuple[float, float, float, float]:
    c, s = math.cos(f.bearing_rad), math.sin(f.bearing_rad)
    half = f.range_m * math.tan(config.continuation_rad)
    x, y = f.range_m * c, f.range_m * s
    return x + half * s, y - half * c, x - half * s, y + half * c


@lru_cache(maxsize=8)
def _nearest(bearings_rad: bytes) -> NDArray[np.intp]:
    """Which reading, by its bearing, is nearest to each bin, shape (BINS,), not to be written to: the same for all full
    scans of one lattice."""
    bearings = np.frombuffer(bearings_rad) % (2.0 * math.pi)
    order = np.argsort(bearings)
    rising = bearings[order]
    right = np.searchsorted(rising, _BINS_RAD) % len(rising)
    left = (right - 1) % len(rising)
    gap_right = (rising[right] - _BINS_RAD) % (2.0 * math.pi)
    gap_left = (_BINS_RAD - rising[left]) % (2.0 * math.pi)
    return np.asarray(order[np.where(gap_right < gap_left, right, left)])
