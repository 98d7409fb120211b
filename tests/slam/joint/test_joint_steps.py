# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The steps of the joint estimate say what matrices say: the same products, in numpy, of dense Jacobians."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Array
from sonar_explore.slam.joint.joint_steps import (
    last_stale,
    points_added,
    points_learned,
    settled,
    turn_learned,
    wall_added,
    walls_learned,
    walls_off,
)
from sonar_explore.slam.joint.landmarks import (
    BASE,
    BEARING,
    ENTRIES,
    KIND,
    LAST,
    LINE,
    RANGE,
    SCALE,
    SLOT,
    SWEEP,
    TIMES,
    looked,
    same_line,
)
from sonar_explore.slam.kalman import HEADING, OWN, SIZE, TURN
from sonar_explore.slam.turn.points import PointKind

EDGE, HUBER, GATE, STEP = float(PointKind.EDGE), 1.5, 11.6, 1e-6


class Estimate:
    """A random one: lines and edges about the robot, all correlated; `marks` has room for more."""

    def __init__(self, seed, lines=3, points=4):
        self.rng = rng = np.random.default_rng(seed)
        self.k = k = lines + points
        self.n = n = BASE + 2 * k
        self.state = np.concatenate([rng.uniform(-2, 2, 3), rng.normal(0, 0.01, 4)])
        self.marks = np.zeros((k + 8, 8))
        self.marks[:lines] = np.column_stack(
            [rng.uniform(-3, 3, lines), rng.normal(0, 0.1, lines), rng.uniform(-2, 2, (lines, 2))]
            + [np.full(lines, LINE), np.arange(lines), np.ones(lines), np.zeros(lines)]
        )
        around = self.state[:2] + rng.uniform(0.6, 1.5, (points, 2)) * rng.choice([-1, 1], (points, 2))
        self.marks[lines:k, :2], self.marks[lines:k, KIND], self.marks[lines:k, 5] = around, EDGE, -1
        self.marks[lines:k, TIMES] = 1
        self.full = np.zeros((n + 16, n + 16))
        root = 0.01 * rng.normal(size=(n, n))
        self.full[:n, :n] = root @ root.T + 1e-6 * np.eye(n)
        self.covariance, self.transition = self.full[:SIZE, :SIZE].copy(), np.eye(SIZE)

    @property
    def parts(self) -> tuple[Array, Array, Array]:
        return self.marks[: self.k], self.full, self.covariance

    def heard(self, slots):
        """What is heard of these landmarks, a little off."""
        out = np.zeros((len(slots), 7))
        for row, slot in zip(out, slots, strict=True):
            mark, (x, y, heading) = self.marks[slot], self.state[:3]
            if mark[KIND] == LINE:
                angle, depth = mark[0], mark[1] + (mark[2] - x) * math.cos(mark[0])
                depth += (mark[3] - y) * math.sin(mark[0])
                angle, depth = (angle, depth) if depth > 0 else (angle + math.pi, -depth)
            else:
                angle, depth = math.atan2(mark[1] - y, mark[0] - x), math.hypot(mark[0] - x, mark[1] - y)
            row[SLOT], row[BEARING] = slot, angle - heading + self.rng.normal(0, 0.02)
            row[RANGE], row[SWEEP] = depth + self.rng.normal(0, 0.02), self.rng.uniform(0, 6)
            row[4], row[5] = 1e-4, 4e-4
        return out

    def jacobian(self, heard):
        """Dense, with its innovation and noise."""
        m = 2 * len(heard)
        columns, values, off = np.empty((m, ENTRIES), dtype=np.intp), np.empty((m, ENTRIES)), np.empty(m)
        noise = np.empty(m)
        looked(self.state, self.marks, heard, columns, values, off, noise)
        return dense(columns, values, self.n), off, noise

    def after(self, jacobian, off, noise):
        """The textbook's update, far ones counting less: state, the landmarks' numbers, covariance."""
        p = self.full[: self.n, : self.n]
        grown = noise.copy()
        for i, square in enumerate(squares(p, jacobian, off, noise)):
            grown[2 * i : 2 * i + 2] *= max(1.0, square / HUBER)
        gain = np.linalg.solve(jacobian @ p @ jacobian.T + np.diag(grown), jacobian @ p).T
        change = gain @ off
        marks = self.marks[: self.k, :2] + change[BASE:].reshape(-1, 2)
        return self.state + change[:BASE], marks, p - gain @ jacobian @ p

    def agrees(self, expected):
        state, marks, covariance = expected
        np.testing.assert_allclose(self.state, state, atol=1e-9)
        np.testing.assert_allclose(self.marks[: self.k, :2], marks, atol=1e-9)
        np.testing.assert_allclose(self.full[: self.n, : self.n], covariance, atol=1e-11)
        assert (self.covariance == self.full[:SIZE, :SIZE]).all()
        return True


def dense(columns, values, n):
    out = np.zeros((len(columns), n))
    for i, (row, entries) in enumerate(zip(columns, values, strict=True)):
        np.add.at(out[i], row, entries)
    return out


def squares(p, jacobian, off, noise):
    """Of bearing and range together, for each thing heard."""
    expected = jacobian @ p @ jacobian.T + np.diag(noise)
    pairs = [slice(i, i + 2) for i in range(0, len(off) - 1, 2)]
    return [off[two] @ np.linalg.solve(expected[two, two], off[two]) for two in pairs]


@pytest.mark.parametrize("seed", range(5))
def test_what_motions_did_is_taken_into_all_correlations(seed):
    now = Estimate(seed)
    motion = np.eye(SIZE)
    motion[:3, 2:] += now.rng.normal(size=(3, 4))
    before, whole = now.full[: now.n, : now.n].copy(), np.eye(now.n)
    whole[:SIZE, :SIZE] = motion
    now.transition[:] = motion
    now.covariance[:] = motion @ now.covariance @ motion.T
    settled(*now.parts, now.transition)
    np.testing.assert_allclose(now.full[: now.n, : now.n], whole @ before @ whole.T, atol=1e-12)
    assert (now.transition == np.eye(SIZE)).all()


@pytest.mark.parametrize("seed", range(5))
def test_the_error_of_a_turn_is_learned(seed):
    now = Estimate(seed)
    jacobian = np.zeros((1, now.n))
    jacobian[0, TURN] = jacobian[0, OWN] = 1.0
    expected = now.after(jacobian, np.array([0.01]), np.array([1e-5]))
    turn_learned(now.state, *now.parts, 0.01, 1e-5, HUBER)
    assert now.agrees(expected)


@pytest.mark.parametrize("seed", range(10))
def test_walls_and_lines_that_are_one_are_learned_together(seed):
    now = Estimate(seed)
    heard, same_noise = now.heard([0, 2]), np.array([1e-5, 1e-4])
    jacobian, off, noise = now.jacobian(heard)
    found = np.empty(2)
    walls_off(now.state, *now.parts[:2], heard, found)
    squared = squares(now.full[: now.n, : now.n], jacobian, off, noise)
    np.testing.assert_allclose(found, squared, atol=1e-9)
    columns, values, apart = np.empty((2, ENTRIES), dtype=np.intp), np.empty((2, ENTRIES)), np.empty(2)
    same_line(now.marks, 0, 1, columns, values, apart)
    rows = np.vstack([jacobian, dense(columns, values, now.n)])
    expected = now.after(rows, np.append(off, apart), np.append(noise, same_noise))
    walls_learned(now.state, *now.parts, heard, np.array([[0, 1]]), same_noise, HUBER, 7)
    assert now.agrees(expected)
    assert now.marks[: now.k, LAST].tolist() == [7, 0, 7, *[0] * 4]


def likeliest(now, heard, reach, unmatched):
    """By trying all: pairs of point and landmark."""
    p, options = now.full[: now.n, : now.n], []
    for row in heard:
        angle = now.state[HEADING] + row[BEARING]
        here = now.state[:2] + row[RANGE] * np.array([math.cos(angle), math.sin(angle)])
        fine = [-1]
        for slot in np.flatnonzero(now.marks[: now.k, KIND] == EDGE):
            known = row.copy()
            known[SLOT] = slot
            near = np.hypot(*(now.marks[slot, :2] - here)) <= reach
            if near and squares(p, *now.jacobian(known[None]))[0] <= GATE:
                fine.append(int(slot))
        options.append(fine)
    best = []
    for slots in product(*options):
        taken = [(i, slot) for i, slot in enumerate(slots) if slot >= 0]
        if len({slot for _, slot in taken}) < len(taken):
            continue
        rows = heard[[i for i, _ in taken]]
        rows[:, SLOT] = [slot for _, slot in taken]
        jacobian, off, noise = now.jacobian(rows)
        cost = off @ np.linalg.solve(jacobian @ p @ jacobian.T + np.diag(noise), off)
        best.append((cost + unmatched * (len(heard) - len(taken)), taken))
    return min(best)[1]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000))
def test_points_are_matched_as_a_search_of_all_matches_them_and_learned(seed):
    now = Estimate(seed)
    heard = now.heard([3, 5, 6])
    heard[2, RANGE] += 0.3  # none of those known, most likely
    pairs, met = likeliest(now, heard, 1.0, 4.0), np.empty(3, dtype=bool)
    rows = heard[[i for i, _ in pairs]]
    rows[:, SLOT] = [slot for _, slot in pairs]
    expected = now.after(*now.jacobian(rows))
    points_learned(now.state, *now.parts, heard, np.full(3, EDGE), 1.0, GATE, 4.0, 100_000, HUBER, 9, met)
    assert np.flatnonzero(met).tolist() == [i for i, _ in pairs]
    assert np.flatnonzero(now.marks[: now.k, LAST] == 9).tolist() == sorted(slot for _, slot in pairs)
    assert now.agrees(expected)


def grown(now, place):
    """The covariance with two unknowns more, which `place` works out of the state, without their own noise."""
    steps = STEP * np.eye(BASE)
    by_state = np.array([place(now.state + s) - place(now.state - s) for s in steps]).T / (2 * STEP)
    whole = np.vstack([np.eye(now.n), np.hstack([by_state, np.zeros((2, now.n - BASE))])])
    return whole @ now.full[: now.n, : now.n] @ whole.T


@pytest.mark.parametrize("seed", range(5))
def test_a_new_point_depends_on_all_that_it_was_heard_by(seed):
    now = Estimate(seed)
    heard, count = np.array([[0.0, 0.4, 1.3, 2.0, 0.0, 0.0, 0.1]] * 2), now.k
    turned = now.state[TURN] + now.state[OWN]

    def place(state):
        angle = state[HEADING] + 0.4 + 2.0 * (state[TURN] + state[OWN] - turned)
        return state[:2] + (1.3 * (1 + state[SCALE]) + 0.1) * np.array([math.cos(angle), math.sin(angle)])

    expected, at = grown(now, place), place(now.state)
    met = np.array([True, False])
    found = points_added(now.state, now.marks, count, now.full, heard, np.full(2, EDGE), met, 4)
    assert found == count + 1
    np.testing.assert_allclose(now.full[: now.n + 2, : now.n + 2], expected, atol=1e-9)
    assert now.marks[count].tolist() == [*at.tolist(), 0.0, 0.0, EDGE, -1.0, 1.0, 4.0]


@pytest.mark.parametrize("seed", range(5))
def test_a_new_line_depends_on_all_that_it_was_heard_by(seed):
    now = Estimate(seed)
    heard, (x, y) = np.array([0.0, 0.4, 1.3, 2.0, 0.0, 0.0, 0.0]), now.state[:2]
    turned, normal = now.state[TURN] + now.state[OWN], now.state[HEADING] + 0.4
    foot = 1.3 * (1 + now.state[SCALE])

    def line(state):
        c, s = math.cos(normal), math.sin(normal)
        beyond = (state[0] - x) * c + (state[1] - y) * s + 1.3 * (1 + state[SCALE]) - foot
        return np.array([state[HEADING] + 0.4 + 2.0 * (state[TURN] + state[OWN] - turned), beyond])

    expected = grown(now, line)
    wall_added(now.state, now.marks, now.k, now.full, heard, 11.0, 4.0)
    np.testing.assert_allclose(now.full[: now.n + 2, : now.n + 2], expected, atol=1e-9)
    anchor = x + foot * math.cos(normal), y + foot * math.sin(normal)
    assert now.marks[now.k].tolist() == [normal, 0.0, *anchor, LINE, 11.0, 1.0, 4.0]


@pytest.mark.parametrize("seed", range(10))
def test_points_that_one_scan_heard_some_time_ago_are_stale(seed):
    now = Estimate(seed)
    marks = now.marks[: now.k]
    marks[:, TIMES], marks[:, LAST] = now.rng.integers(1, 3, (2, now.k))
    stale = np.flatnonzero((marks[:, KIND] != LINE) & (marks[:, TIMES] < 2) & (marks[:, LAST] <= 1))
    assert last_stale(marks, 1) == (stale[-1] if len(stale) else -1)
