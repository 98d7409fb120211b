"""Cheapest ways over a grid from one cell (Dijkstra 1959, with the buckets of Dial 1969)."""

from __future__ import annotations

import math

import numpy as np

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
    out = np.empty(cost.shape)
    spread_costs(cost, start, (0, cost.shape[0], 0, cost.shape[1]), math.inf, out)
    return out


def spread_costs(
    cost: Array, start: tuple[int, int], window: Window, most: float, out: Array
) -> tuple[Window, bool]:
    """The same into a window of `out`, as far as ways cost no more: the window within that which they reach, and
    whether there are others, that cost more.

    Nothing is looked at outside the window, and no way leads out of it.
    """
    first_row, end_row, first_column, end_column, more = _spread(
        cost.reshape(-1), cost.shape[1], *start, window, most, out.reshape(-1)
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
def _spread(costs, columns, row, column, window, most, outs):  # type: ignore[no-untyped-def]
    """Bucket k holds the cells between k and k + 1 away. No step costs less than 1: they all are final at once.

    `costs` and `outs` are row after row of so many columns.
    """
    first_row, end_row, first_column, end_column = window
    dearest, open_cells = 1.0, 0
    for r in range(first_row, end_row):
        for at in range(r * columns + first_column, r * columns + end_column):
            outs[at] = np.inf
            if costs[at] < np.inf:
                dearest = max(dearest, costs[at])
                open_cells += 1
    size = 4  # of the round of buckets: a power of two, so that a mask finds the place in it
    while size < math.ceil(_SQRT2 * dearest) + 2:
        size *= 2
    buckets = np.full(size, -1)
    cells = np.empty(8 * open_cells + 1, dtype=np.int32)
    following = np.empty(8 * open_cells + 1, dtype=np.int32)
    cells[0], following[0], buckets[0] = row * columns + column, -1, 0
    outs[cells[0]] = 0.0
    used = waiting = 1
    level = 0
    low_row, high_row, low_column, high_column, more = row, row, column, column, False
    while waiting > 0:
        entry = buckets[level & (size - 1)]
        buckets[level & (size - 1)] = -1
        while entry >= 0:
            at = cells[entry]
            entry = following[entry]
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
            for dr in range(-1, 2):
                r = row + dr
                if r < first_row or r >= end_row:
                    continue
                for dc in range(-1, 2):
                    c = column + dc
                    if c < first_column or c >= end_column or costs[r * columns + c] == np.inf:
                        continue
                    to, length = r * columns + c, _SQRT2 if dr != 0 and dc != 0 else 1.0
                    total = here + 0.5 * (costs[at] + costs[to]) * length
                    if total >= outs[to]:
                        continue
                    beside = costs[row * columns + c], costs[r * columns + column]
                    if dr != 0 and dc != 0 and (beside[0] == np.inf or beside[1] == np.inf):
                        continue
                    outs[to] = total
                    bucket = int(total) & (size - 1)
                    cells[used], following[used] = to, buckets[bucket]
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
