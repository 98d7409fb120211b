"""Cheapest ways over a grid from one cell (Dijkstra 1959, with the buckets of Dial 1969)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Cells

_SQRT2 = math.sqrt(2.0)


Window = tuple[int, int, int, int]
"""First row, row after the last, first column, column after the last."""


def cheapest_costs(cost: Array, start: tuple[int, int]) -> Array:
    """Cost of the cheapest way from the start to each cell, shape (rows, columns); inf where there is none.

    A step leads to one of eight neighbours and costs the mean of both cells' costs times its length in cells. A
    diagonal step needs both cells beside it as well: it would cut their corners.

    Args:
        cost: of each cell, at least 1, inf where it must not be entered, shape (rows, columns).
        start: (row, column); its cost is finite.
    """
    rimmed = np.pad(cost, 1, constant_values=np.inf)
    out, entries = np.full(rimmed.shape, np.inf), np.empty((most_entries(cost.size), 2), dtype=np.int32)
    dearest = float(cost[np.isfinite(cost)].max())
    spread_costs(rimmed, (start[0] + 1, start[1] + 1), math.inf, dearest, entries, out)
    return out[1:-1, 1:-1].copy()


def most_entries(cells: int) -> int:
    """How many `spread_costs` may need if so many cells may be entered: each from eight others."""
    return 8 * cells + 2


def spread_costs(
    cost: Array, start: tuple[int, int], most: float, dearest: float, entries: NDArray[np.int32], out: Array
) -> tuple[Window, bool]:
    """The same where a rim of inf, one cell wide, lies about the cells, as far as ways cost no more than `most`.

    Args:
        dearest: no cell costs more.
        entries: to be written to, shape (`most_entries`, 2).
        out: filled, shape (rows, columns) as `cost`; inf before, wherever there are neighbours of cells that are
            entered.

    Returns:
        The window within that the ways reach, and whether there are others, that cost more.
    """
    first_row, end_row, first_column, end_column, more = _spread(
        cost.reshape(-1), cost.shape[1], *start, most, dearest, entries, out.reshape(-1)
    )
    return (first_row, end_row, first_column, end_column), more


def cheapest_way(cost: Array, costs: Array, end: tuple[int, int], reached: Window | None = None) -> Cells:
    """The cells of a cheapest way, from the start to a cell that has one, shape (n, 2).

    Where several are as cheap, straight steps go before diagonal ones, and lower rows and columns first.

    Args:
        reached: the part of both that ways lead to; None for all.
    """
    reached = reached or (0, cost.shape[0], 0, cost.shape[1])
    return np.asarray(_way_back(cost, costs, end[0], end[1], reached))[::-1]


@kernel
def _spread(costs, columns, row, column, most, dearest, entries, outs):  # type: ignore[no-untyped-def]
    """Bucket k holds the cells between k and k + 1 away. No step costs less than 1: they all are final at once.

    `costs` and `outs` are row after row of so many columns. A bucket is a list: a cell, and the entry that follows.
    """
    size = 4  # of the round of buckets: a power of two, so that a mask finds the place in it
    while size < math.ceil(_SQRT2 * dearest) + 2:
        size *= 2
    buckets = np.zeros(size, dtype=np.int32)
    steps = np.empty(8, dtype=np.int64)
    steps[0], steps[1], steps[2], steps[3] = -columns, -1, 1, columns
    steps[4], steps[5], steps[6], steps[7] = -columns - 1, -columns + 1, columns - 1, columns + 1
    at = row * columns + column
    entries[1, 0], entries[1, 1], buckets[0] = at, 0, 1
    outs[at] = 0.0
    used, waiting, level = 2, 1, 0
    low_row, high_row, low_column, high_column, more = row, row, column, column, False
    while waiting > 0:
        entry = buckets[level & (size - 1)]
        buckets[level & (size - 1)] = 0
        while entry > 0:
            at = np.int64(entries[entry, 0])
            entry = entries[entry, 1]
            waiting -= 1
            here = outs[at]
            if here < level:  # was there already, by a cheaper way
                continue
            if here > most:
                outs[at], more = np.inf, True
                continue
            row = at // columns
            column = at - row * columns
            low_row, high_row = min(low_row, row), max(high_row, row)
            low_column, high_column = min(low_column, column), max(high_column, column)
            for k in range(8):
                to = at + steps[k]
                total = here + 0.5 * (costs[at] + costs[to]) * (1.0 if k < 4 else _SQRT2)
                if total >= outs[to]:  # so it is on the rim and wherever nobody may enter
                    continue
                if k >= 4:
                    side = 1 if k & 1 else -1
                    if costs[at + side] == np.inf or costs[to - side] == np.inf:
                        continue
                outs[to] = total
                bucket = int(total) & (size - 1)
                entries[used, 0], entries[used, 1] = to, buckets[bucket]
                buckets[bucket] = used
                used += 1
                waiting += 1
        level += 1
    return low_row, high_row + 1, low_column, high_column + 1, more


@kernel
def _way_back(cost, costs, row, column, reached):  # type: ignore[no-untyped-def]
    """From the end, each time the neighbour by which the cell came to its cost."""
    first_row, end_row, first_column, end_column = reached
    way = np.empty(((end_row - first_row) * (end_column - first_column), 2), dtype=np.int64)
    way[0, 0], way[0, 1] = row, column
    count = 1
    while costs[row, column] > 0.0:
        found = False
        for diagonal in range(2):
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    r, c = row + dr, column + dc
                    if found or (dr != 0) + (dc != 0) != 1 + diagonal:
                        continue
                    if r < first_row or c < first_column or r >= end_row or c >= end_column:
                        continue
                    if costs[r, c] == np.inf:
                        continue
                    if diagonal and (cost[row, c] == np.inf or cost[r, column] == np.inf):
                        continue
                    length = _SQRT2 if diagonal else 1.0
                    if costs[r, c] + 0.5 * (cost[r, c] + cost[row, column]) * length == costs[row, column]:
                        found = True
                        next_row, next_column = r, c
        row, column = next_row, next_column
        way[count, 0], way[count, 1] = row, column
        count += 1
    return way[:count].copy()
