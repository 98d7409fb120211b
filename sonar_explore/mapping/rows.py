"""What changed between two lists of segments."""

from __future__ import annotations

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array


def differing_rows(first: Array, second: Array) -> tuple[Array, Array]:
    """Rows that the second array has no more, and those that only it has, shape (k, 4) both; what stands in both n
    times differs in none of them, in whatever order."""
    return first[_missing(first, second)], second[_missing(second, first)]


@kernel
def _missing(rows, others):  # type: ignore[no-untyped-def]
    """Which rows are none of the others, each of which is one row alone, shape (n,).

    Mostly those at the same place from the beginning or from the end are the same; for what is left a hash table of the
    others, by their sums.
    """
    out, taken = np.ones(len(rows), dtype=np.bool_), np.zeros(len(others), dtype=np.bool_)
    left, more = len(others), len(others) - len(rows)
    for shift in (0, more):
        for i in range(max(0, -shift), min(len(rows), len(others) - shift)):
            if out[i] and not taken[i + shift] and _same(rows[i], others[i + shift]):
                out[i], taken[i + shift] = False, True
                left -= 1
    table = np.full(2 * left + 1, -1)
    for k in range(len(others)):
        if not taken[k]:
            slot = _slot(others[k], len(table))
            while table[slot] >= 0:
                slot = (slot + 1) % len(table)
            table[slot] = k
    for i in range(len(rows)):
        if not out[i]:
            continue
        slot = _slot(rows[i], len(table))
        while table[slot] >= 0 and out[i]:
            k = table[slot]
            if not taken[k] and _same(rows[i], others[k]):
                out[i], taken[k] = False, True
            slot = (slot + 1) % len(table)
    return out


@inner_kernel
def _same(row, other):  # type: ignore[no-untyped-def]
    return row[0] == other[0] and row[1] == other[1] and row[2] == other[2] and row[3] == other[3]


@inner_kernel
def _slot(row, size):  # type: ignore[no-untyped-def]
    mixed = 12.9898 * row[0] + 78.233 * row[1] + 37.719 * row[2] + 4.581 * row[3]
    return int(abs(mixed) * 1e6) % size
