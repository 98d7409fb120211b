# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Section III.F: first the heading, equation (4), then the position, equation (5)."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose
from sonar_explore.slam.localization import (
    LocalizationConfig,
    association_weights,
    correct_heading,
    correct_position,
    localize,
    weighted_median,
)
from sonar_explore.slam.residuals import Residuals

CONFIG = LocalizationConfig()
WEIGHTED = st.lists(st.tuples(st.floats(-1, 1), st.floats(0.1, 3.0)), min_size=1, max_size=9)


def residuals(bearings_rad, ndr, adr=None, ranges=None):
    n = len(bearings_rad)
    normals = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
    ndr, adr = np.array(ndr, float), np.zeros(n) if adr is None else np.array(adr, float)
    return Residuals(adr, ndr, normals, ndr, normals, np.ones(n), np.array(ranges or [1.0] * n), np.ones(n))


def shift(bearings_rad, ndr, weights=None):
    weights = np.ones(len(ndr)) if weights is None else np.array(weights)
    return correct_position(residuals(bearings_rad, ndr), weights, CONFIG.parallel_rad)


def cost(bearings_rad, ndr, weights, at):
    normals = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
    return float(np.abs(normals @ np.array(at) + ndr) @ weights)


def test_figure_11_w3_falls_from_near_to_far():
    weights = association_weights(residuals([0.0] * 4, [0.0] * 4, ranges=[0.1, 0.2, 1.1, 2.5]), np.zeros(4))
    assert weights.w3 == pytest.approx([0.9, 0.9, 0.6, 0.3])


def test_weights_add_and_w2_is_half_of_the_association():
    weights = association_weights(residuals([0.0], [0.0], ranges=[1.1]), np.array([0.8]))
    assert weights.heading == pytest.approx([1.0 + 0.4 + 0.6])
    assert weights.position == pytest.approx([1.0 + 0.6])


@settings(max_examples=80, deadline=None)
@given(WEIGHTED)
def test_no_heading_is_better_than_the_weighted_median(drawn):
    values, weights = map(np.array, zip(*drawn, strict=True))
    best = weighted_median(values, weights)
    least = min(float(np.abs(values - v) @ weights) for v in values)
    assert float(np.abs(values - best) @ weights) <= least + 1e-6


def test_a_flat_optimum_gives_its_middle():
    assert weighted_median(np.array([0.0, 1.0]), np.ones(2)) == 0.5
    assert weighted_median(np.array([3.0, 0.0, 1.0, -5.0]), np.ones(4)) == 0.5


@settings(max_examples=40, deadline=None)
@given(st.floats(-0.3, 0.3), st.integers(1, 8), st.integers(0, 1000))
def test_a_pure_heading_error_is_undone_exactly(error, n, seed):
    weights = np.random.default_rng(seed).uniform(0.3, 2.4, n)
    assert correct_heading(np.full(n, error), weights) == pytest.approx(error, abs=1e-12)


def test_one_outlier_among_three_does_not_turn_the_robot():
    assert correct_heading(np.array([0.02, 0.02, 0.3]), np.ones(3)) == 0.02


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=6))
def test_in_a_corridor_the_axis_that_nothing_observes_is_left_alone(bearing, ndr):
    dx, dy = shift([bearing] * len(ndr), ndr)
    assert dx * -math.sin(bearing) + dy * math.cos(bearing) == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-3, 3),
    st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.2, 0.2)), min_size=2, max_size=6),
)
def test_nor_is_it_moved_by_roots_that_are_not_quite_parallel(bearing, drawn):
    bends, ndr = zip(*drawn, strict=True)
    dx, dy = shift([bearing + b for b in bends], ndr)
    assert abs(dx * -math.sin(bearing) + dy * math.cos(bearing)) <= 0.03 * math.hypot(dx, dy) + 1e-9


@settings(max_examples=80, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_two_walls_at_right_angles_give_both_coordinates(x, y):
    assert shift([0.0, math.pi / 2, math.pi], [-x, -y, x]) == pytest.approx((x, y), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-0.2, 0.2), st.floats(0.3, 2.0)), min_size=2, max_size=6),
    st.integers(0, 1000),
)
def test_no_shift_in_the_window_is_better(drawn, seed):
    bearings, ndr, weights = map(np.array, zip(*drawn, strict=True))
    found = shift(bearings, ndr, weights)
    normals = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    axis = np.linalg.eigh((normals * weights[:, None]).T @ normals)[1][:, -1]
    assume((np.abs(normals @ axis) < math.cos(CONFIG.parallel_rad)).any())
    window = np.abs(ndr[:, None] * normals).max(axis=0)
    tried = np.random.default_rng(seed).uniform(-window, window, (200, 2))
    best = cost(bearings, ndr, weights, found)
    assert (np.abs(found) <= window + 1e-6).all()
    assert all(best <= cost(bearings, ndr, weights, at) + 1e-6 for at in [*tried, (0.0, 0.0)])


def test_ties_go_to_the_smallest_shift():
    # Two equal votes for one wall: anything between them costs the same, and staying lies between.
    assert shift([0.0, 0.0, math.pi / 2], [0.1, -0.1, 0.0]) == pytest.approx((0.0, 0.0))
    assert shift([0.0, 0.0, math.pi / 2], [-0.05, -0.1, 0.0])[0] == pytest.approx(0.05)


def test_no_association_gives_no_correction():
    none = residuals([], [])
    correction = localize(none, association_weights(none, np.array([])), CONFIG)
    assert correction.applied_to(Pose(1, 2, 3)) == Pose(1, 2, 3)


def test_a_single_association_is_applied():
    one = residuals([0.0], [0.1], adr=[0.05])
    correction = localize(one, association_weights(one, np.ones(1)), CONFIG)
    assert (correction.x, correction.y, correction.heading) == pytest.approx((-0.1, 0.0, 0.05))
