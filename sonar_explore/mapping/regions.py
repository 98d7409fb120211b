"""Connected regions of a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sonar_explore.compiled import inner_allocating_kernel, kernel
from sonar_explore.mapping.changes import changed_spans, whole_spans
from sonar_explore.mapping.grid import Cells, Mask


def without_holes(mask: Mask, most: int) -> Mask:
    """The mask with holes of up to so many cells, joined by their sides, filled; shape (rows, columns)."""
    out = np.empty_like(mask)
    _refill(mask, most, whole_spans(mask.shape), out)
    return out


class WithoutHoles:
    """`without_holes` of one mask after another: a hole is looked for anew where a cell within its size has changed."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._mask: Mask = np.zeros((0, 0), dtype=bool)
        self._filled = self._mask

    def of(self, mask: Mask) -> Mask:
        """Shape (rows, columns); the array is written to at the next call."""
        if mask.shape != self._mask.shape:
            self._filled = without_holes(mask, self._most)
        else:
            _refill(mask, self._most, changed_spans(self._mask, mask, self._most + 1), self._filled)
        self._mask = mask
        return self._filled


def enclosed_blocks(
    free: Mask, origin: tuple[float, float], resolution_m: float, least_m2: float
) -> list[tuple[float, float]]:
    """Middles x y [m] of the areas of at least this size that free cells surround.

    Args:
        free: shape (rows, columns).
        origin: outer corner x y of cell (0, 0), [m].
        resolution_m: side of a cell, [m].
        least_m2: area, [m2].
    """
    blocks, _ = ndimage.label(ndimage.binary_fill_holes(free) & ~free)
    rows, columns = np.nonzero(blocks)
    block = blocks[rows, columns]
    areas = np.bincount(block)
    row_sums, column_sums = np.bincount(block, weights=rows), np.bincount(block, weights=columns)
    return [
        (
            origin[0] + (float(column_sums[i] / areas[i]) + 0.5) * resolution_m,
            origin[1] + (float(row_sums[i] / areas[i]) + 0.5) * resolution_m,
        )
        for i in range(1, len(areas))
        if areas[i] * resolution_m**2 >= least_m2
    ]


def labelled(cells: Cells) -> NDArray[np.int64]:
    """The region of each cell, shape (n,), of cells by rows, shape (n, 2).

    Regions join by sides and corners, and count from 0 by their first cells.
    """
    if not len(cells):
        return np.zeros(0, dtype=np.int64)
    first = cells.min(axis=0)
    rows, columns = (cells.max(axis=0) - first + 1).tolist()
    regions = np.full(len(cells), -1)
    _label(cells - first, np.full((rows, columns), -1, dtype=np.int32), regions)
    return regions


@kernel
def _refill(mask, most, spans, filled):  # type: ignore[no-untyped-def]
    """What is without holes in the boxes that hold the spans, one for each run of stripes side by side that have any:
    told from a window wide enough to hold every small hole of the box, and enough of every large one to tell it."""
    rows, columns = mask.shape
    stripe = 0
    while stripe < spans.shape[1]:
        low_row, high_row, low, high = rows, -1, columns, -1
        more = True
        while more and stripe < spans.shape[1]:
            more = False
            for row in range(rows):
                if spans[row, stripe, 0] <= spans[row, stripe, 1]:
                    low_row, high_row, more = min(low_row, row), max(high_row, row), True
                    low, high = min(low, spans[row, stripe, 0]), max(high, spans[row, stripe, 1])
            stripe += 1
        if high_row >= 0:
            first_row, first = max(0, low_row - most - 1), max(0, low - most - 1)
            window = mask[first_row : high_row + most + 2, first : high + most + 2].copy()
            _fill(window, most)
            for row in range(low_row, high_row + 1):
                for column in range(low, high + 1):
                    filled[row, column] = window[row - first_row, column - first]


@inner_allocating_kernel
def _fill(mask, most):  # type: ignore[no-untyped-def]
    rows, columns = mask.shape
    large = np.zeros((rows, columns), dtype=np.bool_)
    hole = np.empty((most + 4, 2), dtype=np.int64)
    for row in range(rows):
        for column in range(columns):
            if mask[row, column] or large[row, column]:
                continue
            if (row > 0 and large[row - 1, column]) or (column > 0 and large[row, column - 1]):
                large[row, column] = True
                continue
            hole[0, 0], hole[0, 1] = row, column
            mask[row, column] = True
            count, done, small = 1, 0, True
            while small and done < count:
                for dr, dc in ((-1, 0), (0, -1), (0, 1), (1, 0)):
                    r, c = hole[done, 0] + dr, hole[done, 1] + dc
                    if r < 0 or c < 0 or r >= rows or c >= columns or mask[r, c]:
                        continue
                    if large[r, c] or count >= most:
                        small = False
                        break
                    hole[count, 0], hole[count, 1] = r, c
                    mask[r, c] = True
                    count += 1
                done += 1
            if not small or count > most:
                for k in range(count):
                    mask[hole[k, 0], hole[k, 1]] = False
                    large[hole[k, 0], hole[k, 1]] = True


@kernel
def _label(cells, index, regions):  # type: ignore[no-untyped-def]
    rows, columns = index.shape
    for i in range(len(cells)):
        index[cells[i, 0], cells[i, 1]] = i
    queue = np.empty(len(cells), dtype=np.int64)
    region = 0
    for first in range(len(cells)):
        if regions[first] >= 0:
            continue
        queue[0], regions[first] = first, region
        count, done = 1, 0
        while done < count:
            row, column = cells[queue[done], 0], cells[queue[done], 1]
            done += 1
            for r in range(max(0, row - 1), min(rows, row + 2)):
                for c in range(max(0, column - 1), min(columns, column + 2)):
                    i = index[r, c]
                    if i >= 0 and regions[i] < 0:
                        queue[count], regions[i] = i, region
                        count += 1
        region += 1
