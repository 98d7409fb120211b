"""Frontiers: where free space that the body can reach meets space nobody has looked at (Yamauchi 1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.mapping.grid import FREE, UNKNOWN, Mask
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.mapping.regions import labelled


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
    way = passable(grid, body_radius_m)
    cells = _edge(grid.states, way)
    if not len(cells):
        return ()
    regions = labelled(cells, grid.frame.shape)
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


@kernel
def _edge(states, way):  # type: ignore[no-untyped-def]
    """Free, passable cells that touch a passable unknown one, by rows, shape (n, 2)."""
    rows, columns = states.shape
    cells = np.empty((states.size, 2), dtype=np.int64)
    count = 0
    for row in range(rows):
        for column in range(columns):
            if states[row, column] != FREE or not way[row, column]:
                continue
            if _touches(states, way, row, column):
                cells[count, 0], cells[count, 1] = row, column
                count += 1
    return cells[:count].copy()


@inner_kernel
def _touches(states, way, row, column):  # type: ignore[no-untyped-def]
    """Whether one of the eight neighbours is unknown and passable."""
    rows, columns = states.shape
    for r in range(max(0, row - 1), min(rows, row + 2)):
        for c in range(max(0, column - 1), min(columns, column + 2)):
            if states[r, c] == UNKNOWN and way[r, c]:
                return True
    return False
