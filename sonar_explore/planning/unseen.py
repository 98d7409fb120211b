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
LOOK_RAYS = 192  # at thirty cells from a scan no cell between two of them is missed
HOPES = (1.0, 1.0, 0.5, 0.25)
"""How likely an unknown cell is open by how many scans had it in view, none, one, two and more, against one that none
had. Of the unknown cells at the rim of what is free 56, 51, 20 and 7 % were floor (twelve generated worlds); the last
two are hoped for more, so that a room that scans in its door did not clear stays worth another."""

UNLOOKED = 8  # above every state of a cell
MOST_LOOKED = UNLOOKED + len(HOPES) - 1


def new_area(grid: OccupancyGrid, cells: Cells, scanned: Array, body_radius_m: float, view_m: float) -> Array:
    """Unseen area in line of sight of each cell that is to be hoped for, shape (n,), [m2].

    Rays run through cells that the body could occupy, known or not, and count the unknown ones, each for its share of
    the disc, and for the least hope of those that the ray has come through: what several scans looked at and did not
    clear is hardly open, and nor is what lies behind it.

    Args:
        grid: the map.
        cells: from where, shape (n, 2).
        scanned: scan positions so far, shape (k, 2), map frame, [m].
        body_radius_m: of the body.
        view_m: how far a scan is expected to clear.
    """
    key = ("new area", body_radius_m, view_m)
    seen = grid.keeper(key, lambda: _Seen(body_radius_m, view_m, grid.frame)).of(grid, cells, scanned)
    return 2.0 * math.pi * grid.frame.resolution_m**2 / RAYS * seen


def _rays(count: int, steps: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the cells of rays from a cell, off it, shape (count, steps)."""
    angle = (np.arange(count) + 0.5) * (2.0 * math.pi / count)
    radius = np.arange(1, steps + 1)
    rows, columns = (
        np.round(radius[None, :] * along(angle)[:, None]).astype(np.int64) for along in (np.sin, np.cos)
    )
    return rows, columns


class _Seen:
    """What was counted from a cell on one map is kept for the next ones until something changes in view of it."""

    def __init__(self, body_radius_m: float, view_m: float, frame: GridFrame) -> None:
        self._body = body_radius_m
        steps = int(view_m / frame.resolution_m)
        self._rays, self._look_rays = _rays(RAYS, steps), _rays(LOOK_RAYS, steps)
        # a wall shuts cells as far away as the body reaches
        self._felt = steps + 1 + math.ceil(body_radius_m / frame.resolution_m)
        self._frame = frame
        self._states: States = np.zeros(frame.shape, dtype=np.uint8)
        """With unknown cells by how many scans had them in view, from `UNLOOKED` on."""
        self._of_states: States | None = None
        self._scanned: Array | None = None
        self._seen: Array = np.full(frame.shape, -1.0)

    def of(self, grid: OccupancyGrid, cells: Cells, scanned: Array) -> Array:
        """Sum of the radii, in cells, at which each cell's rays meet unseen cells before the way ends, each times the
        hope for it, shape (n,)."""
        if grid.frame != self._frame:
            self._grow(grid.frame)
        if grid.states is not self._of_states or scanned is not self._scanned:
            states = grid.states.copy()
            _look(grid.frame.cells(scanned), grid.to_walls_m, self._body, self._look_rays, states)
            _forget(changed_spans(self._states, states, self._felt), self._seen)
            self._states, self._of_states, self._scanned = states, grid.states, scanned
        out = np.empty(len(cells))
        _see(cells, self._states, grid.to_walls_m, self._body, self._rays, np.array(HOPES), self._seen, out)
        return out

    def _grow(self, frame: GridFrame) -> None:
        """Rays that ended at the old rim go on now: what is near it is forgotten."""
        row, column = frame.cell(
            self._frame.x0 + 0.5 * frame.resolution_m, self._frame.y0 + 0.5 * frame.resolution_m
        )
        inner = self._seen[self._felt : -self._felt, self._felt : -self._felt]
        seen = np.full(frame.shape, -1.0)
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
def _look(cells, to_walls, body, rays, states):  # type: ignore[no-untyped-def]
    """Mark each unknown cell by how many of the cells, shape (n, 2), have it in view: `UNLOOKED` and as many more."""
    rows, columns = rays
    last = np.full(states.shape, -1, dtype=np.int32)
    for row in range(states.shape[0]):
        for column in range(states.shape[1]):
            if states[row, column] == UNKNOWN:
                states[row, column] = UNLOOKED
    for i in range(len(cells)):
        for ray in range(rows.shape[0]):
            for k in range(rows.shape[1]):
                row, column = cells[i, 0] + rows[ray, k], cells[i, 1] + columns[ray, k]
                if row < 0 or column < 0 or row >= states.shape[0] or column >= states.shape[1]:
                    break
                if to_walls[row, column] <= body:
                    break
                if UNLOOKED <= states[row, column] < MOST_LOOKED and last[row, column] != i:
                    last[row, column] = i
                    states[row, column] += 1


@kernel
def _see(cells, states, to_walls, body, rays, hopes, seen, out):  # type: ignore[no-untyped-def]
    rows, columns = rays
    for i in range(len(cells)):
        total = seen[cells[i, 0], cells[i, 1]]
        if total < 0.0:
            total = 0.0
            for ray in range(rows.shape[0]):
                hope = 1.0
                for k in range(rows.shape[1]):
                    row, column = cells[i, 0] + rows[ray, k], cells[i, 1] + columns[ray, k]
                    if row < 0 or column < 0 or row >= states.shape[0] or column >= states.shape[1]:
                        break
                    if to_walls[row, column] <= body:
                        break
                    if states[row, column] >= UNLOOKED:
                        hope = min(hope, hopes[states[row, column] - UNLOOKED])
                        total += hope * (k + 1)
            seen[cells[i, 0], cells[i, 1]] = total
        out[i] = total
