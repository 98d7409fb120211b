"""How unsure lines, points and earlier scans are, seen from the last scan: by the factor of the solution."""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_allocating_kernel, kernel
from sonar_explore.slam.smoothing.cholesky import covariances
from sonar_explore.slam.smoothing.known_points import BOUND, STATE, VARIABLE

UNKNOWN = -1
"""In the place of a line's variable: it has none yet, and no covariance."""


@kernel
def line_covariances(lines, normals, x, y, last, values, rank, parent, dims, layout, struct, factor, out):  # type: ignore[no-untyped-def]
    """Of the robot's heading and of its place along each normal, relative to each line, into `out`, shape (n, 2, 2).

    Args:
        lines: variables of the lines, shape (n,), or `UNKNOWN`.
        normals: of the lines, to the side on which the place counts as ahead, shape (n, 2).
        x: where the robot is now, [m], taken as known relative to the last scan.
        y: likewise.
        last: the variable of that scan.
    """
    n = len(lines)
    by_pose, by_line = np.zeros((n, 4, 2)), np.zeros((n, 4, 2))
    off_x, off_y = x - values[last, 0], y - values[last, 1]
    for i in range(n):
        c, s = math.cos(values[lines[i], 0]), math.sin(values[lines[i], 0])
        side = 1.0 if c * normals[i, 0] + s * normals[i, 1] >= 0.0 else -1.0
        by_pose[i, 0, 1], by_pose[i, 1, 1] = side * c, side * s
        by_pose[i, 2, 1] = side * (s * off_x - c * off_y)
        by_line[i, 0, 1], by_line[i, 1, 1] = side * (y * c - x * s), -side
        by_pose[i, 2, 0], by_line[i, 0, 0] = 1.0, -1.0
    half = np.zeros((len(values), 4, 2))
    covariances(lines, by_line, last, by_pose, rank, parent, dims, layout, struct, factor, half, out)


@kernel
def point_covariances(  # type: ignore[no-untyped-def]
    variables, bound, places, last, values, rank, parent, dims, layout, struct, factor, out
):
    """Of points' x y relative to the last scan, map frame, [m2], into `out`, shape (n, 2, 2).

    Args:
        variables: of the points, and of the scans that heard those that are not unknowns, shape (n,).
        bound: which points are unknowns, shape (n,); the others move and turn with their scan.
        places: x y of the points, shape (n, 2), [m].
        last: the variable of the last scan.
    """
    n = len(variables)
    by, by_last = np.zeros((n, 4, 2)), np.zeros((n, 4, 2))
    for i in range(n):
        v, x, y = variables[i], places[i, 0], places[i, 1]
        by[i, 0, 0] = by[i, 1, 1] = 1.0
        by_last[i, 0, 0] = by_last[i, 1, 1] = -1.0
        by_last[i, 2, 0], by_last[i, 2, 1] = y - values[last, 1], values[last, 0] - x
        if not bound[i]:
            by[i, 2, 0], by[i, 2, 1] = values[v, 1] - y, x - values[v, 0]
    half = np.zeros((len(values), 4, 2))
    covariances(variables, by, last, by_last, rank, parent, dims, layout, struct, factor, half, out)


@kernel
def pose_covariance(scan, last, values, rank, parent, dims, layout, struct, factor, out):  # type: ignore[no-untyped-def]
    """Of the last pose, x y heading, seen from an earlier scan, map frame, into `out`, shape (1, 3, 3)."""
    by_last, by_here = np.zeros((1, 4, 3)), np.zeros((1, 4, 3))
    for i in range(3):
        by_last[0, i, i], by_here[0, i, i] = 1.0, -1.0
    by_here[0, 2, 0] = values[last, 1] - values[scan, 1]
    by_here[0, 2, 1] = values[scan, 0] - values[last, 0]
    variables, half = np.full(1, scan), np.zeros((len(values), 4, 3))
    covariances(variables, by_here, last, by_last, rank, parent, dims, layout, struct, factor, half, out)


@inner_allocating_kernel
def near_points(  # type: ignore[no-untyped-def]
    here, reach, numbers, places, rows, last, values, rank, parent, dims, layout, struct, factor, out
):
    """Which rows of `numbers` and `places` are in reach of any of the places `here`, shape (n, 2), [m], into `out`, and
    the variance of each in any direction, seen from the last scan, [m2]; all but `here` as `KnownPoints` has them."""
    count = 0
    for k in range(len(places)):
        for i in range(len(here)):
            if math.hypot(places[k, 0] - here[i, 0], places[k, 1] - here[i, 1]) <= reach:
                out[count] = k
                count += 1
                break
    variables, bound = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.bool_)
    where, variance = np.empty((count, 2)), np.zeros(count)
    for k in range(count):
        row = rows[numbers[out[k]]]
        variables[k], bound[k] = row[VARIABLE], row[STATE] == BOUND
        where[k, 0], where[k, 1] = places[out[k], 0], places[out[k], 1]
    if last < 0:
        return variance
    found = np.zeros((count, 2, 2))
    point_covariances(
        variables, bound, where, last, values, rank, parent, dims, layout, struct, factor, found
    )
    for k in range(count):
        variance[k] = 0.5 * (found[k, 0, 0] + found[k, 1, 1])
    return variance
