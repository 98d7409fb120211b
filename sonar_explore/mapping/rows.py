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

    Mostly the first ones and the last ones are the same; for what is between a hash table of the others, by their sums.
    """
    out = np.zeros(len(rows), dtype=np.bool_)
    shorter = min(len(rows), len(others))
    begin = 0
    while begin < shorter and _same(rows[begin], others[begin]):
        begin += 1
    end, end_of_others = len(rows), len(others)
    while min(end, end_of_others) > begin and _same(rows[end - 1], others[end_of_others - 1]):
        end, end_of_others = end - 1, end_of_others - 1
    table = np.full(2 * (end_of_others - begin) + 1, -1)
    for k in range(begin, end_of_others):
        slot = _slot(others[k], len(table))
        while table[slot] >= 0:
            slot = (slot + 1) % len(table)
        table[slot] = k
    taken = np.zeros(end_of_others - begin, dtype=np.bool_)
    for i in range(begin, end):
        slot = _slot(rows[i], len(table))
        out[i] = True
        while table[slot] >= 0 and out[i]:
            k = table[slot] - begin
            if not taken[k] and _same(rows[i], others[table[slot]]):
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
