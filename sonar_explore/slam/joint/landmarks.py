"""What one scan heard of landmarks, lines of chains and points, as an extended Kalman filter takes it: its kernels.

A landmark is a row of `marks`. A line is the bearing of its normal [rad] and how far it lies beyond an anchor, along
that normal [m]; then the anchor's x y [m], which stays where the line was first heard, so that both numbers stay small.
A point is its x y [m]. What was heard of one is a row of `heard`. The state is that of `kalman`, the scale of all
ranges, and two numbers of each landmark in turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_allocating_kernel, inner_kernel, lean_kernel
from sonar_explore.geometry import Array, wrap_angle
from sonar_explore.slam.kalman import HEADING, OWN, SIZE, TURN, X, Y
from sonar_explore.slam.turn.heard import wrapped

SCALE, BASE = SIZE, SIZE + 1
ENTRIES = 8
"""Of a row of the Jacobian that are not zero at most."""

FIRST, SECOND, ANCHOR_X, ANCHOR_Y, KIND, CHAIN, TIMES, LAST = range(8)
"""Columns of a landmark: its two numbers, its anchor, what it is, its chain, how many scans heard it, and the last."""
LINE = -1.0
"""The kind of a line; those of points are `PointKind`."""

SLOT, BEARING, RANGE, SWEEP, BEARING_VARIANCE, RANGE_VARIANCE, RADIUS = range(7)
"""Columns of what was heard: the row of the landmark; bearing and range of the normal or the point, robot frame at the
start of the scan; how far the robot had turned by then; how sure these are; and a column's radius."""


@lean_kernel
def looked(state, marks, heard, columns, values, innovation, noise):  # type: ignore[no-untyped-def]
    """Two rows of the Jacobian for each thing heard, of bearing and range, by how much it was heard elsewhere, and the
    noise; into the first rows of these."""
    for i in range(len(heard)):
        slot, a, b = int(heard[i, SLOT]), 2 * i, 2 * i + 1
        for row in range(a, a + 2):
            columns[row, 0], columns[row, 1], columns[row, 2] = X, Y, HEADING
            columns[row, 3], columns[row, 4], columns[row, 5] = TURN, OWN, SCALE
            columns[row, 6], columns[row, 7] = BASE + 2 * slot, BASE + 2 * slot + 1
            for k in range(values.shape[1]):
                values[row, k] = 0.0
        values[a, 2], values[a, 3], values[a, 4] = -1.0, -heard[i, SWEEP], -heard[i, SWEEP]
        values[b, 5] = -heard[i, RANGE]
        noise[a], noise[b] = heard[i, BEARING_VARIANCE], heard[i, RANGE_VARIANCE]
        bearing, depth = state[2] + heard[i, BEARING], heard[i, RANGE] * (1.0 + state[SCALE])
        if marks[slot, KIND] == LINE:
            angle, side = marks[slot, FIRST], 1.0
            turn = wrapped(bearing - angle)
            if abs(turn) > 0.5 * math.pi:  # seen from behind
                turn, side = wrapped(turn + math.pi), -1.0
            c, s = math.cos(angle), math.sin(angle)
            dx, dy = marks[slot, ANCHOR_X] - state[0], marks[slot, ANCHOR_Y] - state[1]
            innovation[a] = turn
            innovation[b] = depth - side * (marks[slot, SECOND] + c * dx + s * dy)
            values[a, 6] = 1.0
            values[b, 0], values[b, 1] = -side * c, -side * s
            values[b, 6], values[b, 7] = side * (c * dy - s * dx), side
        else:
            dx, dy = marks[slot, FIRST] - state[0], marks[slot, SECOND] - state[1]
            away = max(np.hypot(dx, dy), 1e-3)
            c, s = dx / away, dy / away
            innovation[a] = wrapped(bearing - math.atan2(dy, dx))
            innovation[b] = depth + heard[i, RADIUS] - away
            values[a, 0], values[a, 1], values[a, 6], values[a, 7] = s / away, -c / away, -s / away, c / away
            values[b, 0], values[b, 1], values[b, 6], values[b, 7] = -c, -s, c, s


def same_line(
    marks: Array, first: int, second: int, columns: NDArray[np.int64], values: Array, innovation: Array
) -> None:
    """Two rows that say that the lines in these slots are one: alike in bearing, the second's foot on the first."""
    one, other = marks[first].tolist(), marks[second].tolist()
    angle, turn = one[FIRST], wrap_angle(other[FIRST] - one[FIRST])
    if abs(turn) > 0.5 * math.pi:
        turn = wrap_angle(turn + math.pi)
    c, s = math.cos(angle), math.sin(angle)
    u, v = math.cos(other[FIRST]), math.sin(other[FIRST])
    dx = other[ANCHOR_X] + other[SECOND] * u - one[ANCHOR_X]
    dy = other[ANCHOR_Y] + other[SECOND] * v - one[ANCHOR_Y]
    columns[:], values[:] = 0, 0.0
    columns[:, 0], columns[:, 1] = BASE + 2 * first, BASE + 2 * first + 1
    columns[:, 2], columns[:, 3] = BASE + 2 * second, BASE + 2 * second + 1
    innovation[0], innovation[1] = turn, c * dx + s * dy - one[SECOND]
    values[0, 0], values[0, 2] = 1.0, -1.0
    values[1, 0], values[1, 1] = s * dx - c * dy, 1.0
    values[1, 2], values[1, 3] = other[SECOND] * (c * v - s * u), -(c * u + s * v)


@inner_kernel
def observed(covariance, columns, values, across, expected):  # type: ignore[no-untyped-def]
    """H P, shape (m, n), and H P H' of a sparse Jacobian H; P is symmetric, the first n rows and columns given."""
    m, n = across.shape
    for i in range(m):
        for j in range(n):
            across[i, j] = 0.0
        for k in range(columns.shape[1]):
            column, value = columns[i, k], values[i, k]
            if value != 0.0:
                for j in range(n):
                    across[i, j] += value * covariance[column, j]
    for i in range(m):
        for j in range(m):
            expected[i, j] = 0.0
            for k in range(columns.shape[1]):
                expected[i, j] += across[i, columns[j, k]] * values[j, k]


@inner_kernel
def squared(expected, innovation, noise, off):  # type: ignore[no-untyped-def]
    """How far off each thing is, bearing and range together, in squared standard deviations."""
    for i in range(len(off)):
        off[i] = _squared(expected, innovation, noise, i)


@inner_kernel
def _squared(expected, innovation, noise, i):  # type: ignore[no-untyped-def]
    a, b = 2 * i, 2 * i + 1
    p, q, r = expected[a, a] + noise[a], expected[a, b], expected[b, b] + noise[b]
    x, y = innovation[a], innovation[b]
    return (r * x * x - 2.0 * q * x * y + p * y * y) / (p * r - q * q)


@inner_kernel
def learned(covariance, across, expected, innovation, noise, huber, change):  # type: ignore[no-untyped-def]
    """One update of the filter: the covariance in place, and the change of the state.

    With L L' the covariance of the innovation, P becomes P - A'A and the state moves by A' L^-1 y, where A is L^-1 H P.
    The noise of what is farther off than this many squared sigmas, bearing and range together, grows with that.

    Args:
        across: H P; becomes A.
        expected: H P H'; becomes L.
        innovation: y; becomes L^-1 y.
        noise: of each row; grows.
    """
    m, n = across.shape
    for i in range(m // 2):
        grown = max(1.0, _squared(expected, innovation, noise, i) / huber)
        noise[2 * i] *= grown
        noise[2 * i + 1] *= grown
    for i in range(m):
        expected[i, i] += noise[i]
        for j in range(i + 1):
            value = expected[i, j]
            for k in range(j):
                value -= expected[i, k] * expected[j, k]
            expected[i, j] = math.sqrt(value) if i == j else value / expected[j, j]
        for k in range(i):
            innovation[i] -= expected[i, k] * innovation[k]
            for j in range(n):
                across[i, j] -= expected[i, k] * across[k, j]
        innovation[i] /= expected[i, i]
        for j in range(n):
            across[i, j] /= expected[i, i]
    for j in range(n):
        change[j] = 0.0
        for i in range(m):
            change[j] += across[i, j] * innovation[i]
    # by rounding, the unknowns of one landmark, or of pose and wheels, may differ about the diagonal
    for i in range(n):
        for j in range(max(0, i - BASE), i):
            covariance[j, i] = covariance[i, j]
    for i in range(n):
        for k in range(m):
            value = across[k, i]
            for j in range(n):
                covariance[i, j] -= value * across[k, j]


@inner_kernel
def candidates(here, kinds, marks, reach, pairs):  # type: ignore[no-untyped-def]
    """Points of a scan and the landmarks of their kind this near, into `pairs` by the point: how many."""
    count = 0
    for i in range(len(here)):
        for j in range(len(marks)):
            if marks[j, KIND] == kinds[i]:
                dx, dy = marks[j, FIRST] - here[i, 0], marks[j, SECOND] - here[i, 1]
                if dx * dx + dy * dy <= reach * reach:
                    pairs[count, 0], pairs[count, 1] = i, j
                    count += 1
    return count


@inner_allocating_kernel
def best_pairs(expected, innovation, pairs, unmatched, most_steps, chosen):  # type: ignore[no-untyped-def]
    """Which pairs of point and landmark are true, into `chosen`: those that together are likeliest.

    Joint compatibility, branch and bound (Neira and Tardos 2001): a set of pairs costs its squared Mahalanobis
    distance, in which all share the error of the pose, and each point without a landmark costs `unmatched`. The factor
    of the covariance grows by two rows with each pair, so that a branch costs no more than its last pair.

    Args:
        expected: covariance of the innovation with its noise, two rows a pair.
        pairs: point and landmark of each, by the point.
        most_steps: of the search; the best set so far stands then.
    """
    n = len(pairs)
    first = np.empty(n + 1, dtype=np.int64)
    levels = 0
    for i in range(n):
        chosen[i] = False
        if i == 0 or pairs[i, 0] != pairs[i - 1, 0]:
            first[levels] = i
            levels += 1
    first[levels] = n
    if n == 0:
        return
    factor, rest = np.empty((2 * levels, 2 * levels)), np.empty(2 * levels)
    pick, rank = np.empty(levels, dtype=np.int64), np.zeros(levels + 1, dtype=np.int64)
    rows, cost = np.empty(2 * levels, dtype=np.int64), np.zeros(levels + 1)
    best, steps = np.inf, 0
    level = np.int64(0)  # not a constant, for which `_taken` would be compiled once more
    pick[0] = first[0] - 1
    while level >= 0 and steps < most_steps:
        steps += 1
        pick[level] += 1
        at = pick[level]
        if at > first[level + 1]:
            level -= 1
            continue
        used, added = rank[level], unmatched
        if at < first[level + 1]:
            if _taken(pairs, pick, first, level):
                continue
            rows[used], rows[used + 1] = 2 * at, 2 * at + 1
            added = _next_rows(expected, innovation, rows, used, factor, rest)
            used += 2
        if cost[level] + added >= best:
            continue
        if level + 1 < levels:
            level += 1
            cost[level], rank[level], pick[level] = cost[level - 1] + added, used, first[level] - 1
            continue
        best = cost[level] + added
        for i in range(n):
            chosen[i] = False
        for k in range(levels):
            if pick[k] < first[k + 1]:
                chosen[pick[k]] = True


@inner_kernel
def _taken(pairs, pick, first, level):  # type: ignore[no-untyped-def]
    """Whether the landmark of this level's pair is another point's already."""
    taken = False
    for k in range(level):
        taken = taken or (pick[k] < first[k + 1] and pairs[pick[k], 1] == pairs[pick[level], 1])
    return taken


@inner_kernel
def _next_rows(expected, innovation, rows, used, factor, rest):  # type: ignore[no-untyped-def]
    """Two rows more of the Cholesky factor of these rows, and of what it leaves of the innovation: its square."""
    added = 0.0
    for i in range(used, used + 2):
        left = innovation[rows[i]]
        for j in range(i + 1):
            value = expected[rows[i], rows[j]]
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = math.sqrt(value) if i == j else value / factor[j, j]
            if j < i:
                left -= factor[i, j] * rest[j]
        rest[i] = left / factor[i, i]
        added += rest[i] * rest[i]
    return added
