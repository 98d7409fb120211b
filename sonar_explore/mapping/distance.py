"""Distance of every cell to the nearest cell of a kind: exact, in linear time, and anew only where it can have changed.

Meijster, Roerdink & Hesselink 2000: down each column first, then the lower envelope of parabolas along each row, all
in whole numbers.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.changes import Spans, whole_spans
from sonar_explore.mapping.grid import Mask, grown, holds

_NONE = 2**31 - 1  # the square of the distance where there is none


def distances(to: Mask) -> Array:
    """Distance of each cell's middle to that of the nearest cell in `to`, in cells, shape (rows, columns).

    inf where there is none.

    >>> distances(np.array([[True, False, False]]))
    array([[0., 1., 2.]])
    """
    return Distances().of(to)


class Distances:
    """Distances to the cells of one mask after another: between two that differ little, little is worked out.

    A cell farther from every cell that changed than from the nearest of the kind keeps its distance, and along a row
    so does whatever lies beyond such a cell.
    """

    def __init__(self, less: float = 0.0, cell_m: float = 1.0) -> None:
        """
        Args:
            less: how much nearer than the middle of the nearest cell what counts begins, in cells.
            cell_m: side of a cell, [m]; distances come in it.
        """
        self._less, self._cell_m = less, cell_m
        self._to: Mask = np.zeros((0, 0), dtype=bool)
        self._watches: list[Watch] = []

    def of(self, to: Mask, at: tuple[int, int] = (0, 0)) -> Array:
        """Shape (rows, columns), [m]; the array is written to at the next call. `at`: where a mask that has grown has
        the first cell of the one before."""
        spans = np.empty((len(to), 2), dtype=np.int64)
        spans[:] = to.shape[1], -1
        if not (self._to.size and holds(to.shape, at, self._to.shape)):
            spans = self._begin(to.shape)
        elif self._to.shape != to.shape:
            self._grow(at, to.shape, spans)
        _renew(self._to, to, self._down, self._squares, self._less, self._cell_m, self._distances, spans)
        self._to = to.copy()
        for watch in self._watches:
            watch.widen(spans)
        return self._distances

    def _begin(self, shape: tuple[int, int]) -> Spans:
        """From nothing: no cell is of the kind. All is new."""
        self._to, self._distances = np.zeros(shape, dtype=bool), np.empty(shape)
        self._down = np.full(shape, sum(shape), dtype=np.int32)
        self._squares = np.full(shape, _NONE, dtype=np.int32)
        for watch in self._watches:
            watch.begin(whole_spans(shape))
        return whole_spans(shape)

    def _grow(self, at: tuple[int, int], shape: tuple[int, int], spans: Spans) -> None:
        """Go over to more rows and columns, none of whose cells are of the kind; which are new, into `spans`."""
        (row, column), (rows, columns), far = at, self._to.shape, sum(shape)
        down = np.where(self._down >= rows + columns, far, self._down)
        self._to, self._down = grown(self._to, at, shape, False), grown(down, at, shape, far)
        above, below = self._down[:row], self._down[row + rows :]
        above[:] = np.minimum(self._down[row] + np.arange(row, 0, -1)[:, None], far)
        below[:] = np.minimum(self._down[row + rows - 1] + np.arange(1, len(below) + 1)[:, None], far)
        self._squares = grown(self._squares, at, shape, _NONE)
        self._distances = grown(self._distances, at, shape, np.inf)
        if column > 0:
            spans[:] = 0, column - 1
        if column + columns < shape[1]:
            np.minimum(spans[:, 0], column + columns, out=spans[:, 0])
            spans[:, 1] = shape[1] - 1
        spans[:row] = spans[row + rows :] = 0, shape[1] - 1
        for watch in self._watches:
            watch.move(at, shape[0])

    def watch(self) -> Watch:
        """Tells from now on where they have changed; at first, everywhere."""
        self._watches.append(Watch(whole_spans(self._to.shape)))
        return self._watches[-1]


class Watch:
    """Where distances have changed since somebody asked last."""

    def __init__(self, spans: Spans) -> None:
        self._spans = spans

    def begin(self, spans: Spans) -> None:
        """There, whatever was before."""
        self._spans = spans

    def move(self, at: tuple[int, int], rows: int) -> None:
        """What was the first cell lies there now; so many rows."""
        before, self._spans = self._spans, np.empty((rows, 2), dtype=np.int64)
        self._spans[:] = 2**31, -1
        self._spans[at[0] : at[0] + len(before)] = (
            before + at[1]
        )  # of a row that has none, the first comes last still

    def widen(self, spans: Spans) -> None:
        """There, too."""
        np.minimum(self._spans[:, 0], spans[:, 0], out=self._spans[:, 0])
        np.maximum(self._spans[:, 1], spans[:, 1], out=self._spans[:, 1])

    def take(self) -> Spans:
        """First column and last of each row, shape (rows, 2); the last is before the first where a row has none."""
        spans, self._spans = self._spans, np.empty_like(self._spans)
        self._spans[:] = 2**31, -1
        return spans


@kernel
def _renew(before, to, down, squares, less, cell_m, out, spans):  # type: ignore[no-untyped-def]
    """Go over from the distances to `before` to those to `to`. `spans`: what nothing is known of yet in each row, then
    what was worked out anew.

    `down` is the distance within each column, `squares` the square of that to any cell, both in cells.
    """
    rows, columns = to.shape
    far = rows + columns
    first, last = np.full(columns, rows), np.full(columns, -1)
    for r in range(rows):
        differ = 0
        for c in range(columns):
            differ += before[r, c] != to[r, c]
        if differ:
            for c in range(columns):
                if before[r, c] != to[r, c]:
                    first[c], last[c] = min(first[c], r), r
    left, right = spans[:, 0], spans[:, 1]  # what changed down the columns, by rows
    above = np.empty(rows, dtype=np.int32)
    for c in range(columns):
        if last[c] >= 0:
            _down_again(to, down, c, first[c], last[c], far, above, left, right)
    envelope = np.empty((2, columns), dtype=np.int32)
    for r in range(rows):
        if right[r] >= 0:
            a, b = left[r], right[r]
            while a > 0 and squares[r, a - 1] >= (left[r] - (a - 1)) ** 2:
                a -= 1
            while b < columns - 1 and squares[r, b + 1] >= (b + 1 - right[r]) ** 2:
                b += 1
            # what is nearest to the cells from a to b lies between what is nearest to those beside them
            first_column = max(0, a - 1 - int(math.sqrt(squares[r, a - 1]))) if a > 0 else 0
            last_column = columns - 1
            if b < columns - 1:
                last_column = min(last_column, b + 1 + int(math.sqrt(squares[r, b + 1])))
            _along(down[r], far, first_column, last_column, a, b, envelope, squares[r])
            _root(squares[r], less, cell_m, a, b, out[r])
            spans[r, 0], spans[r, 1] = a, b


@inner_kernel
def _down_again(to, down, c, first, last, far, above, left, right):  # type: ignore[no-untyped-def]
    """Distances within a column, whose cells changed between two rows: anew as far as the next cells of the kind."""
    first, last = max(0, first - 1), min(len(to) - 1, last + 1)
    while first > 0 and not to[first, c]:
        first -= 1
    while last < len(to) - 1 and not to[last, c]:
        last += 1
    nearest = far
    for r in range(last, first - 1, -1):
        nearest = 0 if to[r, c] else min(far, nearest + 1)
        above[r] = nearest
    nearest = far
    for r in range(first, last + 1):
        nearest = 0 if to[r, c] else min(far, nearest + 1)
        distance = min(nearest, above[r])
        if down[r, c] != distance:
            down[r, c] = distance
            left[r], right[r] = min(left[r], c), max(right[r], c)


@inner_kernel
def _along(down, far, first, last, begin_at, end_at, envelope, squares):  # type: ignore[no-untyped-def]
    """Squares of the distances of a row's cells between two, if what is nearest to them lies between two columns.

    `envelope` holds the columns whose parabolas make it, and where each one's part begins.
    """
    columns = len(down)
    parts = 0
    for u in range(first, last + 1):
        gu = down[u]
        left, right = down[max(u - 1, 0)], down[min(u + 1, columns - 1)]
        if gu >= far or (gu > left and gu > right):  # higher than both beside it
            continue
        if gu == 0 and left == 0 and right == 0:
            continue
        begin = begin_at
        while parts > 0:
            i = envelope[0, parts - 1]
            gi = down[i]
            # the first column where the parabola of u lies below that of i
            twice, apart = (u - i) * (u + i) + gu * gu - gi * gi, u - i
            begin = (twice >> 1 if apart == 1 else int(math.floor(twice / (2.0 * apart)))) + 1
            if begin > envelope[1, parts - 1]:
                break
            parts -= 1
            begin = begin_at
        if begin <= end_at:
            envelope[0, parts], envelope[1, parts] = u, max(begin, begin_at)
            parts += 1
    end = end_at
    for k in range(parts - 1, -1, -1):
        i = envelope[0, k]
        lowest = down[i] * down[i]
        for c in range(envelope[1, k], end + 1):
            squares[c] = (c - i) * (c - i) + lowest
        end = envelope[1, k] - 1
    for c in range(begin_at, end_at + 1):
        squares[c] = 0 if down[c] == 0 else (squares[c] if parts > 0 else _NONE)


@inner_kernel
def _root(squares, less, cell_m, first, last, out):  # type: ignore[no-untyped-def]
    for c in range(first, last + 1):  # in a loop of its own, for the processor takes several roots at once
        out[c] = (math.sqrt(squares[c]) - less) * cell_m if squares[c] < _NONE else np.inf
