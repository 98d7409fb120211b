# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""Walls that the ring is sure of on the way: true ones alone, and no door is shut by them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.planning.driving import Driver, DrivingConfig
from sonar_explore.planning.passing import (
    BESIDE_M,
    FARTHEST_M,
    HALF_LENGTH_M,
    JOINED_M,
    LINE_M,
    SURE_M,
    TURN_RAD,
    _sort_by_wall,
    walls_along,
)

CONFIG = SimulatorConfig(noise=noise_preset("ideal"))
UP = 0.5 * math.pi


def driven_along(walls, way):
    rows = np.array(walls, dtype=float)
    world = World(
        "field",
        "A field",
        rows,
        np.zeros(len(rows)),
        np.zeros((0, 3)),
        Pose(way[0][0], way[0][1], 0.0),
        False,
    )
    robot = Simulator(world, CONFIG, np.random.default_rng(0))
    driver = Driver(robot, CONFIG.robot, lambda: robot.true_pose, lambda: np.zeros((0, 2)), DrivingConfig())
    driver.follow(np.array(way))
    return driver


@pytest.mark.parametrize("beside_m", [0.4, 0.7, 1.0, 1.7, 2.3])
def test_most_of_a_wall_is_sure_once_the_robot_has_driven_along_it(beside_m):
    driver = driven_along([[-1, beside_m, 4, beside_m]], [(0.0, 0.0), (3.0, 0.0)])
    pieces, sure = driver.walls_passed()
    assert np.array_equal(sure, pieces) if beside_m < SURE_M else not len(sure)
    assert np.abs(pieces[:, [1, 3]] - beside_m).max() < 0.05
    low, high = pieces[:, [0, 2]].min(axis=1), pieces[:, [0, 2]].max(axis=1)
    known = np.arange(0.3, 2.7, 0.05)
    covered = ((known[:, None] >= low) & (known[:, None] <= high)).any(axis=1)
    assert covered.mean() > 0.9


@pytest.mark.parametrize("beside_m", [0.6, 0.8, 1.0, 1.4, 1.7, 2.3])
def test_a_door_that_the_robot_drives_past_stays_wide_enough_for_it(beside_m):
    wall, door = 0.1, (1.1, 1.9)
    walls = [
        [-1, beside_m, door[0], beside_m],
        [door[1], beside_m, 4, beside_m],
        [door[0], beside_m, door[0], beside_m + wall],
        [door[1], beside_m, door[1], beside_m + wall],
    ]
    pieces, _ = driven_along(walls, [(0.0, 0.0), (3.0, 0.0)]).walls_passed()
    assert len(pieces)
    along = np.sort(pieces[:, [0, 2]], axis=1)
    left, right = along[along[:, 0] < 1.5], along[along[:, 1] > 1.5]
    assert left[:, 1].max() <= 1.5 - CONFIG.robot.radius_m
    assert right[:, 0].min() >= 1.5 + CONFIG.robot.radius_m


@pytest.mark.parametrize("beside_m", [0.4, 0.8, 1.2, 1.5, 1.8, 2.2])
def test_the_end_of_a_wall_that_points_at_the_way_is_no_wall_beside_it(beside_m):
    driver = driven_along([[1.5, beside_m, 1.5, beside_m + 3.0]], [(0.0, 0.0), (3.0, 0.0)])
    assert not any(map(len, driver.walls_passed()))


AT_A_DOOR = (
    [(0.52, 2.45), (-0.01, 2.1), (0.06, 1.7), (0.57, 1.2)],
    [(0.44, 2.45), (-0.97, 2.1), (0.52, 1.7), (0.03, 1.2)],
    [(-0.48, 2.45), (-0.52, 2.1), (0.78, 1.7), (-0.55, 1.2)],
)


@pytest.mark.parametrize("way", AT_A_DOOR)
def test_two_jambs_that_the_robot_drives_at_look_like_a_wall_but_are_never_a_sure_one(way):
    half, wall = 0.4, 0.12
    walls = [[side * half, y, side * 3.4, y] for side in (-1, 1) for y in (0.0, -wall)]
    walls += [[side * half, 0.0, side * half, -wall] for side in (-1, 1)]
    heard, sure = driven_along(walls, way).walls_passed()
    assert shut(heard, half) and not shut(sure, half)


def shut(pieces, half):
    """Whether a piece of wall stands in the door by more than a jamb may stand in it."""
    low, high = np.sort(pieces[:, [0, 2]], axis=1).T
    across = np.abs(pieces[:, [1, 3]]).max(axis=1, initial=0.0) < 0.2
    room = half - CONFIG.robot.radius_m
    return bool((across & (low < room) & (high > -room)).any())


def edge_heard_within(range_m):
    """Half-angle at which the pattern lets an edge be heard (READING section 2), [rad]."""
    plane_at_1_m = (12.5 / 6.4) ** 2
    return math.radians(6.4) * math.sqrt(max(0.0, plane_at_1_m + math.log(0.1 * range_m**-1.5)))


@settings(max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(0.2, FARTHEST_M), st.floats(0.0, 0.02))
def test_an_edge_is_no_wall_however_often_it_answers(axis, range_m, noise_m):
    rng, spread = np.random.default_rng(0), edge_heard_within(range_m)
    seen_under = axis + np.linspace(-spread, spread, 8)  # the robot passes, the disc looks the same way
    discs = -range_m * np.column_stack([np.cos(seen_under), np.sin(seen_under)])
    heard = range_m + rng.uniform(-noise_m, noise_m, 8)
    feet = discs + heard[:, None] * [math.cos(axis), math.sin(axis)]
    assert len(walls_along(feet, np.full(8, axis))) == 0


@settings(max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_a_piece_of_wall_turns_and_moves_with_its_echoes(turn, x, y):
    feet = np.column_stack([np.linspace(0.0, 1.0, 11), np.full(11, 0.8)])
    (piece,) = walls_along(feet, np.full(11, UP))
    # the outermost echoes may be of its ends: those within are sure
    np.testing.assert_allclose(np.sort(piece[[0, 2]]), [0.2 - HALF_LENGTH_M, 0.8 + HALF_LENGTH_M], atol=1e-9)
    np.testing.assert_allclose(piece[[1, 3]], 0.8)
    pose = Pose(x, y, turn)
    (moved,) = walls_along(pose.transform(feet), np.full(11, UP + turn))
    np.testing.assert_allclose(moved.reshape(2, 2), pose.transform(piece.reshape(2, 2)), atol=1e-6)


def test_what_was_passed_is_forgotten_once_a_scan_was_taken():
    driver = driven_along([[-1, 0.6, 4, 0.6]], [(0.0, 0.0), (2.0, 0.0)])
    assert all(map(len, driver.walls_passed()))
    driver.forget()
    assert not any(map(len, driver.walls_passed()))


def sorted_by_wall(feet, axes):
    """The plain form: all pairs at once."""
    normals = np.column_stack([np.cos(axes), np.sin(axes)])
    off = feet[None] - feet[:, None]
    across = (off * normals[:, None]).sum(axis=2)
    along = off[:, :, 1] * normals[:, None, 0] - off[:, :, 0] * normals[:, None, 1]
    in_line = (np.abs(across) <= LINE_M) & (np.abs(wrap_angle(axes[None] - axes[:, None])) <= TURN_RAD)
    least, most = BESIDE_M
    right, left = (((side >= least) & (side <= most) & in_line).any(axis=1) for side in (along, -along))
    sure = np.flatnonzero(right & left)
    joined = (in_line & (np.abs(along) <= JOINED_M))[np.ix_(sure, sure)]
    _, groups = connected_components(joined, directed=False)
    wall = np.full(len(feet), -1)
    for group in np.unique(groups):
        wall[sure[groups == group]] = sure[groups == group][0]
    return wall


@given(st.integers(0, 80), st.integers(0, 2**32 - 1))
def test_echoes_are_of_one_wall_where_others_between_them_join_them(count, seed):
    rng = np.random.default_rng(seed)
    lines = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.15, 0.15, 3)
    line = rng.integers(0, 3, count)
    axes = lines[1][line] + rng.normal(0.0, 0.05, count)
    feet = np.column_stack([rng.uniform(0.0, 2.5, count), lines[0][line] + rng.normal(0.0, 0.01, count)])
    turn = rng.uniform(-3.0, 3.0)
    feet, axes = Pose(0.3, -0.2, turn).transform(feet), axes + UP + turn
    wall = np.empty(count, dtype=np.int64)
    _sort_by_wall(feet, np.column_stack([np.cos(axes), np.sin(axes)]), axes, *BESIDE_M, wall)
    assert wall.tolist() == sorted_by_wall(feet, axes).tolist()
