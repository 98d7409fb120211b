"""Metres to cells and back: the only place. Cells are (row, column), metres (x, y); row 0 is the lowest y."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""States of a cell."""

States = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Cells = NDArray[np.int64]


@dataclass(frozen=True)
class GridFrame:
    """Where a grid lies in the map frame."""

    x0: float
    """Outer corner of cell (0, 0), [m]."""
    y0: float
    """[m]"""
    resolution_m: float
    """Side of a cell, [m]."""
    shape: tuple[int, int]
    """(rows, columns)"""

    def cells(self, points: Array) -> Cells:
        """(row, column) of points (x, y), shape (n, 2) both; not clipped to the grid."""
        return np.floor((np.asarray(points)[:, ::-1] - (self.y0, self.x0)) / self.resolution_m).astype(
            np.int64
        )

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """(row, column) of one point; not clipped to the grid."""
        return math.floor((y - self.y0) / self.resolution_m), math.floor((x - self.x0) / self.resolution_m)

    def centres(self, cells: Cells) -> Array:
        """Centres (x, y) of cells (row, column), shape (n, 2) both, [m]."""
        return (np.asarray(cells)[:, ::-1] + 0.5) * self.resolution_m + (self.x0, self.y0)

    def contains(self, cells: Cells) -> Mask:
        """Which cells lie on the grid, shape (n,)."""
        return np.all((cells >= 0) & (cells < self.shape), axis=1)

    def covering(
        self, low: tuple[float, float], high: tuple[float, float], block_m: float = 1.0
    ) -> GridFrame:
        """This frame, grown in whole blocks until it covers the box; cells keep their places."""
        block = round(block_m / self.resolution_m)
        size = block * self.resolution_m
        left = max(0, math.ceil((self.x0 - low[0]) / size)) * block
        below = max(0, math.ceil((self.y0 - low[1]) / size)) * block
        rows, columns = self.shape
        right = max(0, math.ceil((high[0] - self.x0 - columns * self.resolution_m) / size)) * block
        above = max(0, math.ceil((high[1] - self.y0 - rows * self.resolution_m) / size)) * block
        if left == below == right == above == 0:
            return self
        return GridFrame(
            self.x0 - left * self.resolution_m,
            self.y0 - below * self.resolution_m,
            self.resolution_m,
            (rows + below + above, columns + left + right),
        )


def place_in(frame: GridFrame, target: GridFrame) -> tuple[int, int]:
    """Row and column that the first cell of a frame has in another one of the same lattice."""
    res = target.resolution_m
    return round((frame.y0 - target.y0) / res), round((frame.x0 - target.x0) / res)


def holds(shape: tuple[int, ...], at: tuple[int, int], inner: tuple[int, ...]) -> bool:
    """Whether a grid of this shape holds an inner one, whose first cell is there."""
    return all(a >= 0 and a + n <= m for a, n, m in zip(at, inner, shape, strict=True))


def grown(array: NDArray[Any], at: tuple[int, int], shape: tuple[int, int], fill: Any) -> NDArray[Any]:
    """An array in a larger one of this shape, its first cell there; filled about it."""
    out = np.full(shape, fill, dtype=array.dtype)
    out[at[0] : at[0] + array.shape[0], at[1] : at[1] + array.shape[1]] = array
    return out


def window(frame: GridFrame, states: States, target: GridFrame) -> States:
    """The part of a grid that falls on another frame of the same lattice; unknown where there is none."""
    out = np.zeros(target.shape, dtype=np.uint8)
    (row, column), (rows, columns) = place_in(frame, target), frame.shape
    r0, r1 = max(0, row), min(target.shape[0], row + rows)
    c0, c1 = max(0, column), min(target.shape[1], column + columns)
    if r0 < r1 and c0 < c1:
        out[r0:r1, c0:c1] = states[r0 - row : r1 - row, c0 - column : c1 - column]
    return out
