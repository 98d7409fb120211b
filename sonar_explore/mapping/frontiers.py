"""Frontiers: where free space that the body can reach meets space nobody has looked at (Yamauchi 1997)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.mapping.changes import changed_spans, whole_spans
from sonar_explore.mapping.grid import FREE, UNKNOWN, Cells, GridFrame, Mask, States, grown, holds, place_in
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.mapping.regions import labelled

_OFF = 255  # no state of a cell: it was not on the map


@dataclass(frozen=True, eq=False)
class Frontier:
    """One connected frontier region."""

    cells: np.ndarray
    """(row, column), shape (n, 2)."""
    centroid: tuple[float, float]
    """(x, y), map frame, [m]."""

    def length_m(self, resolution_m: float) -> float:
        """About how long it is, [m]."""
        return len(self.cells) * resolution_m


def passable(grid: OccupancyGrid, body_radius_m: float) -> Mask:
    """Cells, known or not, where the body would touch nothing that is known; shape (rows, columns).

    A gap that the body cannot pass is no way, so nothing behind it counts as a frontier.
    """
    return np.asarray(grid.to_walls_m > body_radius_m)


def find_frontiers(grid: OccupancyGrid, body_radius_m: float, min_length_m: float) -> tuple[Frontier, ...]:
    """Frontier regions of at least this length, the longest first.

    A frontier cell is free, passable, and touches a passable unknown cell.
    """
    cells = grid.keeper(("edge", body_radius_m), lambda: _Edge(body_radius_m, grid.frame)).of(grid)
    if not len(cells):
        return ()
    regions = labelled(cells)
    order, sizes = np.argsort(regions, kind="stable"), np.bincount(regions)
    ends = np.cumsum(sizes)
    cells = cells[order]
    middles = grid.frame.centres(cells)
    found = []
    for end, size in zip(ends.tolist(), sizes.tolist(), strict=True):
        if size * grid.frame.resolution_m >= min_length_m:
            x, y = (middles[end - size : end].sum(axis=0) / size).tolist()
            found.append(Frontier(cells[end - size : end], (x, y)))
    return tuple(sorted(found, key=lambda f: (-len(f.cells), f.centroid)))


class _Edge:
    """Frontier cells of one map after another, by rows, shape (n, 2)."""

    def __init__(self, body_radius_m: float, frame: GridFrame) -> None:
        self._body = body_radius_m
        self._before: tuple[GridFrame, States] = frame, np.zeros((0, 0), dtype=np.uint8)
        self._edge: Mask = np.zeros((0, 0), dtype=bool)

    def of(self, grid: OccupancyGrid) -> Cells:
        """Cells (row, column) of the edge, shape (n, 2), in the order of the map's rows."""
        states, to_walls, (frame, before) = grid.states, grid.to_walls_m, self._before
        at = place_in(frame, grid.frame)
        if not (before.size and holds(states.shape, at, before.shape)):
            spans = whole_spans(states.shape)
            self._edge = np.zeros(states.shape, dtype=bool)
        else:  # a wall shuts cells as far away as the body reaches, and their neighbours are no edge then
            felt = 2 + math.ceil(self._body / grid.frame.resolution_m)
            if frame != grid.frame:
                before = grown(before, at, states.shape, _OFF)
                self._edge = grown(self._edge, at, states.shape, False)
            spans = changed_spans(before, states, felt)
        _mark_edge(states, to_walls, self._body, spans, self._edge)
        self._before = grid.frame, states
        rows, columns = np.divmod(np.flatnonzero(self._edge), states.shape[1])
        return np.column_stack([rows, columns])


@kernel
def _mark_edge(states, to_walls, body, spans, edge):  # type: ignore[no-untyped-def]
    """Which cells of the spans are free, passable and touch a passable unknown one."""
    for row in range(len(spans)):
        for stripe in range(spans.shape[1]):
            for column in range(spans[row, stripe, 0], spans[row, stripe, 1] + 1):
                edge[row, column] = (
                    states[row, column] == FREE
                    and to_walls[row, column] > body
                    and _touches(states, to_walls, body, row, column)
                )


@inner_kernel
def _touches(states, to_walls, body, row, column):  # type: ignore[no-untyped-def]
    """Whether one of the eight neighbours is unknown and passable."""
    rows, columns = states.shape
    for r in range(max(0, row - 1), min(rows, row + 2)):
        for c in range(max(0, column - 1), min(columns, column + 2)):
            if states[r, c] == UNKNOWN and to_walls[r, c] > body:
                return True
    return False
