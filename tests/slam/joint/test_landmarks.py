# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The kernels of the joint estimate say what its matrices say, and find the pairs that a search of all would."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from way_in import way_in

from sonar_explore.slam.joint.landmarks import (
    BASE,
    ENTRIES,
    LINE,
    best_pairs,
    candidates,
    learned,
    looked,
    observed,
    same_line,
    squared,
)
from sonar_explore.slam.kalman import OWN, TURN
from sonar_explore.slam.turn.points import PointKind

STEP = 1e-6


def dense(columns, values, n):
    """The Jacobian as a matrix."""
    out = np.zeros((len(columns), n))
    for i, (row, entries) in enumerate(zip(columns, values, strict=True)):
        np.add.at(out[i], row, entries)
    return out


def look(state, marks, heard):
    """Jacobian and innovation at a state of pose, turn, bend, own, scale and the landmarks' numbers."""
    marks = marks.copy()
    marks[:, :2] = state[BASE:].reshape(-1, 2)
    m = 2 * len(heard)
    columns, values, innovation = np.empty((m, ENTRIES), dtype=np.intp), np.empty((m, ENTRIES)), np.empty(m)
    turned = heard.copy()
    turned[:, 1] += heard[:, 3] * (state[TURN] + state[OWN])
    looked(state[:BASE], marks, turned, columns, values, innovation, np.empty(m))
    return dense(columns, values, len(state)), innovation


def derivative(of, state):
    """By differences."""
    columns = []
    for step in STEP * np.eye(len(state)):
        off = of(state + step) - of(state - step)
        columns.append(off / (2.0 * STEP))
    return np.column_stack(columns)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000))
def test_what_is_heard_of_lines_and_points_changes_with_the_state_as_the_jacobian_says(seed):
    rng = np.random.default_rng(seed)
    pose, kinds = rng.uniform(-2, 2, 3), np.array([LINE, LINE, float(PointKind.EDGE)])
    state = np.concatenate([pose, rng.normal(0, 0.01, 4), np.zeros(6)])
    marks = np.column_stack([np.zeros((3, 2)), rng.uniform(-2, 2, (3, 2)), kinds, np.zeros((3, 3))])
    bearings = rng.uniform(-3, 3, 3)
    angles = pose[2] + bearings + np.array([0.0, math.pi, 0.0])  # the second is seen from behind
    for i in range(2):
        state[BASE + 2 * i] = angles[i] + rng.normal(0, 0.1)
        state[BASE + 2 * i + 1] = rng.normal(0, 0.2)
    state[-2:] = pose[:2] + 1.5 * np.array([math.cos(angles[2]), math.sin(angles[2])])
    heard = np.column_stack(
        [np.arange(3), bearings, rng.uniform(0.5, 2, 3), rng.uniform(-6, 6, 3), np.ones((3, 2)), np.zeros(3)]
    )
    jacobian, _ = look(state, marks, heard)
    np.testing.assert_allclose(jacobian, -derivative(lambda s: look(s, marks, heard)[1], state), atol=1e-6)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.booleans())
def test_two_lines_come_together_as_the_jacobian_says(seed, faces_away):
    rng = np.random.default_rng(seed)
    marks = rng.uniform(-1, 1, (2, 8))
    marks[1, 0] = marks[0, 0] + rng.normal(0, 0.2) + (math.pi if faces_away else 0.0)
    state = np.concatenate([np.zeros(BASE), marks[:, :2].ravel()])

    def rows(state):
        moved = marks.copy()
        moved[:, :2] = state[BASE:].reshape(2, 2)
        columns, values, off = np.empty((2, ENTRIES), dtype=np.intp), np.empty((2, ENTRIES)), np.empty(2)
        same_line(moved, 0, 1, columns, values, off)
        return dense(columns, values, len(state)), off

    np.testing.assert_allclose(rows(state)[0], -derivative(lambda s: rows(s)[1], state), atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_the_innovation_has_the_covariance_of_the_dense_products(seed):
    rng = np.random.default_rng(seed)
    n, m = 15, 6
    root = rng.normal(size=(n, n))
    covariance, columns = root @ root.T, rng.integers(0, n, (m, ENTRIES))
    values, noise, innovation = rng.normal(size=(m, ENTRIES)), rng.uniform(0.1, 1, m), rng.normal(size=m)
    across, expected, off = np.empty((m, n)), np.empty((m, m)), np.empty(m // 2)
    way_in(observed)(covariance, columns, values, across, expected)
    jacobian = dense(columns, values, n)
    np.testing.assert_allclose(across, jacobian @ covariance, atol=1e-9)
    np.testing.assert_allclose(expected, jacobian @ covariance @ jacobian.T, atol=1e-9)
    way_in(squared)(expected, innovation, noise, off)
    for i in range(m // 2):
        both = slice(2 * i, 2 * i + 2)
        block = expected[both, both] + np.diag(noise[both])
        assert off[i] == pytest.approx(innovation[both] @ np.linalg.solve(block, innovation[both]))


@pytest.mark.parametrize("m", [1, 2, 6])
def test_an_update_is_that_of_the_textbook_and_counts_what_is_far_off_less(m):
    rng = np.random.default_rng(m)
    n, huber = 11, 1.5
    root = rng.normal(size=(n, n))
    covariance, jacobian = root @ root.T, rng.normal(size=(m, n))
    noise, innovation = rng.uniform(0.1, 1, m), 8.0 * rng.normal(size=m)
    across = jacobian @ covariance
    expected, grown = across @ jacobian.T, noise.copy()
    for i in range(m // 2):
        both = slice(2 * i, 2 * i + 2)
        block = expected[both, both] + np.diag(noise[both])
        grown[both] *= max(1.0, innovation[both] @ np.linalg.solve(block, innovation[both]) / huber)
    gain = np.linalg.solve(expected + np.diag(grown), across).T
    moved, left = gain @ innovation, covariance - gain @ across
    whole, change = np.zeros((n + 2, n + 2)), np.empty(n)
    whole[:n, :n] = covariance
    way_in(learned)(whole, across, expected, innovation, noise, huber, change)
    np.testing.assert_allclose(change, moved, atol=1e-9)
    np.testing.assert_allclose(whole[:n, :n], left, atol=1e-9)
    assert (whole == whole.T).all()
    assert not whole[n:].any()


def cheapest(expected, innovation, pairs, unmatched):
    """By trying all sets of pairs: the least cost."""
    points = sorted(set(pairs[:, 0].tolist()))
    options = [[None, *np.flatnonzero(pairs[:, 0] == point).tolist()] for point in points]
    costs = []
    for choice in product(*options):
        taken = [i for i in choice if i is not None]
        if len({int(pairs[i, 1]) for i in taken}) == len(taken):
            rows = np.array([row for i in taken for row in (2 * i, 2 * i + 1)], dtype=int)
            inside = innovation[rows] @ np.linalg.solve(expected[np.ix_(rows, rows)], innovation[rows])
            costs.append(inside + unmatched * (len(points) - len(taken)))
    return min(costs)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 4))
def test_no_other_set_of_pairs_is_likelier(seed, points, landmarks):
    rng = np.random.default_rng(seed)
    every = np.array(list(product(range(points), range(landmarks))), dtype=np.intp)
    pairs = every[rng.random(len(every)) < 0.7]
    root = rng.normal(size=(2 * len(pairs), 3))
    expected = root @ root.T + np.eye(2 * len(pairs))
    innovation, chosen = rng.normal(0, 2, 2 * len(pairs)), np.ones(len(pairs), dtype=bool)
    way_in(best_pairs)(expected, innovation, pairs, 4.0, 100_000, chosen)
    assert len(set(pairs[chosen, 0])) == len(set(pairs[chosen, 1])) == np.count_nonzero(chosen)
    if len(pairs):
        rows = np.flatnonzero(np.repeat(chosen, 2))
        inside = innovation[rows] @ np.linalg.solve(expected[np.ix_(rows, rows)], innovation[rows])
        cost = inside + 4.0 * (len(set(pairs[:, 0])) - np.count_nonzero(chosen))
        assert cost == pytest.approx(cheapest(expected, innovation, pairs, 4.0))


def test_a_point_may_be_a_landmark_of_its_kind_within_reach():
    marks = np.zeros((4, 8))
    marks[:, :2] = (0.0, 0.0), (0.3, 0.0), (2.0, 0.0), (0.1, 0.1)
    marks[:, 4] = PointKind.EDGE, PointKind.CORNER, PointKind.EDGE, LINE
    here, kinds = (
        np.array([(0.1, 0.0), (0.2, 0.0)]),
        np.array([PointKind.EDGE, PointKind.CORNER], dtype=float),
    )
    pairs = np.empty((8, 2), dtype=np.intp)
    count = way_in(candidates)(here, kinds, marks, 1.0, pairs)
    assert pairs[:count].tolist() == [[0, 0], [1, 1]]
