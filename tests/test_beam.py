# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The beam pattern that robot and simulator share: READING's figures, and what the simulator makes of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.beam import S_RAD, THRESHOLD, Beam
from sonar_explore.envs.acoustics import SonarPhysics, echoes
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose

BEAM = Beam()
PLANES = {0.5: 13.6, 1.0: 12.5, 2.0: 11.3, 5.0: 9.5}
EDGES = {0.5: 10.2, 1.0: 7.9, 2.0: 4.4, 3.0: 0.0}


@pytest.mark.parametrize("range_m", PLANES)
def test_a_plane_is_heard_as_widely_as_reading_says(range_m):
    assert math.degrees(BEAM.plane_half_angle_rad(range_m)) == pytest.approx(PLANES[range_m], abs=0.06)


@pytest.mark.parametrize("range_m", EDGES)
def test_an_edge_is_heard_as_widely_as_reading_says(range_m):
    assert math.degrees(BEAM.edge_half_angle_rad(range_m)) == pytest.approx(EDGES[range_m], abs=0.06)


@settings(deadline=None)
@given(st.floats(0.01, 100.0))
def test_at_the_half_angle_the_amplitude_is_just_the_threshold(on_axis):
    half = BEAM.half_angle_rad(on_axis)
    if on_axis <= THRESHOLD:
        assert half == 0.0
    else:
        assert on_axis * math.exp(-((half / S_RAD) ** 2)) == pytest.approx(THRESHOLD)


@settings(deadline=None)
@given(st.floats(0.15, 5.0), st.floats(0.15, 5.0))
def test_what_is_farther_is_heard_less_widely_and_an_edge_less_than_a_plane(a, b):
    near, far = sorted((a, b))
    for half_angle in (BEAM.plane_half_angle_rad, BEAM.edge_half_angle_rad):
        assert half_angle(far) <= half_angle(near)
    assert BEAM.edge_half_angle_rad(far) < BEAM.plane_half_angle_rad(far)


@pytest.mark.parametrize("beam", [BEAM, Beam(0.2, 0.2), Beam(0.43, 0.19)])
@pytest.mark.parametrize("range_m", PLANES)
def test_the_simulator_hears_a_plane_just_inside_the_half_angle_and_not_just_outside(range_m, beam):
    wall = np.array([[range_m, -30.0, range_m, 30.0]])
    world = World("plane", "A plane", wall, np.zeros(1), np.zeros((0, 3)), Pose(0.0, 0.0, 0.0), False)
    sonar = SonarPhysics(beam=beam)
    half, little = beam.plane_half_angle_rad(range_m), math.radians(0.1)
    discs = np.array([[0.0, 0.0, side * (half + off)] for off in (-little, little) for side in (-1, 1)])
    heard, _ = echoes(Scene.of(world, sonar.range_max_m), discs, sonar)
    assert heard[:2] == pytest.approx(range_m)
    assert (heard[2:] > range_m + 1e-6).all() or range_m == 5.0
