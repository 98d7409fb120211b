"""What changed between two lists of segments."""

from __future__ import annotations

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array


def differing_rows(first: Array, second: Array) -> Array:
    """Rows that only one of the arrays has, shape (k, 4); order and repetitions do not matter."""
    return np.vstack([first[_missing(first, second)], second[_missing(second, first)]])


@kernel
def _missing(rows, others):  # type: ignore[no-untyped-def]
    """Which rows are none of the others, shape (n,): a hash table of the others, by their sums."""
    out = np.ones(len(rows), dtype=np.bool_)
    if len(others) == 0:
        return out
    table = np.full(2 * len(others) + 1, -1)
    for k in range(len(others)):
        slot = _slot(others[k], len(table))
        while table[slot] >= 0:
            slot = (slot + 1) % len(table)
        table[slot] = k
    for i in range(len(rows)):
        slot = _slot(rows[i], len(table))
        while table[slot] >= 0 and out[i]:
            other = others[table[slot]]
            out[i] = not (
                rows[i, 0] == other[0]
                and rows[i, 1] == other[1]
                and rows[i, 2] == other[2]
                and rows[i, 3] == other[3]
            )
            slot = (slot + 1) % len(table)
    return out


@inner_kernel
def _slot(row, size):  # type: ignore[no-untyped-def]
    mixed = 12.9898 * row[0] + 78.233 * row[1] + 37.719 * row[2] + 4.581 * row[3]
    return int(abs(mixed) * 1e6) % size
