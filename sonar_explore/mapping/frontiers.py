"""Frontiers: where free space that the body can reach meets space nobody has looked at (Yamauchi 1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_explore.compiled import kernel
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
    regions = labelled(cells, grid.frame.shape)
    order = np.argsort(regions, kind="stable")
    ends = np.cumsum(np.bincount(regions))
    found = [
        Frontier(coords, tuple(grid.frame.centres(coords).mean(axis=0)))
        for coords in np.split(cells[order], ends[:-1])
        if len(coords) * grid.frame.resolution_m >= min_length_m
    ]
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
            touches = False
            for r in range(max(0, row - 1), min(rows, row + 2)):
                for c in range(max(0, column - 1), min(columns, column + 2)):
                    touches = touches or (states[r, c] == UNKNOWN and way[r, c])
            if touches:
                cells[count, 0], cells[count, 1] = row, column
                count += 1
    return cells[:count].copy()
