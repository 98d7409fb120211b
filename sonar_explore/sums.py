"""Sums in the order of numpy and of BLAS, for kernels that take over from them: the same to the last bit.

numpy adds up long arrays eight at a time; BLAS takes a product and a sum with one rounding (a fused multiply-add), in
rising order. `math.hypot` of Python is rounded once, that of the C library sometimes is not.
"""

from __future__ import annotations

import contextlib
import math
from fractions import Fraction
from typing import Any

from sonar_explore.compiled import inner_kernel


def fma(a: float, b: float, c: float) -> float:
    """a b + c, rounded once. Compiled, it is one instruction; `math` has it from Python 3.13 on."""
    if not (math.isfinite(a) and math.isfinite(b) and math.isfinite(c)):
        return a * b + c
    return float(Fraction(a) * Fraction(b) + Fraction(c))


with contextlib.suppress(ImportError):
    from numba import types
    from numba.extending import intrinsic, overload

    @intrinsic
    def _fused(typing: Any, a: Any, b: Any, c: Any) -> Any:
        def instruction(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            """What the compiler puts there."""
            return builder.fma(*values)

        return types.float64(types.float64, types.float64, types.float64), instruction

    @overload(fma)
    def _fma(a, b, c):  # type: ignore[no-untyped-def]
        return lambda a, b, c: _fused(a, b, c)


@inner_kernel
def total(values):  # type: ignore[no-untyped-def]
    """`values.sum()` of up to 128 numbers."""
    n = len(values)
    if n < 8:
        added = 0.0
        for i in range(n):
            added += values[i]
        return added
    r0, r1, r2, r3 = values[0], values[1], values[2], values[3]
    r4, r5, r6, r7 = values[4], values[5], values[6], values[7]
    i = 8
    while i + 8 <= n:
        r0, r1, r2, r3 = r0 + values[i], r1 + values[i + 1], r2 + values[i + 2], r3 + values[i + 3]
        r4, r5, r6, r7 = r4 + values[i + 4], r5 + values[i + 5], r6 + values[i + 6], r7 + values[i + 7]
        i += 8
    added = ((r0 + r1) + (r2 + r3)) + ((r4 + r5) + (r6 + r7))
    while i < n:
        added += values[i]
        i += 1
    return added


@inner_kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """`a @ b` of a few numbers."""
    added = 0.0
    for i in range(len(a)):
        added = fma(a[i], b[i], added)
    return added


@inner_kernel
def hypot(x, y):  # type: ignore[no-untyped-def]
    """`math.hypot(x, y)` of lengths in a building: the root, and what rounding took of it."""
    x, y = abs(x), abs(y)
    longer, shorter = max(x, y), min(x, y)
    if longer == 0.0:
        return 0.0
    xx, yy = longer * longer, shorter * shorter
    squared = xx + yy
    lost = (xx - squared) + yy + fma(longer, longer, -xx) + fma(shorter, shorter, -yy)
    root = math.sqrt(squared)
    return root + (fma(-root, root, squared) + lost) / (2.0 * root)
