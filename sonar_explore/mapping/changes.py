"""Where two grids of the same shape differ: what is worked out of a map is worked out anew there alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel

Spans = NDArray[np.int64]
"""First column and last of each row, shape (rows, 2); the last is before the first where a row has none."""


def changed_spans(before: NDArray[np.generic], after: NDArray[np.generic], within: int) -> Spans:
    """What of each row has a cell that differs within so many rows and columns."""
    if after.dtype == np.bool_:  # masks as bytes, as the states of cells are: compiled once for both
        before, after = before.view(np.uint8), after.view(np.uint8)
    return np.asarray(_changed_spans(before, after, within))


def whole_spans(shape: tuple[int, ...]) -> Spans:
    """All of every row."""
    return np.tile([0, shape[1] - 1], (shape[0], 1))


def no_spans(shape: tuple[int, ...]) -> Spans:
    """Nothing of any row; to be widened."""
    return np.tile([shape[1], -1], (shape[0], 1))


@inner_kernel
def widen(spans, row, first, last):  # type: ignore[no-untyped-def]
    """By columns of a row."""
    spans[row, 0], spans[row, 1] = min(spans[row, 0], first), max(spans[row, 1], last)


def box_of(spans: Spans) -> tuple[slice, slice] | None:
    """The rows and columns that hold all spans; None where there are none."""
    rows = np.flatnonzero(spans[:, 0] <= spans[:, 1])
    if not len(rows):
        return None
    first, last = int(spans[rows, 0].min()), int(spans[rows, 1].max())
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(first, last + 1)


@kernel
def _changed_spans(before, after, within):  # type: ignore[no-untyped-def]
    rows, columns = after.shape
    spans = np.empty((rows, 2), dtype=np.int64)
    for row in range(rows):
        spans[row, 0], spans[row, 1] = columns, -1
    for row in range(rows):
        differ = 0
        for column in range(columns):
            differ += before[row, column] != after[row, column]
        if not differ:
            continue
        first = 0
        while before[row, first] == after[row, first]:
            first += 1
        last = columns - 1
        while before[row, last] == after[row, last]:
            last -= 1
        for near in range(max(0, row - within), min(rows, row + within + 1)):
            spans[near, 0] = min(spans[near, 0], max(0, first - within))
            spans[near, 1] = max(spans[near, 1], min(columns - 1, last + within))
    return spans
