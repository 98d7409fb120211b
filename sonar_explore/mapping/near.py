"""Whether any of some points is near a place."""

from __future__ import annotations

import math

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array


def any_within(points: Array, x: float, y: float, distance_m: float) -> bool:
    """Whether one of the points, shape (n, 2), lies within a distance of a place, [m]."""
    return bool(_any_within(points, x, y, distance_m, False))


def any_within_in_blocks(points: Array, x: float, y: float, distance_m: float) -> bool:
    """The same with distances along x and y added up."""
    return bool(_any_within(points, x, y, distance_m, True))


@kernel
def _any_within(points, x, y, distance, in_blocks):  # type: ignore[no-untyped-def]
    for i in range(len(points)):
        dx, dy = abs(points[i, 0] - x), abs(points[i, 1] - y)
        if (dx + dy if in_blocks else math.hypot(dx, dy)) <= distance:
            return True
    return False
