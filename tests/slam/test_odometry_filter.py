# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The filter learns what is wrong with the wheels, and knows what they cannot have done."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.odometry_filter import FilterConfig, OdometryFilter
from sonar_explore.slam.residuals import Residuals

WALLS = np.array([0.0, 0.5, 1.0, 1.5]) * math.pi  # bearings of the normals of a room's walls, map frame
NORMALS = np.column_stack([np.cos(WALLS), np.sin(WALLS)])
ON = FilterConfig(enabled=True)


def residuals(adr_rad, ndr_m, normals=NORMALS):
    n = len(normals)
    adr, ndr = np.broadcast_to(adr_rad, n).astype(float), np.broadcast_to(ndr_m, n).astype(float)
    return Residuals(adr, ndr, normals, ndr, normals, np.ones(n), np.ones(n), np.ones(n))


def seen(true, believed, turn_error_left, spin, rng):
    """What the four walls say to a belief, with the noise that the filter expects, and the sweeps."""
    sweeps = spin * ((WALLS - true.heading) * spin % math.tau)
    off = np.array([believed.x - true.x, believed.y - true.y])
    adr = true.heading - believed.heading + sweeps * turn_error_left + rng.normal(0, ON.bearing_rad, 4)
    return residuals(adr, NORMALS @ off + rng.normal(0, ON.normal_m, 4)), sweeps


def learned(seed, turn_error, bend, steps=25):
    """Drive about a room with these wheels and correct at each scan."""
    rng, belief = np.random.default_rng(seed), OdometryFilter(ON)
    true = believed = odometry = Pose(0.0, 0.0, 0.0)
    for i in range(steps):
        spin = -1 if i % 2 else 1
        seen_now, sweeps = seen(true, believed, turn_error - belief.turn_error, spin, rng)
        believed = belief.corrected(believed, seen_now, sweeps)
        turns = spin * math.tau, rng.uniform(-2, 2)
        for forward, turn in [(0.0, turns[0] + turns[1])] + [(0.05, 0.0)] * 16:
            wrong = turn * (1 + turn_error) + forward * bend
            slip = rng.normal(0, math.sqrt(ON.turn_rad**2 * abs(turn) / math.tau + ON.drift_rad**2 * forward))
            after = odometry @ Pose(forward, 0.0, turn)
            believed = belief.moved(believed, odometry, after)
            odometry, true = after, true @ Pose(forward, 0.0, wrong + slip)
    return belief, believed, true


@pytest.mark.parametrize("turn_error", [-0.012, 0.012])
@pytest.mark.parametrize("bend_deg", [-1.5, 1.5])
def test_both_constants_of_the_wheels_are_learned(turn_error, bend_deg):
    runs = [learned(seed, turn_error, math.radians(bend_deg))[0] for seed in range(4)]
    assert np.mean([r.turn_error for r in runs]) == pytest.approx(turn_error, abs=0.003)
    assert np.mean([r.bend_rad_m for r in runs]) == pytest.approx(
        math.radians(bend_deg), abs=math.radians(0.5)
    )
    for r in runs:
        assert abs(r.turn_error - turn_error) < 4.0 * math.sqrt(r.covariance[3, 3]) + 0.001
        assert r.covariance[3, 3] < (0.5 * ON.turn_error) ** 2


def test_what_is_impossible_is_gated_and_what_is_likely_is_not():
    belief, *_ = learned(0, 0.005, 0.01, steps=6)
    assert belief.believable(residuals(math.radians(1.0), 0.01)).all()
    assert not belief.believable(residuals(math.radians(25.0), 0.0)).any()
    assert not belief.believable(residuals(0.0, 0.6)).any()


def test_the_believable_are_as_many_of_the_true_ones_as_is_said():
    """What is off by as much as the covariance says, angle and distance together, after a drive that joins them."""
    belief, here = OdometryFilter(ON), Pose(0.0, 0.0, 0.0)
    for _ in range(20):
        here = belief.moved(here, Pose(0.0, 0.0, 0.0), Pose(0.1, 0.0, 0.0))
    belief.believable(residuals(0.0, 0.0))
    rng, n = np.random.default_rng(0), 4000
    off = rng.multivariate_normal(np.zeros(6), belief.covariance, n)
    normals = np.tile([0.0, 1.0], (n, 1))
    angle = off[:, 2] + rng.normal(0.0, math.hypot(ON.bearing_rad, ON.bearing_least_rad), n)
    across = off[:, 1] + rng.normal(0.0, ON.normal_m, n)
    together = belief.believable(residuals(angle, -across, normals))
    assert together.mean() == pytest.approx(ON.gate_share, abs=0.003)
    contrary = belief.believable(residuals(-angle, -across, normals))
    assert contrary.mean() < 0.98


def test_a_wall_that_meets_one_line_well_is_not_of_the_next_that_it_meets_badly():
    """Two sides of a bay, 10 degrees apart: by heading alone the wall may be of either after a drive."""
    belief, here = OdometryFilter(ON), Pose(0.0, 0.0, 0.0)
    for _ in range(40):
        here = belief.moved(here, Pose(0.0, 0.0, 0.0), Pose(0.1, 0.0, 0.0))
    ahead = np.tile([1.0, 0.0], (3, 1))
    two = residuals(np.radians([0.5, 10.0, 10.0]), 0.0, ahead)
    assert belief.believable(two).all()
    assert belief.believable(two, None, np.array([0, 0, 1])).tolist() == [True, False, True]
    alike = residuals(np.radians([3.0, -3.0]), 0.0, ahead[:2])
    assert belief.believable(
        alike, None, np.array([0, 0])
    ).all()  # either may be it: the two lines may be one


@settings(deadline=None, max_examples=30)
@given(st.floats(0.1, 3.0), st.floats(-3.0, 3.0))
def test_the_farther_the_drive_the_more_is_believed(distance, heading):
    belief = OdometryFilter(ON)
    here, gates = Pose(0.0, 0.0, heading), []
    for _ in range(3):
        gates.append([np.count_nonzero(belief.believable(residuals(0.0, d))) for d in (0.1, 0.2, 0.4)])
        after = here @ Pose(distance, 0.0, 0.0)
        belief.moved(here, here, after)
        here = after
    assert (np.diff(gates, axis=0) >= 0).all()
    assert np.linalg.eigvalsh(belief.covariance).min() > -1e-12


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000))
def test_a_correction_moves_the_belief_towards_the_truth_and_never_past_it(seed):
    rng = np.random.default_rng(seed)
    belief, start = OdometryFilter(ON), Pose(0.0, 0.0, 0.0)
    here = belief.moved(start, start, Pose(1.0, 0.0, 0.0))
    true = Pose(here.x + rng.normal(0, 0.05), here.y + rng.normal(0, 0.05), rng.normal(0, 0.03))
    off = np.array([here.x - true.x, here.y - true.y])
    exact = residuals(wrap_angle(true.heading - here.heading), NORMALS @ off)
    after = belief.corrected(here, exact, np.zeros(4))
    assert after.distance_to(true) <= here.distance_to(true) + 1e-9


def test_a_filter_that_is_off_composes_odometry_and_believes_everything():
    off, a, b = OdometryFilter(FilterConfig()), Pose(1.0, 2.0, 0.3), Pose(1.4, 2.1, 0.9)
    assert off.moved(Pose(0, 0, 0), a, b) == Pose(0, 0, 0) @ (a.inverse() @ b)
    assert off.believable(residuals(1.0, 5.0)).all()


def test_no_association_no_correction():
    here = Pose(0.3, 0.2, 0.1)
    none = residuals(0.0, 0.0, np.zeros((0, 2)))
    assert OdometryFilter(ON).corrected(here, none, np.zeros(0)) == here


@settings(deadline=None)
@given(
    st.booleans(),
    st.floats(-7, 7),
    st.lists(
        st.tuples(st.sampled_from([0.0, 0.0, 0.004, -0.03]), st.floats(-0.1, 0.1)), min_size=1, max_size=60
    ),
)
def test_a_belief_carried_along_in_one_call_is_that_of_single_bits(enabled, scan_turn, motions):
    readings = [Pose(0.3, -0.2, 1.0)]
    for forward, turn in motions:
        readings.append(readings[-1] @ Pose(forward, 0.0, turn))
    found = []
    for together in (True, False):
        belief = OdometryFilter(FilterConfig(enabled=enabled))
        belief.turn_error, belief.bend_rad_m, belief.own_error = 0.01, 0.02, -0.003
        belief._own_left_rad = scan_turn
        poses = [Pose(1.0, 2.0, 0.5)]
        if together:
            along = np.array([reading.as_row() for reading in readings[1:]])
            poses += [Pose(*row) for row in belief.moved_along(poses[0], readings[0], along).tolist()]
        else:
            for before, after in pairwise(readings):
                poses.append(belief.moved(poses[-1], before, after))
        belief._spread()
        found.append((poses, belief.covariance.tolist(), belief._own_left_rad))
    assert found[0] == found[1]
