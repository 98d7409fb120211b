"""A world prepared for pings: walls cut where they meet, the wedges between them, and who is near what.

A vertex answers by the wedge that the sonar stands in: a right angle is a retro-reflecting corner, an
opening of much more than half a turn is a diffracting edge (a free end opens all round), any other is silent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from sonar_explore.envs.pings import CONVEX_EDGE, RIGHT_CORNER, Index, Scratch, Things
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array

SNAP_M = 0.001  # ends closer than this are one vertex
CELL_M = 1.0
# a dihedral off by this turns the beam by twice as much: half a beam
_CORNER_TOLERANCE_RAD = math.radians(6.0)
_EDGE_OPENING_RAD = math.radians(200.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """What the ping kernels read, and where they note things down."""

    things: Things
    """Walls that touch at ends alone, the wedges between them, and columns."""
    index: Index
    """Which of them are near what."""
    scratch: Scratch
    """Room for the kernels to work in."""

    @cached_property
    def plain(self) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """The three as tuples without names, which numba takes several microseconds faster."""
        return tuple(self.things), tuple(self.index), tuple(self.scratch)

    @staticmethod
    def of(world: World, reach_m: float, roughness: float = 0.0) -> Scene:
        """Prepare a world for pings that hear up to `reach_m` away; walls are at least this rough."""
        walls = _cut_where_they_meet(world.walls, np.maximum(world.roughness, roughness))
        wedges = _wedges(walls)
        cylinders = np.asarray(world.cylinders, dtype=float).reshape(-1, 3)
        frame, cells = _cells(walls, cylinders, reach_m)
        shapes = (
            shapely.linestrings(walls[:, :4].reshape(-1, 2, 2)),
            shapely.points(wedges[:, :2]),
            shapely.buffer(shapely.points(cylinders[:, :2]), cylinders[:, 2]),
        )
        index = tuple(array for shape in shapes for array in _neighbours(cells, np.asarray(shape), reach_m))
        busiest = tuple(int(np.diff(first).max(initial=0)) for first in index[::2])
        room = Scratch.of((len(walls), len(wedges), len(cylinders)), busiest)
        return Scene(Things(walls, wedges, cylinders), Index._make([*index, frame]), room)


def _cut_where_they_meet(walls: Array, roughness: Array) -> Array:
    """Walls snapped to `SNAP_M` and cut at every crossing and T, shape (n, 5)."""
    lines = shapely.linestrings(walls.reshape(-1, 2, 2))
    noded = shapely.set_precision(shapely.union_all(lines, grid_size=SNAP_M), SNAP_M)
    pieces = np.concatenate([_pairs(line) for line in shapely.get_parts(noded)])
    nearest = shapely.STRtree(lines).nearest(shapely.points(pieces.reshape(-1, 2, 2).mean(axis=1)))
    cut = np.column_stack([pieces, roughness[nearest]])
    return np.ascontiguousarray(cut[np.lexsort(cut.T[::-1])])


def _pairs(line: shapely.LineString) -> Array:
    xy = shapely.get_coordinates(line)
    return np.hstack([xy[:-1], xy[1:]])


def _wedges(walls: Array) -> Array:
    """The wedges that answer: right corners and convex edges, shape (k, 9)."""
    ends = np.vstack([walls[:, 0:2], walls[:, 2:4]])
    directions = np.vstack([walls[:, 2:4] - walls[:, 0:2], walls[:, 0:2] - walls[:, 2:4]])
    keys = np.round(ends / SNAP_M).astype(np.int64)
    _, member = np.unique(keys, axis=0, return_inverse=True)
    bearing = np.arctan2(directions[:, 1], directions[:, 0])
    order = np.lexsort((bearing, member.ravel()))
    rows: list[tuple[float, float, float, float, float]] = []
    for group in np.split(order, np.flatnonzero(np.diff(member.ravel()[order])) + 1):
        x, y = ends[group[0]]
        starts = bearing[group]
        openings = (np.roll(starts, -1) - starts) % (2.0 * math.pi)
        if len(group) == 1:
            openings = np.array([2.0 * math.pi])
        for start, opening in zip(starts, openings, strict=True):
            kind = _kind(float(opening))
            if kind:
                rows.append((float(x), float(y), float(start), float(opening), kind))
    wedges = np.array(rows, dtype=float).reshape(-1, 5)
    start, end = wedges[:, 2], wedges[:, 2] + wedges[:, 3]
    return np.column_stack([wedges, np.cos(start), np.sin(start), np.cos(end), np.sin(end)])


def _kind(opening: float) -> float:
    if abs(opening - math.pi / 2) <= _CORNER_TOLERANCE_RAD:
        return RIGHT_CORNER
    return CONVEX_EDGE if opening >= _EDGE_OPENING_RAD else 0.0


def _cells(walls: Array, cylinders: Array, reach_m: float) -> tuple[Array, NDArray[np.object_]]:
    """Square cells over everything that could be heard: the frame of the index, and each cell as a box."""
    xy = np.vstack([walls[:, 0:2], walls[:, 2:4], cylinders[:, :2]])
    low, high = xy.min(axis=0) - reach_m, xy.max(axis=0) + reach_m
    columns, rows = (int(math.ceil(extent / CELL_M)) for extent in high - low)
    x = low[0] + CELL_M * np.arange(columns)
    y = low[1] + CELL_M * np.arange(rows)
    gx, gy = (grid.ravel() for grid in np.meshgrid(x, y))
    return np.array([low[0], low[1], CELL_M, rows, columns]), shapely.box(gx, gy, gx + CELL_M, gy + CELL_M)


def _neighbours(
    cells: NDArray[np.object_], shapes: NDArray[np.object_], reach_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each cell, what lies within reach of any point of it: items[first[cell]:first[cell + 1]], ascending."""
    if not len(shapes):
        return np.zeros(len(cells) + 1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    cell, item = shapely.STRtree(shapes).query(cells, predicate="dwithin", distance=reach_m)
    order = np.lexsort((item, cell))
    first = np.searchsorted(cell[order], np.arange(len(cells) + 1))
    return first.astype(np.int64), item[order].astype(np.int64)
