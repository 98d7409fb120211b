"""How much that nobody has looked at a scan at a place would show."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.changes import changed_spans
from sonar_explore.mapping.grid import UNKNOWN, Cells, GridFrame, States, window
from sonar_explore.mapping.occupancy import OccupancyGrid

RAYS = 48


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
        steps = int(view_m / frame.resolution_m)
        angle = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
        radius = np.arange(1, steps + 1)
        self._rows, self._columns = (
            np.round(radius[None, :] * along(angle)[:, None]).astype(np.int64) for along in (np.sin, np.cos)
        )
        # a wall shuts cells as far away as the body reaches
        self._felt = steps + 1 + math.ceil(body_radius_m / frame.resolution_m)
        self._frame = frame
        self._states: States = np.zeros(frame.shape, dtype=np.uint8)
        self._seen: NDArray[np.int64] = np.full(frame.shape, -1)

    def of(self, grid: OccupancyGrid, cells: Cells) -> Array:
        """Sum of the radii, in cells, at which each cell's rays meet unseen cells before the way ends, shape (n,)."""
        if grid.frame != self._frame:
            self._grow(grid.frame)
        if grid.states is not self._states:
            _forget(changed_spans(self._states, grid.states, self._felt), self._seen)
            self._states = grid.states
        out = np.empty(len(cells))
        rays = self._rows, self._columns
        _see(cells, grid.states, grid.to_walls_m, self._body, rays, self._seen, out)
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
        for column in range(spans[row, 0], spans[row, 1] + 1):
            seen[row, column] = -1


@kernel
def _see(cells, states, to_walls, body, rays, seen, out):  # type: ignore[no-untyped-def]
    rows, columns = rays
    for i in range(len(cells)):
        total = seen[cells[i, 0], cells[i, 1]]
        if total < 0:
            total = 0
            for ray in range(rows.shape[0]):
                for k in range(rows.shape[1]):
                    row, column = cells[i, 0] + rows[ray, k], cells[i, 1] + columns[ray, k]
                    if row < 0 or column < 0 or row >= states.shape[0] or column >= states.shape[1]:
                        break
                    if to_walls[row, column] <= body:
                        break
                    if states[row, column] == UNKNOWN:
                        total += k + 1
            seen[cells[i, 0], cells[i, 1]] = total
        out[i] = total
