"""Distance of every cell to the nearest cell of a kind: exact and in linear time.

Meijster, Roerdink & Hesselink 2000: down each column first, then the lower envelope of parabolas along each row, all
in whole numbers.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import Mask


def distances(to: Mask) -> Array:
    """Distance of each cell's middle to that of the nearest cell in `to`, in cells, shape (rows, columns).

    inf where there is none.

    >>> distances(np.array([[True, False, False]]))
    array([[0., 1., 2.]])
    """
    out = np.empty(to.shape)
    _distances(to, out)
    return out


@kernel
def _distances(to, out):  # type: ignore[no-untyped-def]
    rows, columns = to.shape
    far = rows + columns  # farther than any cell
    down = np.empty((rows, columns), dtype=np.int32)
    for c in range(columns):
        down[0, c] = 0 if to[0, c] else far
    for r in range(1, rows):
        for c in range(columns):
            down[r, c] = 0 if to[r, c] else min(far, down[r - 1, c] + 1)
    for r in range(rows - 2, -1, -1):
        for c in range(columns):
            down[r, c] = min(down[r, c], down[r + 1, c] + 1)
    lowest = np.empty(columns, dtype=np.int32)  # columns whose parabolas make the envelope
    begins = np.empty(columns, dtype=np.int32)  # where each one's part begins
    for r in range(rows):
        parts = 0
        for u in range(columns):
            gu = down[r, u]
            left, right = down[r, max(u - 1, 0)], down[r, min(u + 1, columns - 1)]
            if gu >= far or (gu == 0 and left == 0 and right == 0):
                continue
            if min(gu * gu - left * left, gu * gu - right * right) >= 1:  # nowhere lower than both beside it
                continue
            begin = 0
            while parts > 0:
                i = lowest[parts - 1]
                gi = down[r, i]
                # the first column where the parabola of u lies below that of i
                begin = int(math.floor(((u - i) * (u + i) + gu * gu - gi * gi) / (2.0 * (u - i)))) + 1
                if begin > begins[parts - 1]:
                    break
                parts -= 1
                begin = 0
            if begin < columns:
                lowest[parts], begins[parts] = u, max(begin, 0)
                parts += 1
        k = parts - 1
        for c in range(columns - 1, -1, -1):
            if down[r, c] == 0 or parts == 0:
                out[r, c] = 0.0 if down[r, c] == 0 else np.inf
                continue
            while begins[k] > c:
                k -= 1
            i = lowest[k]
            out[r, c] = float((c - i) * (c - i) + down[r, i] * down[r, i])
        for c in range(columns):  # in a loop of its own, for the processor takes several roots at once
            out[r, c] = math.sqrt(out[r, c])
