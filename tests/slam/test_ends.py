# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""An end hidden by something nearer is put where the beam pattern says it would be."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.beam import Beam
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.ends import Ends, neighbours
from sonar_explore.slam.rcd import regions_of_constant_depth

JUMP_M = 0.10
BEAM = Beam()
STEP_RAD = math.radians(4.0)
bearings, ranges = st.floats(-3.0, 3.0), st.floats(0.4, 2.0)


def heard(bearing, range_m, half_rad, hidden_rad=0.0, side=1, spin=1):
    """The region of a source and its ends, where something nearer hides its last bit on one side."""
    headings = spin * np.arange(90) * STEP_RAD
    off = side * wrap_angle(headings - bearing)
    readings = np.full(90, 5.0)
    readings[np.abs(off) <= half_rad] = range_m
    if hidden_rad:
        readings[(off > half_rad - hidden_rad) & (off < half_rad + 0.2)] = 0.25
    scan = Scan(Pose(0, 0, 0), headings, readings, Pose(0, 0, 0), 5.0)
    (region,) = (r for r in regions_of_constant_depth(scan, 0.03) if abs(r.echo_m - range_m) < 1e-6)
    return region, Ends.of(region, scan, JUMP_M)


@settings(deadline=None)
@given(bearings, ranges, st.sampled_from([-1, 1]))
def test_a_plane_in_the_open_is_as_wide_as_a_plane_and_stays_where_it_is(bearing, range_m, spin):
    region, ends = heard(bearing, range_m, BEAM.plane_half_angle_rad(range_m), spin=spin)
    assert not ends.first_hidden and not ends.last_hidden
    assert ends.step_rad == pytest.approx(STEP_RAD)
    assert ends.like_a_plane(region)
    assert ends.centred(region) == region


@settings(deadline=None)
@given(bearings, st.floats(0.8, 1.8))
def test_an_edge_is_too_narrow_for_a_plane(bearing, range_m):
    region, ends = heard(bearing, range_m, BEAM.edge_half_angle_rad(range_m))
    assert not ends.like_a_plane(region)


@settings(deadline=None)
@given(bearings, ranges)
def test_two_things_that_touch_are_too_wide_for_a_plane(bearing, range_m):
    region, ends = heard(bearing, range_m, 1.6 * BEAM.plane_half_angle_rad(range_m))
    assert not ends.like_a_plane(region)


@settings(deadline=None)
@given(bearings, ranges, st.floats(0.02, 0.2), st.sampled_from([-1, 1]), st.sampled_from([-1, 1]))
def test_a_hidden_end_is_restored_to_within_a_step(bearing, range_m, hidden_rad, side, spin):
    region, ends = heard(bearing, range_m, BEAM.plane_half_angle_rad(range_m), hidden_rad, side, spin)
    if not (ends.first_hidden or ends.last_hidden):
        return  # nothing lay on the lattice where it was hidden
    assert ends.last_hidden == (side > 0) and ends.first_hidden == (side < 0)
    restored = ends.centred(region)
    assert abs(wrap_angle(restored.bearing_rad - bearing)) <= 0.5 * STEP_RAD + 1e-9
    kept = "first_rad" if side > 0 else "last_rad"
    assert getattr(restored, kept) == getattr(region, kept)


def test_on_average_the_restored_normal_is_several_times_better():
    rng = np.random.default_rng(0)
    cut, restored = [], []
    for _ in range(200):
        bearing, range_m = rng.uniform(-3, 3), rng.uniform(0.5, 2.0)
        region, ends = heard(bearing, range_m, BEAM.plane_half_angle_rad(range_m), 0.18, rng.choice([-1, 1]))
        cut.append(wrap_angle(region.bearing_rad - bearing))
        restored.append(wrap_angle(ends.centred(region).bearing_rad - bearing))
    assert np.abs(restored).mean() < 0.3 * np.abs(cut).mean()
    assert abs(np.mean(restored)) < math.radians(0.3)


def test_hidden_at_both_ends_says_nothing_about_the_middle():
    region, _ = heard(0.5, 1.0, BEAM.plane_half_angle_rad(1.0))
    assert Ends(True, True, STEP_RAD, 2.0 * STEP_RAD).centred(region) == region


@given(st.integers(3, 90), st.integers(0, 89), st.integers(2, 8), st.sampled_from([-1, 1]))
def test_the_neighbours_of_a_run_are_the_readings_just_outside_it(n, start, length, way):
    if length + 2 > n:
        return
    run = [(start + way * k) % n for k in range(length + 2)]
    assert neighbours(run[1:-1], n) == (run[0], run[-1])
