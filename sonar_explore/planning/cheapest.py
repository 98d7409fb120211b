"""Cheapest ways over a grid from one cell (Dijkstra 1959, with the buckets of Dial 1969)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Cells, Mask

_SQRT2 = math.sqrt(2.0)


Window = tuple[int, int, int, int]
"""First row, row after the last, first column, column after the last."""

_USED, _WAITING, _LEVEL, _LOW_ROW, _HIGH_ROW, _LOW_COLUMN, _HIGH_COLUMN = range(7)


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
    Search(rimmed, (start[0] + 1, start[1] + 1), dearest, out, entries).reach(math.inf)
    return out[1:-1, 1:-1].copy()


def most_entries(cells: int) -> int:
    """How many a search may need if so many cells may be entered: each from eight others."""
    return 8 * cells + 2


class Search:
    """The same, as far as somebody asks: who asks for more goes on from there."""

    def __init__(
        self, cost: Array, start: tuple[int, int], dearest: float, out: Array, entries: NDArray[np.int32]
    ) -> None:
        """
        Args:
            cost: as above, and a rim of inf, one cell wide, about it.
            start: (row, column) with the rim.
            dearest: no cell costs more.
            out: filled; inf before, shape (rows, columns) as `cost`. What costs more than was asked for is not final.
            entries: to be written to, shape (`most_entries`, 2).
        """
        self._cost, self.costs, self._entries = cost.reshape(-1), out, entries
        size = 4  # of the round of buckets: a power of two, so that a mask finds the place in it
        while size < math.ceil(_SQRT2 * dearest) + 2:
            size *= 2
        self._buckets = np.zeros(size, dtype=np.int32)
        (row, column), self._columns = start, cost.shape[1]
        self.costs[start], self._entries[1], self._buckets[0] = 0.0, (row * self._columns + column, 0), 1
        self.state = np.array([2, 1, 0, row, row, column, column])
        """Whatever `_spread` has to know to go on."""
        self._farthest, self._more = 0.0, True
        self._start, self._region = start, np.zeros((0, 0), dtype=bool)
        self._region_window: Window = (row, row + 1, column, column + 1)

    def reach(self, most: float) -> bool:
        """All that costs no more than this; whether there are others, that cost more."""
        self._spread(most, -1)
        return self._more or self._farthest > most

    def costs_to(self, cells: Cells, most: Array) -> Array:
        """What the cheapest way to each of some cells costs that ways lead to, with the rim, shape (n, 2): shape (n,);
        inf where that is more than this, shape (n,).

        Looked for until it is known of all: of the farthest first, for most others lie before it.
        """
        rows, columns = cells.T
        off = 1 + np.abs(cells - self._start).max(axis=1)
        while True:
            costs, level = self.costs[rows, columns], self.state[_LEVEL]
            final = (costs < level) if self._more else costs < math.inf
            waiting = ~final & (most >= level)
            if not (self._more and waiting.any()):
                return np.where(final, costs, math.inf)
            farthest = int(np.argmax(off * waiting))
            self._spread(float(most[farthest]), int(rows[farthest] * self._columns + columns[farthest]))

    def reach_cell(self, row: int, column: int) -> bool:
        """This one, with the rim, if a way leads there: whether one does."""
        leads = self.costs[row, column] < math.inf or (self._more and bool(self.region[row, column]))
        if leads:
            self._spread(math.inf, row * self._columns + column)
        return leads

    @property
    def region(self) -> Mask:
        """All cells that ways lead to, however dear, shape (rows, columns): told without looking for the ways."""
        if not self._region.size:
            self._region = np.zeros(self.costs.shape, dtype=bool)
            self._region_window = _fill_region(
                self._cost, self._columns, *self._start, self._region.reshape(-1)
            )
        return self._region

    @property
    def region_window(self) -> Window:
        """The part in which those lie."""
        assert self.region.size  # told with it
        return self._region_window

    @property
    def window(self) -> Window:
        """Where ways have led so far."""
        return window_of(self.state)

    def _spread(self, most: float, goal: int) -> None:
        if self._more and self.state[_LEVEL] <= most:
            self._farthest, self._more = _spread(
                *(self._cost, self._columns, most, goal, self._farthest),
                *(self.state, self._buckets, self._entries, self.costs.reshape(-1)),
            )


def window_of(state: NDArray[np.int64]) -> Window:
    """Where the ways of a search in this state have led."""
    low_row, high_row, low_column, high_column = state[_LOW_ROW:].tolist()
    return low_row, high_row + 1, low_column, high_column + 1


def cheapest_way(cost: Array, costs: Array, end: tuple[int, int], reached: Window | None = None) -> Cells:
    """The cells of a cheapest way, from the start to a cell that has one, shape (n, 2).

    Where several are as cheap, straight steps go before diagonal ones, and lower rows and columns first.

    Args:
        reached: the part of both that ways lead to; None for all.
    """
    reached = reached or (0, cost.shape[0], 0, cost.shape[1])
    return np.asarray(_way_back(cost, costs, end[0], end[1], reached))[::-1]


@kernel
def _spread(costs, columns, most, goal, farthest, state, buckets, entries, outs):  # type: ignore[no-untyped-def]
    """Bucket k holds the cells between k and k + 1 away. No step costs less than 1: they all are final at once.

    `costs` and `outs` are row after row of so many columns. A bucket is a list: a cell, and the entry that follows.
    As far as `most`, or until the cell `goal` is final, unless that is -1; how far, and whether anything is left.
    """
    used, waiting, level = state[_USED], state[_WAITING], state[_LEVEL]
    low_row, high_row = state[_LOW_ROW], state[_HIGH_ROW]
    low_column, high_column = state[_LOW_COLUMN], state[_HIGH_COLUMN]
    mask, a_row = len(buckets) - 1, 1.0 / columns
    while waiting > 0 and level <= most and (goal < 0 or outs[goal] >= level):
        entry = buckets[level & mask]
        buckets[level & mask] = 0
        while entry > 0:
            at = np.int64(entries[entry, 0])
            entry = entries[entry, 1]
            waiting -= 1
            here = outs[at]
            if here < level:  # was there already, by a cheaper way
                continue
            farthest = max(farthest, here)
            row = int((at + 0.5) * a_row)
            column = at - row * columns
            low_row, high_row = min(low_row, row), max(high_row, row)
            low_column, high_column = min(low_column, column), max(high_column, column)
            own = costs[at]
            for k in range(8):
                if k < 4:
                    to = at + (-columns if k == 0 else -1 if k == 1 else 1 if k == 2 else columns)
                    total = here + 0.5 * (own + costs[to])
                else:
                    side, across = 1 if k & 1 else -1, -columns if k < 6 else columns
                    to = at + side + across
                    total = here + 0.5 * (own + costs[to]) * _SQRT2
                before = outs[to]
                if total >= before:  # so it is on the rim and wherever nobody may enter
                    continue
                if k >= 4 and (costs[at + side] == np.inf or costs[at + across] == np.inf):
                    continue
                outs[to] = total
                whole = int(total)
                if before < whole + 1.0:  # waits in this bucket already
                    continue
                bucket = whole & mask
                entries[used, 0], entries[used, 1] = to, buckets[bucket]
                buckets[bucket] = used
                used += 1
                waiting += 1
        level += 1
    more = False
    for bucket in range(mask + 1 if waiting > 0 else 0):
        entry = buckets[bucket]
        while entry > 0 and not more:
            more = outs[entries[entry, 0]] >= level
            entry = entries[entry, 1]
    state[_USED], state[_WAITING], state[_LEVEL] = used, waiting, level
    state[_LOW_ROW], state[_HIGH_ROW] = low_row, high_row
    state[_LOW_COLUMN], state[_HIGH_COLUMN] = low_column, high_column
    return farthest, more


@kernel
def _fill_region(costs, columns, row, column, region):  # type: ignore[no-untyped-def]
    """What joins a cell by the sides of cells that may be entered: a diagonal step needs both cells beside it, so none
    leads on to anything else. Stretches of rows wait for what joins them above and below. The part in which it lies."""
    waiting = np.empty(len(costs), dtype=np.int32)
    waiting[0], count = row * columns + column, 1
    low_row, high_row, low_column, high_column = row, row, column, column
    while count > 0:
        count -= 1
        first = np.int64(waiting[count])
        if region[first]:
            continue
        last = first
        while costs[first - 1] < np.inf:
            first -= 1
        while costs[last + 1] < np.inf:
            last += 1
        row = first // columns
        low_row, high_row = min(low_row, row), max(high_row, row)
        low_column = min(low_column, first - row * columns)
        high_column = max(high_column, last - row * columns)
        for at in range(first, last + 1):
            region[at] = True
        for beside in (-columns, columns):
            joined = False
            for at in range(first + beside, last + beside + 1):
                enters = costs[at] < np.inf and not region[at]
                if enters and not joined:
                    waiting[count] = at
                    count += 1
                joined = enters
    return low_row, high_row + 1, low_column, high_column + 1


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
