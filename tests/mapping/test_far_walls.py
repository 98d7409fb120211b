# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Walls beyond the reliable range: where they are heard they stand, and no nearer ones are among them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose
from sonar_explore.mapping.far_walls import HALF_LENGTH_M, far_walls
from sonar_explore.slam import SlamConfig

CONFIG, SLAM = SimulatorConfig(noise=noise_preset("ideal")), SlamConfig.robust()
RELIABLE_M = SLAM.features.range_max_m
ALONE = replace(SLAM, agreement=replace(SLAM.agreement, enabled=False))


def scanned(walls, heading=0.0):
    rows = np.array(walls, dtype=float)
    at = Pose(0.0, 0.0, heading)
    world = World("field", "A field", rows, np.zeros(len(rows)), np.zeros((0, 3)), at, False)
    return Simulator(world, CONFIG, np.random.default_rng(0)).scan(1)


@settings(max_examples=25, deadline=None)
@given(st.floats(RELIABLE_M + 0.1, 3.4), st.floats(-3.1, 3.1))
def test_what_is_known_of_a_wall_far_off_lies_about_the_foot_of_its_normal(away_m, heading):
    for piece in far_walls(scanned([[-4.0, away_m, 4.0, away_m]], heading), SLAM, 3.5):
        ends = Pose(0.0, 0.0, heading).transform(piece.reshape(2, 2))
        assert np.abs(ends[:, 1] - away_m).max() < 0.05
        assert np.abs(ends[:, 0]).max() < HALF_LENGTH_M + 0.1
        assert np.hypot(*(ends[1] - ends[0])) == pytest.approx(2.0 * HALF_LENGTH_M)


def test_most_walls_up_to_three_metres_off_are_known_wherever_the_robot_looks():
    scans = [
        scanned([[-4.0, away_m, 4.0, away_m]], heading)
        for away_m in np.linspace(RELIABLE_M + 0.1, 3.0, 6)
        for heading in np.linspace(-3.0, 3.0, 8)
    ]
    assert np.mean([len(far_walls(scan, SLAM, 3.5)) == 1 for scan in scans]) > 0.8


@pytest.mark.parametrize("heading", [0.0, 0.3])
def test_one_disc_alone_is_asked_where_there_is_no_other(heading):
    (piece,) = far_walls(scanned([[-4.0, 3.0, 4.0, 3.0]], heading), ALONE, 3.5)
    ends = Pose(0.0, 0.0, heading).transform(piece.reshape(2, 2))
    assert np.abs(ends[:, 1] - 3.0).max() < 0.05 and np.abs(ends[:, 0]).max() < HALF_LENGTH_M + 0.1


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.5, 4.5), min_size=4, max_size=4))
def test_in_a_room_they_are_walls_of_that_room_beyond_the_reliable_range(sides):
    right, top, left, bottom = sides
    left, bottom = -left, -bottom
    room = [[left, bottom, right, bottom], [right, bottom, right, top]]
    room += [[right, top, left, top], [left, top, left, bottom]]
    pieces = far_walls(scanned(room), SLAM, 3.5)
    feet = 0.5 * (pieces[:, :2] + pieces[:, 2:])
    assert (np.hypot(*feet.T) > RELIABLE_M).all() and (np.hypot(*feet.T) < 3.6).all()
    x, y = feet.T
    off = np.min([np.abs(x - left), np.abs(x - right), np.abs(y - bottom), np.abs(y - top)], axis=0)
    assert (off < 0.15).all()


def test_nothing_is_heard_of_what_is_near_or_where_nobody_asks():
    near, far = [-4.0, 1.5, 4.0, 1.5], [-4.0, -3.0, 4.0, -3.0]
    assert len(far_walls(scanned([near]), SLAM, 3.5)) == 0
    assert len(far_walls(scanned([near, far]), SLAM, 3.5)) == 1
    assert far_walls(scanned([near, far]), SLAM, RELIABLE_M).shape == (0, 4)


@pytest.mark.parametrize("away_m", [2.2, 2.6, 3.2])
def test_the_end_of_a_wall_from_far_off_is_none(away_m):
    assert len(far_walls(scanned([[away_m, 0.0, away_m + 3.0, 0.0]]), SLAM, 3.5)) == 0
