"""The odometry error of READING section 3: its figures, and that the time step does not matter."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.envs.odometry import NOISE_PRESETS, OdometryError, OdometryNoise, noise_preset
from sonar_explore.errors import SonarExploreError

WHEEL_BASE_M = 0.23
FULL_TURN = 2.0 * math.pi


class Middling:
    """A generator that draws the middle: no noise, systematic errors of sign + and factor 1."""

    def choice(self, values, size):
        return np.full(size, 1.0)

    def uniform(self, low, high, size):
        return np.full(size, 0.5 * (low + high))

    def standard_normal(self, size=None):
        return 0.0 if size is None else np.zeros(size)


def middling(preset: str) -> OdometryError:
    return OdometryError(noise_preset(preset), WHEEL_BASE_M, Middling())  # type: ignore[arg-type]


def driven(error: OdometryError, forward_m: float, turn_rad: float, ticks: int) -> tuple[float, float]:
    moves = [error.true_motion(forward_m / ticks, turn_rad / ticks) for _ in range(ticks)]
    forward, turn = np.array(moves).sum(axis=0)
    return float(forward), float(turn)


def test_a_full_turn_is_wrong_by_1_8_degrees_at_a_base_ratio_of_half_a_percent():
    _, turn = driven(middling("paper"), 0.0, FULL_TURN, ticks=90)
    assert math.degrees(turn - FULL_TURN) == pytest.approx(1.8, abs=0.001)


def test_a_metre_straight_on_bends_by_three_quarters_of_a_degree():
    _, turn = driven(middling("paper"), 1.0, 0.0, ticks=50)
    assert math.degrees(turn) == pytest.approx(0.75, abs=0.005)


def test_a_worn_robot_bends_more_and_turns_worse():
    _, turn = driven(middling("worn"), 0.0, FULL_TURN, ticks=90)
    _, bend = driven(middling("worn"), 1.0, 0.0, ticks=50)
    assert math.degrees(turn - FULL_TURN) == pytest.approx(3.6, abs=0.001)
    assert math.degrees(bend) == pytest.approx(math.degrees(0.01 / 1.005 / WHEEL_BASE_M), abs=0.001)


@given(seed=st.integers(0, 2**32 - 1), forward=st.floats(-2.0, 2.0), turn=st.floats(-7.0, 7.0))
def test_an_ideal_robot_does_what_its_odometry_says(seed, forward, turn):
    error = OdometryError(NOISE_PRESETS["ideal"], WHEEL_BASE_M, np.random.default_rng(seed))
    assert error.true_motion(forward, turn) == (forward, turn)


@given(st.integers(0, 2**32 - 1))
def test_systematic_errors_are_half_to_one_and_a_half_times_the_figure(seed):
    error = OdometryError(OdometryNoise(), WHEEL_BASE_M, np.random.default_rng(seed))
    assert 0.5 - 1e-9 <= abs(error.turn_scale - 1.0) / 0.005 <= 1.5 + 1e-9
    bend = error.curvature_rad_m * WHEEL_BASE_M  # 2 (E_d - 1) / (E_d + 1)
    assert 0.5 - 1e-9 <= abs(2.0 * bend / (2.0 - bend)) / 0.003 <= 1.5 + 1e-9


def test_all_four_pairs_of_signs_are_drawn_and_the_magnitude_is_one_on_the_average():
    errors = [OdometryError(OdometryNoise(), WHEEL_BASE_M, np.random.default_rng(s)) for s in range(400)]
    turn = np.array([e.turn_scale - 1.0 for e in errors]) / 0.005
    bend = np.array([e.curvature_rad_m for e in errors]) * WHEEL_BASE_M / 0.003
    pairs, counts = np.unique(np.sign(np.column_stack([turn, bend])), axis=0, return_counts=True)
    assert len(pairs) == 4
    assert counts.min() > 70
    assert np.abs(turn).mean() == pytest.approx(1.0, abs=0.05)
    assert np.abs(bend).mean() == pytest.approx(1.0, abs=0.05)


def test_a_robot_is_wrong_in_the_same_way_all_day():
    noise = OdometryNoise(turn_sigma_rad=0.0, drift_sigma_rad=0.0, distance_sigma_m=0.0)
    error = OdometryError(noise, WHEEL_BASE_M, np.random.default_rng(7))
    assert error.true_motion(0.5, 0.3) == error.true_motion(0.5, 0.3)


@pytest.mark.parametrize("ticks", [1, 10, 100])
def test_the_variance_does_not_depend_on_the_time_step(ticks):
    random_alone = OdometryNoise(wheel_ratio=1.0, base_ratio=1.0)
    error = OdometryError(random_alone, WHEEL_BASE_M, np.random.default_rng(1))
    ends = np.array([driven(error, 1.0, 0.0, ticks) for _ in range(1500)])
    assert ends[:, 0].std() == pytest.approx(0.02, rel=0.08)
    assert math.degrees(ends[:, 1].std()) == pytest.approx(0.5, rel=0.08)
    turns = np.array([driven(error, 0.0, FULL_TURN, ticks) for _ in range(1500)])
    assert math.degrees(turns[:, 1].std()) == pytest.approx(1.0, rel=0.08)
    assert turns[:, 0].std() == 0.0


@settings(max_examples=20)
@given(st.text(min_size=1).filter(lambda name: name not in NOISE_PRESETS))
def test_an_unknown_preset_is_an_error_that_names_the_known_ones(name):
    with pytest.raises(SonarExploreError, match="ideal, paper, worn"):
        noise_preset(name)
