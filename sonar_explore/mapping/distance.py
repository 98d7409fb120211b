"""Distance of every cell to the nearest cell of a kind: exact, in linear time, and anew only where it can have changed.

Down each column first, then along each row the least of the squares to what its columns have, all in whole numbers (as
Meijster, Roerdink & Hesselink 2000, but for the row: what is looked for is near, so that to look at one column after
another, for all cells of the row at once, is sooner done than their lower envelope).
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.changes import (
    Spans,
    as_words,
    forget,
    may_differ,
    moved_spans,
    no_spans,
    whole_spans,
    widen,
    widen_rows,
)
from sonar_explore.mapping.grid import Mask, grown, holds

_MOST = 2**15  # as far as any cell is from another
_NONE = 2**30  # the square of the distance where there is none
_BLOCK = 64  # columns that are looked at side by side


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

    def __init__(self, less: float = 0.0, cell_m: float = 1.0, most: int = _MOST) -> None:
        """
        Args:
            less: how much nearer than the middle of the nearest cell what counts begins, in cells.
            cell_m: side of a cell, [m]; distances come in it.
            most: nothing farther off is looked for, in cells: inf there.
        """
        self._less, self._cell_m, self._most = less, cell_m, most
        self._to: Mask = np.zeros((0, 0), dtype=bool)
        self._watches: list[Watch] = []

    def of(self, to: Mask, at: tuple[int, int] = (0, 0)) -> Array:
        """Shape (rows, columns), [m]; the array is written to at the next call. `at`: where a mask that has grown has
        the first cell of the one before."""
        spans = no_spans(to.shape)
        if not (self._to.size and holds(to.shape, at, self._to.shape)):
            spans = self._begin(to.shape)
        elif self._to.shape != to.shape:
            self._grow(at, to.shape, spans)
        kept = self._down, self._squares, self._distances
        _renew(
            self._to,
            to,
            as_words(self._to),
            as_words(to),
            *kept,
            self._less,
            self._cell_m,
            self._far(to.shape),
            spans,
        )
        np.copyto(self._to, to)
        for watch in self._watches:
            watch.widen(spans)
        return self._distances

    def _begin(self, shape: tuple[int, int]) -> Spans:
        """From nothing: no cell is of the kind. All is new."""
        self._to, self._distances = np.zeros(shape, dtype=bool), np.empty(shape)
        self._down = np.full(shape, self._far(shape), dtype=np.int32)
        self._squares = np.full(shape, _NONE, dtype=np.int32)
        for watch in self._watches:
            watch.begin(whole_spans(shape))
        return whole_spans(shape)

    def _grow(self, at: tuple[int, int], shape: tuple[int, int], spans: Spans) -> None:
        """Go over to more rows and columns, none of whose cells are of the kind; which are new, into `spans`."""
        (row, column), (rows, columns), far = at, self._to.shape, self._far(shape)
        down = np.where(self._down >= self._far(self._to.shape), far, self._down)
        self._to, self._down = grown(self._to, at, shape, False), grown(down, at, shape, far)
        above, below = self._down[:row], self._down[row + rows :]
        above[:] = np.minimum(self._down[row] + np.arange(row, 0, -1)[:, None], far)
        below[:] = np.minimum(self._down[row + rows - 1] + np.arange(1, len(below) + 1)[:, None], far)
        self._squares = grown(self._squares, at, shape, _NONE)
        self._distances = grown(self._distances, at, shape, np.inf)
        if column > 0:
            widen_rows(spans, slice(None), 0, column - 1)
        if column + columns < shape[1]:
            widen_rows(spans, slice(None), column + columns, shape[1] - 1)
        for part in (slice(row), slice(row + rows, None)):
            widen_rows(spans, part, 0, shape[1] - 1)
        for watch in self._watches:
            watch.move(at, shape)

    def _far(self, shape: tuple[int, ...]) -> int:
        """Too far to be looked for on a grid of this shape, in cells."""
        return min(self._most + 1, sum(shape))

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

    def move(self, at: tuple[int, int], shape: tuple[int, int]) -> None:
        """What was the first cell lies there now, on a grid of this shape."""
        self._spans = moved_spans(self._spans, at, shape)

    def widen(self, spans: Spans) -> None:
        """There, too."""
        np.minimum(self._spans[..., 0], spans[..., 0], out=self._spans[..., 0])
        np.maximum(self._spans[..., 1], spans[..., 1], out=self._spans[..., 1])

    def take(self) -> Spans:
        """Those, and none from now on."""
        spans, self._spans = self._spans, np.empty_like(self._spans)
        forget(self._spans)
        return spans


@kernel
def _renew(before, to, words_before, words, down, squares, out, less, cell_m, far, spans):  # type: ignore[no-untyped-def]
    """Go over from the distances to `before` to those to `to`. `spans`: what nothing is known of yet in each row, then
    what was worked out anew.

    `down` is the distance within each column, `squares` the square of that to any cell, both in cells. What is `far` is
    not looked for.
    """
    rows, columns = to.shape
    first, last = np.full(columns, rows, dtype=np.int32), np.full(columns, -1, dtype=np.int32)
    for r in range(rows):
        if may_differ(words, words_before, r * columns, columns):
            for c in range(columns):
                if before[r, c] != to[r, c]:
                    first[c], last[c] = min(first[c], r), r
    work, above = np.empty((3, _BLOCK), dtype=np.int32), np.empty((rows, _BLOCK), dtype=np.int32)
    begin = np.int64(0)  # not a constant, for which what it calls would be compiled once more
    while begin < columns:  # what changed down the columns, into the spans
        if last[begin] < 0:
            begin += 1
            continue
        end = begin + 1
        for c in range(begin + 1, min(begin + _BLOCK, columns)):
            end = c + 1 if last[c] >= 0 else end
        _down_again(to, down, begin, first[begin:end], last[begin:end], far, work, above, spans)
        begin = end
    near = np.empty(columns + 2 * far, dtype=np.int32)
    parts = np.empty((spans.shape[1], 2), dtype=np.int64)
    for r in range(rows):
        for k in range(_parts(squares[r], spans[r], far, parts)):
            a, b = parts[k, 0], parts[k, 1]
            _along(down[r], far, a, near, squares[r][a : b + 1])
            _root(squares[r][a : b + 1], less, cell_m, out[r][a : b + 1])
            widen(spans, r, a, b)


@inner_kernel
def _down_again(to, down, begin, first, last, far, work, above, spans):  # type: ignore[no-untyped-def]
    """Distances within columns side by side, from `begin` on, each of whose cells changed between two rows: anew as far
    as the next cells of the kind. Row by row, for the cells of a column lie far apart in memory."""
    rows, columns, end = len(to), len(first), begin + len(first)
    none, most = np.int32(0), np.int32(far)
    low, high, nearest = work[0], work[1], work[2]  # of each column, the first row to be told and the last
    top, bottom, highest, lowest, above_all = -1, rows, 0, rows, 0
    for i in range(columns):
        changes = last[i] >= 0
        low[i], high[i], nearest[i] = -1 if changes else rows, rows if changes else -1, far
        above_all += changes
        if changes:
            top, bottom = max(top, first[i] - 1), min(bottom, last[i] + 1)
            lowest, highest = min(lowest, first[i]), max(highest, last[i])
    below_all = above_all
    # rows farther than `far` from a change are as they were, and what is twice as far does not tell those between
    while above_all > 0 and top >= max(0, lowest - 2 * far):
        here = to[top][begin:end]
        for i in range(columns):
            ends = (low[i] < 0) & (top < first[i]) & here[i]
            low[i] = top if ends else low[i]
            above_all -= ends
        top -= 1
    while below_all > 0 and bottom < min(rows, highest + 2 * far + 1):
        here = to[bottom][begin:end]
        for i in range(columns):
            ends = (high[i] == rows) & (bottom > last[i]) & here[i]
            high[i] = bottom if ends else high[i]
            below_all -= ends
        bottom += 1
    top, bottom = max(top, 0), min(bottom, rows - 1)
    for i in range(columns):
        low[i], high[i] = max(low[i], first[i] - far), min(high[i], last[i] + far)
    for r in range(bottom, top - 1, -1):
        here, below = to[r][begin:end], above[r]
        for i in range(columns):
            nearest[i] = below[i] = none if here[i] else min(np.int32(nearest[i] + 1), most)
    for i in range(columns):
        nearest[i] = far
    for r in range(top, bottom + 1):
        here, found, known, differ = to[r][begin:end], above[r], down[r][begin:end], 0
        for i in range(columns):
            nearest[i] = none if here[i] else min(np.int32(nearest[i] + 1), most)
            found[i] = min(nearest[i], found[i])
            differ += (low[i] <= r) & (r <= high[i]) & (found[i] != known[i])
        if differ:
            for i in range(columns):
                if low[i] <= r <= high[i] and found[i] != known[i]:
                    known[i] = found[i]
                    widen(spans, r, begin + i, begin + i)


@inner_kernel
def _parts(squares, spans, far, parts):  # type: ignore[no-untyped-def]
    """Where along a row distances may differ if nothing but what lies in the spans did down its columns: how many
    parts, none beside another; what is beside a part is as it was, and right."""
    columns, count = len(squares), 0
    for stripe in range(len(spans)):
        first, last = np.int64(spans[stripe, 0]), np.int64(spans[stripe, 1])
        if last < first:
            continue
        a, b = first, last
        while a > max(0, first - far + 1) and squares[a - 1] >= (first - (a - 1)) ** 2:
            a -= 1
        while b < min(columns - 1, last + far - 1) and squares[b + 1] >= (b + 1 - last) ** 2:
            b += 1
        while count > 0 and parts[count - 1, 1] >= a - 1:
            count -= 1
            a, b = min(a, parts[count, 0]), max(b, parts[count, 1])
        parts[count, 0], parts[count, 1] = a, b
        count += 1
    return count


@inner_kernel
def _along(down, far, first, near, squares):  # type: ignore[no-untyped-def]
    """Squares of the distances of a row's cells from `first` on: the least of those to the nearest of each column, the
    columns one farther off each time. `near` is for the squares of `down`, and of nothing beyond both ends."""
    columns, count, most = len(down), len(squares), np.int32(0)
    for i in range(count):
        squares[i] = down[first + i] * down[first + i] if down[first + i] < far else _NONE
        most = max(most, squares[i])
    reach = min(far - 1, int(math.sqrt(most)))
    for i in range(count + 2 * reach):
        c = first - reach + i
        near[i] = down[c] * down[c] if 0 <= c < columns and down[c] < far else _NONE
    off = 1
    while off <= reach:
        for k in range(off, min(off + 4, reach + 1)):
            left, right = near[reach - k : reach - k + count], near[reach + k : reach + k + count]
            square = np.int32(k * k)
            for i in range(count):
                squares[i] = min(squares[i], np.int32(min(left[i], right[i]) + square))
        off += 4
        most = np.int32(0)
        for i in range(count):
            most = max(most, squares[i])
        reach_now = int(math.sqrt(most))
        if reach_now < off:
            break
    for i in range(count):
        squares[i] = squares[i] if squares[i] < far * far else _NONE


@inner_kernel
def _root(squares, less, cell_m, out):  # type: ignore[no-untyped-def]
    for i in range(len(squares)):  # in a loop of its own, for the processor takes several roots at once
        out[i] = (math.sqrt(squares[i]) - less) * cell_m if squares[i] < _NONE else np.inf
