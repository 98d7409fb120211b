"""The steps of the joint estimate, mostly kernels; `landmarks` has what they are made of.

All change the estimate in place. It is `state`, shape (7,): x, y [m], heading [rad], error of turns, bend of drives
[rad/m], the own error of the turn at hand, the scale of all ranges; `marks`, a row for each landmark; `full`, their
covariance, in a square with room for more; and `covariance`, of the first six, which the filter carries along with
motions: what they do to the rest is gathered in `transition`, and `settled` takes it in before any other step. What was
heard comes as rows of `landmarks`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.slam.joint.landmarks import (
    BASE,
    BEARING,
    BEARING_VARIANCE,
    CHAIN,
    ENTRIES,
    FIRST,
    KIND,
    LAST,
    LINE,
    RADIUS,
    RANGE,
    RANGE_VARIANCE,
    SCALE,
    SECOND,
    SLOT,
    SWEEP,
    TIMES,
    best_pairs,
    candidates,
    learned,
    looked,
    observed,
    same_line,
    squared,
)
from sonar_explore.slam.kalman import HEADING, OWN, TURN, X, Y
from sonar_explore.sums import fma


@kernel
def settled(marks, full, covariance, transition):  # type: ignore[no-untyped-def]
    """What motions did is taken into the whole covariance: how wide that is."""
    n, size = BASE + 2 * len(marks), len(covariance)
    moved = np.zeros((size, n))
    for i in range(size):
        for k in range(size):
            value = transition[i, k]
            transition[i, k] = 1.0 if i == k else 0.0
            if value != 0.0:
                for j in range(size, n):
                    moved[i, j] = fma(value, full[k, j], moved[i, j])
    for i in range(size):
        for j in range(size):
            full[i, j] = covariance[i, j]
        for j in range(size, n):
            full[i, j] = full[j, i] = moved[i, j]
    return n


def turn_learned(
    state: Array,
    marks: Array,
    full: Array,
    covariance: Array,
    relative: float,
    variance: float,
    huber: float,
) -> None:
    """What the discs say of the turn: by how much more the robot turned than it counted, relative."""
    columns, values = np.zeros((1, ENTRIES), dtype=np.int64), np.zeros((1, ENTRIES))
    columns[0, 0], columns[0, 1], values[0, 0], values[0, 1] = TURN, OWN, 1.0, 1.0
    innovation, noise = np.array([relative]), np.array([variance])
    corrected(state, marks, full, covariance, columns, values, innovation, noise, huber)


@kernel
def walls_off(state, marks, full, heard, off):  # type: ignore[no-untyped-def]
    """How far off each wall is from the line it may be of, in squared standard deviations."""
    m, n = 2 * len(heard), BASE + 2 * len(marks)
    columns, values = np.empty((m, ENTRIES), dtype=np.int64), np.empty((m, ENTRIES))
    innovation, noise, across, expected = np.empty(m), np.empty(m), np.empty((m, n)), np.empty((m, m))
    looked(state, marks, heard, columns, values, innovation, noise)
    observed(full, columns, values, across, expected)
    squared(expected, innovation, noise, off)


def walls_learned(
    state: Array,
    marks: Array,
    full: Array,
    covariance: Array,
    heard: Array,
    same: NDArray[np.int64],
    same_noise: Array,
    huber: float,
    scan: int,
) -> None:
    """What walls of a scan say; and that two lines each, in the slots of a row of `same`, are one."""
    first, m = 2 * len(heard), 2 * len(heard) + 2 * len(same)
    columns, values = np.empty((m, ENTRIES), dtype=np.int64), np.empty((m, ENTRIES))
    innovation, noise = np.empty(m), np.empty(m)
    looked(state, marks, heard, columns, values, innovation, noise)
    for one, other in same.tolist():
        rows = slice(first, first + 2)
        same_line(marks, one, other, columns[rows], values[rows], innovation[rows])
        noise[rows] = same_noise
        first += 2
    marks[heard[:, SLOT].astype(np.intp), LAST] = scan
    corrected(state, marks, full, covariance, columns, values, innovation, noise, huber)


@kernel
def points_learned(  # type: ignore[no-untyped-def]
    state, marks, full, covariance, heard, kinds, reach, gate, unmatched, steps, huber, scan, met
):
    """What the points of a scan say that are known; `met`: which of them are.

    Args:
        reach: how far from a landmark a point may be heard that is it, [m].
        gate: how far off, in squared standard deviations.
        unmatched, steps: see `landmarks.best_pairs`.
    """
    here, pairs = np.empty((len(heard), 2)), np.empty((len(heard) * len(marks), 2), dtype=np.int64)
    for i in range(len(heard)):
        met[i] = False
        here[i, 0], here[i, 1] = _place(state, heard[i], heard[i, RANGE] + heard[i, RADIUS])
    count = candidates(here, kinds, marks, reach, pairs)
    rows, m, n = np.empty((count, heard.shape[1])), 2 * count, BASE + 2 * len(marks)
    for i in range(count):
        for k in range(heard.shape[1]):
            rows[i, k] = heard[pairs[i, 0], k]
        rows[i, SLOT] = pairs[i, 1]
    columns, values = np.empty((m, ENTRIES), dtype=np.int64), np.empty((m, ENTRIES))
    innovation, noise, across, expected = np.empty(m), np.empty(m), np.empty((m, n)), np.empty((m, m))
    looked(state, marks, rows, columns, values, innovation, noise)
    observed(full, columns, values, across, expected)
    off, chosen, noisy = np.empty(count), np.empty(count, dtype=np.bool_), np.empty((m, m))
    squared(expected, innovation, noise, off)
    for i in range(count):
        chosen[i] = off[i] <= gate
    count = _only(chosen, pairs, across, expected, innovation, noise)
    for i in range(2 * count):
        for j in range(2 * count):
            noisy[i, j] = expected[i, j]
        noisy[i, i] += noise[i]
    best_pairs(noisy, innovation, pairs[:count], unmatched, steps, chosen)
    count = _only(chosen[:count], pairs, across, expected, innovation, noise)
    if count > 0:
        change = np.empty(n)
        learned(full, across[: 2 * count], expected, innovation, noise, huber, change)
        _changed(state, marks, full, covariance, change)
    for i in range(count):
        met[pairs[i, 0]] = True
        marks[pairs[i, 1], TIMES] += 1
        marks[pairs[i, 1], LAST] = scan


@kernel
def points_added(state, marks, count, full, heard, kinds, met, scan):  # type: ignore[no-untyped-def]
    """Points of a scan that were not met are landmarks from now on: how many there are then."""
    n = BASE + 2 * count
    by_state, noise, away, along = np.zeros((2, BASE)), np.empty((2, 2)), np.empty(2), np.empty(2)
    for i in range(len(heard)):
        if met[i]:
            continue
        depth = heard[i, RANGE] * (1.0 + state[SCALE]) + heard[i, RADIUS]
        angle = state[HEADING] + heard[i, BEARING]
        c, s = math.cos(angle), math.sin(angle)
        away[0], away[1], along[0], along[1] = -depth * s, depth * c, c, s
        by_state[0, X] = by_state[1, Y] = 1.0
        for k in range(2):
            by_state[k, HEADING] = away[k]
            by_state[k, TURN] = by_state[k, OWN] = heard[i, SWEEP] * away[k]
            by_state[k, SCALE] = heard[i, RANGE] * along[k]
            for j in range(2):
                noise[k, j] = heard[i, BEARING_VARIANCE] * (away[k] * away[j])
                noise[k, j] += heard[i, RANGE_VARIANCE] * (along[k] * along[j])
        added(full, n, by_state, noise)
        mark = marks[count]
        mark[0], mark[1] = state[X] + depth * c, state[Y] + depth * s
        mark[2], mark[3], mark[KIND], mark[CHAIN], mark[TIMES], mark[LAST] = (
            0.0,
            0.0,
            kinds[i],
            -1.0,
            1.0,
            scan,
        )
        n, count = n + 2, count + 1
    return count


def wall_added(
    state: Array, marks: Array, count: int, full: Array, heard: Array, chain: float, scan: float
) -> None:
    """The line of a wall of a scan, `heard`, is a landmark from now on."""
    (x, y, heading, *_, scale), (_, bearing, range_m, sweep, *_) = state.tolist(), heard.tolist()
    depth, angle = range_m * (1.0 + scale), heading + bearing
    c, s = math.cos(angle), math.sin(angle)
    by_state = np.zeros((2, BASE))
    by_state[0, HEADING], by_state[0, TURN], by_state[0, OWN] = 1.0, sweep, sweep
    by_state[1, X], by_state[1, Y], by_state[1, SCALE] = c, s, range_m
    noise = np.diag(heard[[BEARING_VARIANCE, RANGE_VARIANCE]])
    added(full, BASE + 2 * count, by_state, noise)
    marks[count] = angle, 0.0, x + depth * c, y + depth * s, LINE, chain, 1.0, scan


@lean_kernel
def last_stale(marks, before):  # type: ignore[no-untyped-def]
    """The last of the points that one scan alone heard, at or before this one; -1 where there is none."""
    for slot in range(len(marks) - 1, -1, -1):
        if marks[slot, KIND] != LINE and marks[slot, TIMES] < 2 and marks[slot, LAST] <= before:
            return slot
    return -1


@lean_kernel
def dropped(marks, full, slot):  # type: ignore[no-untyped-def]
    """A landmark gives its row to the last one."""
    n = BASE + 2 * len(marks)
    here, there = BASE + 2 * slot, n - 2
    for i in range(2):
        for j in range(n):
            full[here + i, j] = full[there + i, j]
    for j in range(n):
        for i in range(2):
            full[j, here + i] = full[j, there + i]
    for k in range(marks.shape[1]):
        marks[slot, k] = marks[len(marks) - 1, k]


@kernel
def added(full, n, by_state, noise):  # type: ignore[no-untyped-def]
    """Two unknowns more, that depend on the first ones in this way, shape (2, 7), and have this noise, shape (2, 2)."""
    across = np.zeros((len(by_state), n))
    for i in range(len(by_state)):
        for k in range(by_state.shape[1]):
            value = by_state[i, k]
            if value != 0.0:
                for j in range(n):
                    across[i, j] = fma(value, full[k, j], across[i, j])
    for i in range(len(by_state)):
        for j in range(n):
            full[n + i, j] = full[j, n + i] = across[i, j]
        for j in range(len(by_state)):
            spread = 0.0
            for k in range(by_state.shape[1]):
                spread = fma(across[i, k], by_state[j, k], spread)
            full[n + i, n + j] = spread + noise[i, j]


@inner_kernel
def _place(state, heard, depth):  # type: ignore[no-untyped-def]
    """x y of what was heard at this depth, map frame, [m]."""
    angle = state[HEADING] + heard[BEARING]
    return state[X] + depth * math.cos(angle), state[Y] + depth * math.sin(angle)


@kernel
def corrected(state, marks, full, covariance, columns, values, innovation, noise, huber):  # type: ignore[no-untyped-def]
    """One update of everything by rows of a Jacobian, with Huber's loss over bearing and range together."""
    m, n = len(columns), BASE + 2 * len(marks)
    across, expected, change = np.empty((m, n)), np.empty((m, m)), np.empty(n)
    observed(full, columns, values, across, expected)
    learned(full, across, expected, innovation, noise, huber, change)
    _changed(state, marks, full, covariance, change)


@inner_kernel
def _changed(state, marks, full, covariance, change):  # type: ignore[no-untyped-def]
    """The state and the landmarks move; what the filter keeps apart of the covariance is as it is in the whole."""
    for i in range(len(covariance)):
        for j in range(len(covariance)):
            covariance[i, j] = full[i, j]
    for i in range(len(state)):
        state[i] += change[i]
    for k in range(len(marks)):
        marks[k, FIRST] += change[BASE + 2 * k]
        marks[k, SECOND] += change[BASE + 2 * k + 1]


@inner_kernel
def _only(chosen, pairs, across, expected, innovation, noise):  # type: ignore[no-untyped-def]
    """What is said by the pairs chosen, two rows each, moves to the front: how many they are."""
    count = 0
    for i in range(len(chosen)):
        if chosen[i]:
            pairs[count, 0], pairs[count, 1] = pairs[i, 0], pairs[i, 1]
            for k in range(2):
                row, to = 2 * i + k, 2 * count + k
                innovation[to], noise[to] = innovation[row], noise[row]
                for j in range(across.shape[1]):
                    across[to, j] = across[row, j]
                for j in range(len(expected)):
                    expected[to, j] = expected[row, j]
                for j in range(len(expected)):
                    expected[j, to] = expected[j, row]
            count += 1
    return count
