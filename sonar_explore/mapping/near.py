"""Whether any of some points is near a place."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.geometry import Array


def any_within_in_blocks(points: Array, x: float, y: float, distance_m: float) -> bool:
    """Whether one of the points, shape (n, 2), lies within a distance of a place, along x and y added up, [m]."""
    return bool(_any_in_blocks(points, x, y, distance_m))


@lean_kernel
def _any_in_blocks(points, x, y, distance):  # type: ignore[no-untyped-def]
    for i in range(len(points)):  # noqa: SIM110 - numba compiles no any()
        if abs(points[i, 0] - x) + abs(points[i, 1] - y) <= distance:
            return True
    return False


@inner_kernel
def any_within(points, x, y, distance):  # type: ignore[no-untyped-def]
    """Whether one of the points, shape (n, 2), lies within a distance of a place, [m]; for kernels."""
    for i in range(len(points)):  # noqa: SIM110
        if math.hypot(abs(points[i, 0] - x), abs(points[i, 1] - y)) <= distance:
            return True
    return False
