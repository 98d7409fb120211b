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
    edge = np.zeros(grid.frame.shape, dtype=bool)
    _mark_edge(grid.states, way, edge)
    cells, regions = labelled(edge)
    order = np.argsort(regions, kind="stable")
    ends = np.cumsum(np.bincount(regions))
    found = [
        Frontier(coords, tuple(grid.frame.centres(coords).mean(axis=0)))
        for coords in np.split(cells[order], ends[:-1])
        if len(coords) * grid.frame.resolution_m >= min_length_m
    ]
    return tuple(sorted(found, key=lambda f: (-len(f.cells), f.centroid)))


@kernel
def _mark_edge(states, way, edge):  # type: ignore[no-untyped-def]
    rows, columns = states.shape
    for row in range(rows):
        for column in range(columns):
            if states[row, column] != FREE or not way[row, column]:
                continue
            for r in range(max(0, row - 1), min(rows, row + 2)):
                for c in range(max(0, column - 1), min(columns, column + 2)):
                    if states[r, c] == UNKNOWN and way[r, c]:
                        edge[row, column] = True
