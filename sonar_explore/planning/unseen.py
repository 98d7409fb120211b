"""How much that nobody has looked at a scan at a place would show."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.changes import changed_spans, whole_spans
from sonar_explore.mapping.grid import UNKNOWN, Cells, GridFrame, States, window
from sonar_explore.mapping.occupancy import OccupancyGrid

RAYS = 48
_OPEN, _UNSEEN, _SHUT = 0, 1, 2


def new_area(grid: OccupancyGrid, cells: Cells, body_radius_m: float, view_m: float) -> Array:
    """Unseen area in line of sight of each cell that the body could occupy, shape (n,), [m2].

    Rays run through passable cells, known or not, and count the unknown ones, each for its share of the disc.
    """
    key = ("new area", body_radius_m, view_m)
    seen = grid.keeper(key, lambda: _Seen(body_radius_m, view_m, grid.frame)).of(grid, cells)
    return 2.0 * math.pi * grid.frame.resolution_m**2 / RAYS * seen


class _Seen:
    """What was counted from a cell on one map is kept for the next ones until something changes in view of it."""

    def __init__(self, body_radius_m: float, view_m: float, frame: GridFrame) -> None:
        self._body = body_radius_m
        self._steps = int(view_m / frame.resolution_m)
        angle = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
        radius = np.arange(1, self._steps + 1)
        self._rows, self._columns = (
            np.round(radius[None, :] * along(angle)[:, None]).astype(np.int64) for along in (np.sin, np.cos)
        )
        # a wall shuts cells as far away as the body reaches
        self._felt = self._steps + 1 + math.ceil(body_radius_m / frame.resolution_m)
        self._frame = frame
        self._states: States = np.zeros(frame.shape, dtype=np.uint8)
        self._seen: NDArray[np.int64] = np.full(frame.shape, -1)
        self._ways: NDArray[np.uint8] = np.empty((0, 0), dtype=np.uint8)
        """What a ray meets in each cell, and a rim about the grid that none gets across."""

    def of(self, grid: OccupancyGrid, cells: Cells) -> Array:
        """Sum of the radii, in cells, at which each cell's rays meet unseen cells before the way ends, shape (n,)."""
        if grid.states is not self._states:
            to_walls, rim = grid.to_walls_m, self._steps
            if grid.frame != self._frame:
                self._grow(grid.frame)
            spans = changed_spans(self._states, grid.states, self._felt)
            _forget(spans, self._seen)
            rimmed = grid.frame.shape[0] + 2 * rim, grid.frame.shape[1] + 2 * rim
            if self._ways.shape != rimmed:
                self._ways, spans = np.full(rimmed, _SHUT, dtype=np.uint8), whole_spans(grid.frame.shape)
            _tell_ways(spans, grid.states, to_walls, self._body, rim, self._ways)
            self._states = grid.states
        out, across = np.empty(len(cells)), self._ways.shape[1]
        rays = self._rows * across + self._columns
        _see(cells, self._ways.reshape(-1), across, self._steps, rays, self._seen, out)
        return out

    def _grow(self, frame: GridFrame) -> None:
        """Rays that ended at the old rim go on now: what is near it is forgotten."""
        row, column = frame.cell(
            self._frame.x0 + 0.5 * frame.resolution_m, self._frame.y0 + 0.5 * frame.resolution_m
        )
        inner = self._seen[self._felt : -self._felt, self._felt : -self._felt]
        seen = np.full(frame.shape, -1)
        row, column = row + self._felt, column + self._felt
        seen[row : row + inner.shape[0], column : column + inner.shape[1]] = inner
        self._states, self._seen = window(self._frame, self._states, frame), seen
        self._frame = frame


@kernel
def _forget(spans, seen):  # type: ignore[no-untyped-def]
    for row in range(len(spans)):
        for stripe in range(spans.shape[1]):
            for column in range(spans[row, stripe, 0], spans[row, stripe, 1] + 1):
                seen[row, column] = -1


@kernel
def _tell_ways(spans, states, to_walls, body, rim, ways):  # type: ignore[no-untyped-def]
    for row in range(len(spans)):
        for stripe in range(spans.shape[1]):
            for column in range(spans[row, stripe, 0], spans[row, stripe, 1] + 1):
                way = _SHUT
                if to_walls[row, column] > body:
                    way = _UNSEEN if states[row, column] == UNKNOWN else _OPEN
                ways[row + rim, column + rim] = way


@kernel
def _see(cells, ways, across, rim, rays, seen, out):  # type: ignore[no-untyped-def]
    """`ways`: row after row of so many; `rays`: how far on in them the cells of each ray lie."""
    for i in range(len(cells)):
        total = seen[cells[i, 0], cells[i, 1]]
        if total < 0:
            total = 0
            at = (cells[i, 0] + rim) * across + cells[i, 1] + rim
            for ray in range(rays.shape[0]):
                for k in range(rays.shape[1]):
                    way = ways[at + rays[ray, k]]
                    if way == _SHUT:
                        break
                    if way == _UNSEEN:
                        total += k + 1
            seen[cells[i, 0], cells[i, 1]] = total
        out[i] = total
