"""Which points of a scan are which of those known: the whole scan is moved until most of them fit.

A door has four edges, two of them a wall's thickness apart: taken one by one, the nearest may be the wrong one. Here
the scan as a whole is moved to where one or two of its points fall on known ones. Of all such places, and the one where
it is believed to be, that one is taken that explains most for the least move: truncated least squares, with the
uncertainty of the pose as prior.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel, kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.smoothing.known_points import KIND
from sonar_explore.slam.smoothing.relative import near_points
from sonar_explore.slam.smoothing.smoothing import Smoother
from sonar_explore.slam.turn.points import Point


@dataclass(frozen=True)
class MatchingConfig:
    """What counts as the same point met again."""

    reach_m: float = 0.5
    """How far a point may be from where it was expected, [m]."""
    sure_m: float = 0.06
    """A known point or chain whose place is less sure than this, seen from here, waits for a loop to be closed, [m]."""
    place_m: float = 0.02
    """Standard deviation of where a point is heard, [m]."""
    unmatched: float = 3.5
    """What a point costs that is none of those known, in squared standard deviations: one farther off is another."""
    apart_m: float = 0.04
    """Two points and the two that they are have distances that differ by no more, [m]."""


def met_again(
    points: Sequence[Point],
    pose: Pose,
    turn_error: float,
    prior: Array,
    smoother: Smoother,
    known: tuple[NDArray[np.int64], Array],
    config: MatchingConfig,
) -> list[int]:
    """For each point of a scan the number of the known one that it is, -1 for a new one.

    Args:
        pose: believed.
        turn_error: by how much more the robot turned than the points know of, relative.
        prior: covariance of x, y [m] and heading [rad] of that pose, in the first rows and columns.
        known: numbers and places of the smoother's points.
    """
    out, heard = np.full(len(points), -1), [(*p.seen_from(pose, turn_error), p.kind) for p in points]
    limits = config.reach_m, config.apart_m, config.unmatched, config.sure_m**2, config.place_m**2
    about, rows = (pose.x, pose.y), smoother.known_points.rows
    _meet(np.array(heard), about, prior, *known, rows, *smoother.solved[1:], limits, out)
    numbers: list[int] = out.tolist()
    return numbers


@kernel
def _meet(  # type: ignore[no-untyped-def]
    heard,
    about,
    prior,
    numbers,
    places,
    rows,
    last,
    values,
    rank,
    parent,
    dims,
    layout,
    struct,
    factor,
    limits,
    out,
):
    """`met_again`: x, y [m] and kind of each point `heard`, and of the known ones those that are near and sure."""
    n, near = len(heard), np.empty(len(numbers), dtype=np.int64)
    spread = near_points(
        *(heard, limits[0], numbers, places, rows, last, values, rank, parent, dims, layout, struct, factor),
        near,
    )
    m = len(spread)
    here, known = np.empty((n, 2)), np.empty((m, 2))
    alike, found = np.empty((n, m), dtype=np.bool_), np.full(n, -1)
    for i in range(n):
        here[i, 0], here[i, 1] = heard[i, 0] - about[0], heard[i, 1] - about[1]
        for j in range(m):
            alike[i, j] = heard[i, 2] == rows[numbers[near[j]], KIND] and spread[j] <= limits[3]
    for j in range(m):
        known[j, 0], known[j, 1] = places[near[j], 0] - about[0], places[near[j], 1] - about[1]
        spread[j] += limits[4]
    match(here, known, alike, spread, prior, limits, found)
    for i in range(n):
        if found[i] >= 0:
            out[i] = numbers[near[found[i]]]


@inner_allocating_kernel
def match(here, known, alike, variance, prior, limits, out):  # type: ignore[no-untyped-def]
    """Of all moves that put one point, or two, on known ones, and of none, the cheapest; by it each point and a known
    one that are nearest to one another are the same: its index into `out`.

    Args:
        here: where the points are, by the pose believed, from there, shape (n, 2), map frame, [m].
        known: places of the known points likewise, shape (m, 2), [m].
        alike: which points may be which of the known ones at all, shape (n, m).
        variance: of a point heard where each of these is, in each direction, shape (m,), [m2].
        prior: covariance of x, y [m] and heading [rad] of the pose.
        limits: reach [m], how far distances of two may differ [m], what a point costs that is none of these.
    """
    reach, apart, unmatched = limits[0], limits[1], limits[2]
    n, m = alike.shape
    rows, columns, count = np.empty(n * m, dtype=np.int64), np.empty(n * m, dtype=np.int64), 0
    for i in range(n):
        for j in range(m):
            if alike[i, j] and math.hypot(known[j, 0] - here[i, 0], known[j, 1] - here[i, 1]) <= reach:
                rows[count], columns[count] = i, j
                count += 1
    if count == 0:
        return
    information = np.empty((3, 3))
    inverted(prior, 1e-8, information)
    problem = (here, known, alike, variance, information, unmatched)
    x = y = turn = 0.0
    best = _cost(*problem, 0.0, 0.0, 0.0, np.inf)
    for a in range(count):
        i, j = rows[a], columns[a]
        dx, dy = known[j, 0] - here[i, 0], known[j, 1] - here[i, 1]
        cost = _cost(*problem, dx, dy, 0.0, best)
        if cost < best:
            best, x, y, turn = cost, dx, dy, 0.0
    for a in range(count):
        for b in range(a + 1, count):
            i, k, j, other = rows[a], rows[b], columns[a], columns[b]
            if i == k or j == other:
                continue
            bx, by = here[k, 0] - here[i, 0], here[k, 1] - here[i, 1]
            ax, ay = known[other, 0] - known[j, 0], known[other, 1] - known[j, 1]
            if abs(math.hypot(bx, by) - math.hypot(ax, ay)) > apart:
                continue
            angle = math.atan2(bx * ay - by * ax, bx * ax + by * ay)
            c, s = math.cos(angle), math.sin(angle)
            mx, my = 0.5 * (here[i, 0] + here[k, 0]), 0.5 * (here[i, 1] + here[k, 1])
            dx = 0.5 * (known[j, 0] + known[other, 0]) - c * mx + s * my
            dy = 0.5 * (known[j, 1] + known[other, 1]) - s * mx - c * my
            cost = _cost(*problem, dx, dy, angle, best)
            if cost < best:
                best, x, y, turn = cost, dx, dy, angle
    for i in range(n):
        j, cost = _nearest(here[i], known, alike[i], variance, x, y, turn)
        if cost >= unmatched:
            continue
        out[i] = j
        for k in range(n):
            if k != i and alike[k, j]:
                other = _squared(here[k], known[j], variance[j], x, y, turn)
                if other < cost or (other == cost and k < i):
                    out[i] = -1


@inner_kernel
def inverted(a, more, out):  # type: ignore[no-untyped-def]
    """Of a symmetric matrix of three rows with this much more on its diagonal, the inverse."""
    p, q, r = a[0, 0] + more, a[1, 1] + more, a[2, 2] + more
    x, y, z = a[0, 1], a[0, 2], a[1, 2]
    determinant = p * (q * r - z * z) - x * (x * r - y * z) + y * (x * z - q * y)
    out[0, 0], out[1, 1] = (q * r - z * z) / determinant, (p * r - y * y) / determinant
    out[2, 2] = (p * q - x * x) / determinant
    out[0, 1] = out[1, 0] = (y * z - x * r) / determinant
    out[0, 2] = out[2, 0] = (x * z - q * y) / determinant
    out[1, 2] = out[2, 1] = (x * y - p * z) / determinant


@inner_kernel
def _cost(here, known, alike, variance, information, unmatched, x, y, turn, most):  # type: ignore[no-untyped-def]
    """Of a move: its own, by the prior, and that of each point by the nearest known one, or of being none; in squared
    standard deviations, as far as it is less than `most`."""
    cost = x * x * information[0, 0] + y * y * information[1, 1] + turn * turn * information[2, 2]
    cost += 2.0 * (x * y * information[0, 1] + x * turn * information[0, 2] + y * turn * information[1, 2])
    for i in range(len(here)):
        if cost >= most:
            break
        _, off = _nearest(here[i], known, alike[i], variance, x, y, turn)
        cost += min(off, unmatched)
    return cost


@inner_kernel
def _nearest(point, known, alike, variance, x, y, turn):  # type: ignore[no-untyped-def]
    """The known point nearest to a point of the moved scan, and how far it is, in squared standard deviations."""
    nearest, least = -1, np.inf
    for j in range(len(known)):
        if alike[j]:
            off = _squared(point, known[j], variance[j], x, y, turn)
            if off < least:
                nearest, least = j, off
    return nearest, least


@inner_kernel
def _squared(point, known, variance, x, y, turn):  # type: ignore[no-untyped-def]
    c, s = math.cos(turn), math.sin(turn)
    dx = known[0] - c * point[0] + s * point[1] - x
    dy = known[1] - s * point[0] - c * point[1] - y
    return (dx * dx + dy * dy) / variance
