"""The steps of the joint estimate, each in one kernel; `landmarks` has what they are made of.

All change the estimate in place. It is `state`, shape (7,): x, y [m], heading [rad], error of turns, bend of drives
[rad/m], the own error of the turn at hand, the scale of all ranges; `marks`, a row for each landmark; `full`, their
covariance, in a square with room for more; and what motions did since that was settled: `covariance`, of the first six,
and `transition`, which made it of the one before. What was heard comes as rows of `landmarks`.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel
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
from sonar_explore.slam.kalman import HEADING, OWN, SIZE, TURN, X, Y
from sonar_explore.sums import fma


@kernel
def settled(marks, full, covariance, transition):  # type: ignore[no-untyped-def]
    """What motions did is taken into the whole covariance: how wide that is."""
    n = BASE + 2 * len(marks)
    moved = np.zeros((SIZE, n))
    for i in range(SIZE):
        for k in range(SIZE):
            value = transition[i, k]
            transition[i, k] = 1.0 if i == k else 0.0
            if value != 0.0:
                for j in range(SIZE, n):
                    moved[i, j] = fma(value, full[k, j], moved[i, j])
    for i in range(SIZE):
        for j in range(SIZE):
            full[i, j] = covariance[i, j]
        for j in range(SIZE, n):
            full[i, j] = full[j, i] = moved[i, j]
    return n


@kernel
def new_turn(marks, full, covariance, transition):  # type: ignore[no-untyped-def]
    """The turn at hand has an error of its own, of which nothing else tells."""
    for j in range(SIZE, settled(marks, full, covariance, transition)):
        full[OWN, j] = full[j, OWN] = 0.0


@kernel
def turn_learned(state, marks, full, covariance, transition, relative, variance, huber):  # type: ignore[no-untyped-def]
    """What the discs say of the turn: by how much more the robot turned than it counted, relative."""
    settled(marks, full, covariance, transition)
    columns, values = np.zeros((1, ENTRIES), dtype=np.int64), np.zeros((1, ENTRIES))
    innovation, noise = np.empty(1), np.empty(1)
    columns[0, 0], columns[0, 1], values[0, 0], values[0, 1] = TURN, OWN, 1.0, 1.0
    innovation[0], noise[0] = relative, variance
    across, expected = _observed(full, marks, columns, values)
    _corrected(state, marks, full, covariance, across, expected, innovation, noise, huber)


@kernel
def walls_off(state, marks, full, covariance, transition, heard, off):  # type: ignore[no-untyped-def]
    """How far off each wall is from the line it may be of, in squared standard deviations."""
    settled(marks, full, covariance, transition)
    columns, values, innovation, noise = _looked(state, marks, heard)
    squared(_observed(full, marks, columns, values)[1], innovation, noise, off)


@kernel
def walls_learned(state, marks, full, covariance, transition, heard, same, same_noise, huber, scan):  # type: ignore[no-untyped-def]
    """What walls of a scan say; and that two lines each, in the slots of a row of `same`, are one."""
    settled(marks, full, covariance, transition)
    m, more = 2 * len(heard), 2 * len(same)
    columns, values = np.empty((m + more, ENTRIES), dtype=np.int64), np.empty((m + more, ENTRIES))
    innovation, noise = np.empty(m + more), np.empty(m + more)
    columns[:m], values[:m], innovation[:m], noise[:m] = _looked(state, marks, heard)
    for i in range(len(same)):
        rows, (one, other) = slice(m + 2 * i, m + 2 * i + 2), same[i]
        same_line(marks[one], marks[other], one, other, columns[rows], values[rows], innovation[rows])
        noise[rows] = same_noise
    for i in range(len(heard)):
        marks[int(heard[i, SLOT]), LAST] = scan
    across, expected = _observed(full, marks, columns, values)
    _corrected(state, marks, full, covariance, across, expected, innovation, noise, huber)


@kernel
def points_learned(  # type: ignore[no-untyped-def]
    state, marks, full, covariance, transition, heard, kinds, reach, gate, unmatched, steps, huber, scan, met
):
    """What the points of a scan say that are known; `met`: which of them are.

    Args:
        reach: how far from a landmark a point may be heard that is it, [m].
        gate: how far off, in squared standard deviations.
        unmatched, steps: see `landmarks.best_pairs`.
    """
    settled(marks, full, covariance, transition)
    here, pairs = np.empty((len(heard), 2)), np.empty((len(heard) * len(marks), 2), dtype=np.int64)
    for i in range(len(heard)):
        met[i] = False
        here[i, 0], here[i, 1] = _place(state, heard[i], heard[i, RANGE] + heard[i, RADIUS])
    pairs = pairs[: candidates(here, kinds, marks, reach, pairs)]
    rows = np.empty((len(pairs), RADIUS + 1))
    for i in range(len(pairs)):
        rows[i] = heard[pairs[i, 0]]
        rows[i, SLOT] = pairs[i, 1]
    columns, values, innovation, noise = _looked(state, marks, rows)
    across, expected = _observed(full, marks, columns, values)
    off = np.empty(len(pairs))
    squared(expected, innovation, noise, off)
    pairs, across, expected, innovation, noise = _only(
        off <= gate, pairs, across, expected, innovation, noise
    )
    chosen, noisy = np.empty(len(pairs), dtype=np.bool_), expected.copy()
    for i in range(len(noise)):
        noisy[i, i] += noise[i]
    best_pairs(noisy, innovation, pairs, unmatched, steps, chosen)
    pairs, across, expected, innovation, noise = _only(chosen, pairs, across, expected, innovation, noise)
    if len(pairs):
        _corrected(state, marks, full, covariance, across, expected, innovation, noise, huber)
    for i in range(len(pairs)):
        met[pairs[i, 0]] = True
        marks[pairs[i, 1], TIMES] += 1
        marks[pairs[i, 1], LAST] = scan


@kernel
def points_added(state, marks, count, full, covariance, transition, heard, kinds, met, scan):  # type: ignore[no-untyped-def]
    """Points of a scan that were not met are landmarks from now on: how many there are then."""
    n = settled(marks[:count], full, covariance, transition)
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


@kernel
def wall_added(state, marks, count, full, covariance, transition, heard, chain, scan):  # type: ignore[no-untyped-def]
    """The line of a wall of a scan, `heard`, is a landmark from now on."""
    n = settled(marks[:count], full, covariance, transition)
    depth, angle = heard[RANGE] * (1.0 + state[SCALE]), state[HEADING] + heard[BEARING]
    c, s = math.cos(angle), math.sin(angle)
    by_state, noise, mark = np.zeros((2, BASE)), np.zeros((2, 2)), marks[count]
    by_state[0, HEADING], by_state[0, TURN], by_state[0, OWN] = 1.0, heard[SWEEP], heard[SWEEP]
    by_state[1, X], by_state[1, Y], by_state[1, SCALE] = c, s, heard[RANGE]
    noise[0, 0], noise[1, 1] = heard[BEARING_VARIANCE], heard[RANGE_VARIANCE]
    added(full, n, by_state, noise)
    mark[0], mark[1], mark[2], mark[3] = angle, 0.0, state[X] + depth * c, state[Y] + depth * s
    mark[KIND], mark[CHAIN], mark[TIMES], mark[LAST] = LINE, chain, 1.0, scan


@lean_kernel
def last_stale(marks, before):  # type: ignore[no-untyped-def]
    """The last of the points that one scan alone heard, at or before this one; -1 where there is none."""
    for slot in range(len(marks) - 1, -1, -1):
        if marks[slot, KIND] != LINE and marks[slot, TIMES] < 2 and marks[slot, LAST] <= before:
            return slot
    return -1


@kernel
def dropped(marks, full, covariance, transition, slot):  # type: ignore[no-untyped-def]
    """A landmark gives its row to the last one."""
    n = settled(marks, full, covariance, transition)
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
    across = np.zeros((2, n))
    for i in range(2):
        for k in range(BASE):
            value = by_state[i, k]
            if value != 0.0:
                for j in range(n):
                    across[i, j] = fma(value, full[k, j], across[i, j])
    for i in range(2):
        for j in range(n):
            full[n + i, j] = full[j, n + i] = across[i, j]
        for j in range(2):
            spread = 0.0
            for k in range(BASE):
                spread = fma(across[i, k], by_state[j, k], spread)
            full[n + i, n + j] = spread + noise[i, j]


@inner_kernel
def _place(state, heard, depth):  # type: ignore[no-untyped-def]
    """x y of what was heard at this depth, map frame, [m]."""
    angle = state[HEADING] + heard[BEARING]
    return state[X] + depth * math.cos(angle), state[Y] + depth * math.sin(angle)


@kernel
def _looked(state, marks, heard):  # type: ignore[no-untyped-def]
    """Jacobian, innovation and noise of what was heard, two rows each."""
    m = 2 * len(heard)
    columns, values = np.empty((m, ENTRIES), dtype=np.int64), np.empty((m, ENTRIES))
    innovation, noise = np.empty(m), np.empty(m)
    looked(state, state[SCALE], marks, heard, columns, values, innovation)
    for i in range(len(heard)):
        noise[2 * i], noise[2 * i + 1] = heard[i, BEARING_VARIANCE], heard[i, RANGE_VARIANCE]
    return columns, values, innovation, noise


@kernel
def _observed(full, marks, columns, values):  # type: ignore[no-untyped-def]
    """H P and H P H'."""
    m, n = len(columns), BASE + 2 * len(marks)
    across, expected = np.empty((m, n)), np.empty((m, m))
    observed(full, columns, values, across, expected)
    return across, expected


@kernel
def _corrected(state, marks, full, covariance, across, expected, innovation, noise, huber):  # type: ignore[no-untyped-def]
    """One update of everything, with Huber's loss over bearing and range together."""
    change = np.empty(across.shape[1])
    learned(full, across, expected, innovation, noise, huber, change)
    for i in range(SIZE):
        for j in range(SIZE):
            covariance[i, j] = full[i, j]
    for i in range(BASE):
        state[i] += change[i]
    for k in range(len(marks)):
        marks[k, FIRST] += change[BASE + 2 * k]
        marks[k, SECOND] += change[BASE + 2 * k + 1]


@kernel
def _only(chosen, pairs, across, expected, innovation, noise):  # type: ignore[no-untyped-def]
    """What is said by the pairs chosen, two rows each."""
    m = 0
    for keep in chosen:
        m += keep
    rows = np.empty(2 * m, dtype=np.int64)
    left, out = np.empty((m, 2), dtype=np.int64), np.empty((2 * m, across.shape[1]))
    inside, off, sure = np.empty((2 * m, 2 * m)), np.empty(2 * m), np.empty(2 * m)
    k = 0
    for i in range(len(chosen)):
        if chosen[i]:
            left[k, 0], left[k, 1] = pairs[i, 0], pairs[i, 1]
            rows[2 * k], rows[2 * k + 1] = 2 * i, 2 * i + 1
            k += 1
    for i in range(2 * m):
        off[i], sure[i] = innovation[rows[i]], noise[rows[i]]
        for j in range(across.shape[1]):
            out[i, j] = across[rows[i], j]
        for j in range(2 * m):
            inside[i, j] = expected[rows[i], rows[j]]
    return left, out, inside, off, sure
