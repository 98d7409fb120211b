"""Loops that were explored from both sides but not driven round (the paper's robot completes its loops, section IV).

A sonar sees the last stretch of a loop from either end, so nothing is left to explore there and the way never meets
its own beginning. Driving that stretch lets the chains of the first scans be met again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.mapping.regions import enclosed_blocks

LEAST_BLOCK_M2 = 1.0
"""A pillar makes no loop: what a loop leads round has at least this area, [m2]."""
LEAST_SHARE = 0.6
"""A loop of which less was driven is left alone: much of it may not be there."""
OVERLAP_RAD = math.radians(10.0)
"""A loop is closed once its way overlaps by this much, seen from its middle."""


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """A block that the way leads round, but not yet all the way."""

    x: float
    """Middle of the block, map frame, [m]."""
    y: float
    """[m]"""
    first_rad: float
    """Least bearing of the way, seen from the middle; runs on through full turns."""
    last_rad: float
    """Greatest."""
    here_rad: float
    """Of the robot."""
    goals: Array
    """A scan position near either end, shape (2, 2), map frame, [m]."""

    def closed_by(self, path: Array) -> bool:
        """Whether the way goes all round once this path, shape (n, 2) [m], from the robot is driven."""
        bearing = _bearings(path, self.x, self.y)
        bearing += self.here_rad - bearing[0]
        first, last = min(self.first_rad, float(bearing.min())), max(self.last_rad, float(bearing.max()))
        return last - first >= math.tau + 0.5 * OVERLAP_RAD


def open_loops(trail: Array, scans: NDArray[np.intp], grid: OccupancyGrid) -> tuple[OpenLoop, ...]:
    """Loops of which most was driven, but not all.

    Args:
        trail: where the body has been, in order, shape (n, 2), map frame, [m].
        scans: indices into the trail of the scan positions, shape (k,).
        grid: the map.
    """
    found = []
    for x, y in blocks_of(grid):
        bearing = _bearings(trail, x, y)
        first, last = float(bearing.min()), float(bearing.max())
        if not LEAST_SHARE * math.tau <= last - first < math.tau + OVERLAP_RAD:
            continue
        at = bearing[scans]
        inside = scans[(at >= first + OVERLAP_RAD) & (at <= last - OVERLAP_RAD)]
        if not len(inside):
            continue
        ends = inside[[np.argmin(bearing[inside]), np.argmax(bearing[inside])]]
        found.append(OpenLoop(x, y, first, last, float(bearing[-1]), trail[ends]))
    return tuple(found)


def went_round(way: Array, blocks: Sequence[tuple[float, float]]) -> int | None:
    """Index of the first point of a way at which it had gone all round a block; None if it never has.

    Args:
        way: in order, shape (n, 2), [m].
        blocks: a point within each, x y, [m].
    """
    found = []
    for x, y in blocks:
        bearing = _bearings(way, x, y)
        turned = np.maximum.accumulate(bearing) - np.minimum.accumulate(bearing)
        found.extend(np.flatnonzero(turned >= math.tau)[:1].tolist())
    return min(found, default=None)


def blocks_of(grid: OccupancyGrid) -> list[tuple[float, float]]:
    """Middles x y of what free space surrounds and a loop could lead round, [m]."""
    origin = grid.frame.x0, grid.frame.y0
    return enclosed_blocks(grid.free, origin, grid.frame.resolution_m, LEAST_BLOCK_M2)


def _bearings(points: Array, x: float, y: float) -> Array:
    return np.unwrap(np.arctan2(points[:, 1] - y, points[:, 0] - x))
