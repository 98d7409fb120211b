"""Frontiers: where free space that the body can reach meets space nobody has looked at (Yamauchi 1997)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage.measure import label, regionprops

from sonar_explore.mapping.grid import FREE, UNKNOWN, Mask
from sonar_explore.mapping.occupancy import OccupancyGrid

_EIGHT = np.ones((3, 3), dtype=bool)


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
    unseen = (grid.states == UNKNOWN) & way
    edge = (grid.states == FREE) & way & ndimage.binary_dilation(unseen, _EIGHT)
    regions = regionprops(label(edge, connectivity=2))
    found = [
        Frontier(r.coords, tuple(grid.frame.centres(r.coords).mean(axis=0)))
        for r in regions
        if len(r.coords) * grid.frame.resolution_m >= min_length_m
    ]
    return tuple(sorted(found, key=lambda f: (-len(f.cells), f.centroid)))
