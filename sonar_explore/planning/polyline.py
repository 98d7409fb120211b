"""Fewer corners on nearly the same line (Douglas & Peucker 1973).

`skimage.measure.approximate_polygon` is the twin in the tests. With it come SciPy's statistics, signals and
optimisation: 38 MB in every process that explores.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.sums import hypot


def fewer_corners(path: Array, tolerance_m: float) -> Array:
    """Those points of a polyline, shape (n, 2), from which no point left out is farther, shape (k, 2), [m]."""
    kept = np.zeros(len(path), dtype=bool)
    kept[[0, -1]] = True
    left = [(0, len(path) - 1)]
    while left:
        first, last = left.pop()
        (x0, y0), (x1, y1) = path[first], path[last]
        angle = -np.arctan2(x1 - x0, y1 - y0)
        cos, sin = np.cos(angle), np.sin(angle)
        corner, distance = _farthest(path, first, last, cos, sin, y0 * sin + x0 * cos)
        if distance > tolerance_m:
            kept[corner] = True
            left += [(corner, last), (first, corner)]
    return path[kept]


def spaced(poses: Array, last: Pose | None, step_m: float) -> list[Pose]:
    """Those of some poses on a way, x y [m] heading [rad], shape (n, 3), that lie so far or farther from the one taken
    before; `last` was taken before the first."""
    places = np.empty(len(poses), dtype=np.int64)
    x, y = (math.inf, math.inf) if last is None else (last.x, last.y)
    count = _spaced(poses, x, y, step_m, places)
    return [Pose(*row) for row in poses[places[:count]].tolist()]


@lean_kernel
def _spaced(poses, x, y, step, places):  # type: ignore[no-untyped-def]
    count = 0
    for i in range(len(poses)):
        if x == np.inf or hypot(poses[i, 0] - x, poses[i, 1] - y) >= step:
            places[count] = i
            count += 1
            x, y = poses[i, 0], poses[i, 1]
    return count


@lean_kernel
def _farthest(path, first, last, cos, sin, offset):  # type: ignore[no-untyped-def]
    """The point between two of a polyline that is farthest from the straight line between them, and how far, [m]."""
    x0, y0, x1, y1 = path[first, 0], path[first, 1], path[last, 0], path[last, 1]
    farthest, at = 0.0, first
    for i in range(first + 1, last):
        x, y = path[i, 0], path[i, 1]
        beyond_first = (x - x0) * (x1 - x0) + (y - y0) * (y1 - y0) > 0.0
        before_last = -(x - x1) * (x1 - x0) - (y - y1) * (y1 - y0) > 0.0
        if beyond_first and before_last:
            distance = abs(x * cos + y * sin - offset)
        else:
            near_first = math.sqrt((y - y0) * (y - y0) + (x - x0) * (x - x0))
            distance = min(near_first, math.sqrt((y - y1) * (y - y1) + (x - x1) * (x - x1)))
        if distance > farthest:
            farthest, at = distance, i
    return at, farthest
