"""Where two grids of the same shape differ: what is worked out of a map is worked out anew there alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel

Spans = NDArray[np.int32]
"""First column and last of each row within each stripe of `STRIPE` columns, shape (rows, stripes, 2); the last is
before the first where there are none. In stripes, for on a large map some changes lie near the robot and some far off,
and what is between is no affair of either."""

_SHIFT = 7
STRIPE = 1 << _SHIFT
_NO_COLUMN = 2**30


def changed_spans(before: NDArray[np.generic], after: NDArray[np.generic], within: int) -> Spans:
    """What of each row has a cell that differs within so many rows and columns."""
    if after.dtype == np.bool_:  # masks as bytes, as the states of cells are: compiled once for both
        before, after = before.view(np.uint8), after.view(np.uint8)
    spans = no_spans(after.shape)
    _changed_spans(before, after, as_words(before), as_words(after), within, spans)
    return spans


def as_words(cells: NDArray[np.generic]) -> NDArray[np.uint64]:
    """The bytes of a grid, eight at a time, but for the last few; one that is not contiguous is copied."""
    held = cells.reshape(-1).view(np.uint8)
    return held[: len(held) & ~7].view(np.uint64)


@inner_kernel
def may_differ(words, others, first, count):  # type: ignore[no-untyped-def]
    """Whether two grids of bytes, as words, differ in some of these bytes or near them: some of those that are in no
    word may."""
    begin, end = first >> 3, (first + count + 7) >> 3
    if end > len(words):
        return True
    differ = np.uint64(0)
    some, same = words[begin:end], others[begin:end]
    for i in range(len(some)):
        differ |= some[i] ^ same[i]
    return differ != 0


def no_spans(shape: tuple[int, ...]) -> Spans:
    """Nothing of any row; to be widened."""
    spans = np.empty((shape[0], (shape[1] + STRIPE - 1) >> _SHIFT, 2), dtype=np.int32)
    forget(spans)
    return spans


def forget(spans: Spans) -> None:
    """Nothing of any row any more."""
    spans[..., 0], spans[..., 1] = _NO_COLUMN, -1  # a tuple for both takes ten times as long


def whole_spans(shape: tuple[int, ...]) -> Spans:
    """All of every row."""
    spans = no_spans(shape)
    widen_rows(spans, slice(None), 0, shape[1] - 1)
    return spans


def widen_rows(spans: Spans, rows: slice, first: int, last: int) -> None:
    """By columns of some rows."""
    stripes = slice(first >> _SHIFT, (last >> _SHIFT) + 1)
    begins = np.arange(stripes.start, stripes.stop) << _SHIFT
    part = spans[rows, stripes]
    np.minimum(part[..., 0], np.maximum(begins, first), out=part[..., 0])
    np.maximum(part[..., 1], np.minimum(begins + STRIPE - 1, last), out=part[..., 1])


def moved_spans(spans: Spans, at: tuple[int, int], shape: tuple[int, ...]) -> Spans:
    """The same where a grid of this shape has the first cell of theirs there."""
    moved = no_spans(shape)
    _move(spans, at[0], at[1], moved)
    return moved


@inner_kernel
def widen(spans, row, first, last):  # type: ignore[no-untyped-def]
    """By columns of a row."""
    for stripe in range(first >> _SHIFT, (last >> _SHIFT) + 1):
        begin = stripe << _SHIFT
        spans[row, stripe, 0] = min(spans[row, stripe, 0], max(first, begin))
        spans[row, stripe, 1] = max(spans[row, stripe, 1], min(last, begin + STRIPE - 1))


@kernel
def _move(spans, row, column, moved):  # type: ignore[no-untyped-def]
    for r in range(spans.shape[0]):
        for stripe in range(spans.shape[1]):
            if spans[r, stripe, 0] <= spans[r, stripe, 1]:
                widen(moved, row + r, column + spans[r, stripe, 0], column + spans[r, stripe, 1])


@kernel
def _changed_spans(before, after, words_before, words, within, spans):  # type: ignore[no-untyped-def]
    rows, columns = after.shape
    for row in range(rows):
        if not may_differ(words, words_before, row * columns, columns):
            continue
        for begin in range(0, columns, STRIPE):
            end = min(begin + STRIPE, columns)
            first, last = begin, end - 1
            while first < end and before[row, first] == after[row, first]:
                first += 1
            if first == end:
                continue
            while before[row, last] == after[row, last]:
                last -= 1
            for near in range(max(0, row - within), min(rows, row + within + 1)):
                widen(spans, near, max(0, first - within), min(columns - 1, last + within))
