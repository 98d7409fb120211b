"""The simulated robot: it never ends inside a wall, a touch stops it, and the same seed is the same day."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.envs.load import load_world
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose

RADIUS = SimulatorConfig().robot.radius_m
TICK_M = 0.5 * 0.04


def room(start: Pose, cylinders: list[list[float]] | None = None) -> World:
    walls = [[0, 0, 3, 0], [3, 0, 3, 3], [3, 3, 0, 3], [0, 3, 0, 0], [2, 0, 2, 1], [2, 1, 2.4, 1.3]]
    return World(
        name="room",
        title="A room with a thin wall",
        walls=np.array(walls, dtype=float),
        roughness=np.zeros(len(walls)),
        cylinders=np.array(cylinders or [], dtype=float).reshape(-1, 3),
        start=start,
        has_loop=False,
    )


def robot_in(world: World, noise: str = "ideal", seed: int = 0) -> Simulator:
    return Simulator(world, SimulatorConfig(noise=noise_preset(noise)), np.random.default_rng(seed))


def room_left(robot: Simulator) -> float:
    pose = robot.true_pose
    return float(robot.world.clearance(np.array([[pose.x, pose.y]]))[0])


speeds = st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(-0.9, 0.9), st.integers(1, 80)), max_size=12)


@settings(max_examples=40, deadline=None)
@given(speeds, st.integers(0, 1000), st.sampled_from(["ideal", "worn"]))
def test_a_robot_never_ends_inside_a_wall_or_a_column(moves, seed, noise):
    robot = robot_in(room(Pose(1.0, 1.5, 0.0), [[1.0, 2.3, 0.1]]), noise, seed)
    for speed, turn_rate, ticks in moves:
        for _ in range(ticks):
            robot.tick(speed, turn_rate)
            assert room_left(robot) >= RADIUS - 1e-9


def test_a_touch_stops_the_body_sets_the_bumper_and_is_counted_once():
    robot = robot_in(room(Pose(1.0, 1.5, math.pi)))
    for _ in range(100):
        robot.tick(0.5, 0.0)
    assert RADIUS <= room_left(robot) <= RADIUS + TICK_M
    assert robot.bumper
    assert robot.contacts == 1


def test_the_wheels_stall_at_a_touch_and_the_odometry_knows():
    robot = robot_in(room(Pose(1.0, 1.5, math.pi)))
    for _ in range(100):
        robot.tick(0.5, 0.0)
    assert robot.pose_robot_in_odometry.x == pytest.approx(1.0 - robot.true_pose.x)
    assert robot.driven_m == pytest.approx(1.0 - robot.true_pose.x)


def test_after_a_touch_the_robot_can_back_away_and_the_next_touch_counts_again():
    robot = robot_in(room(Pose(1.0, 1.5, math.pi)))
    for speed in (0.5, -0.3, 0.5):
        for _ in range(60):
            robot.tick(speed, 0.0)
        assert robot.bumper == (speed > 0)
    assert robot.contacts == 2


def test_a_robot_at_a_wall_can_turn_on_the_spot():
    robot = robot_in(room(Pose(1.0, 1.5, math.pi)))
    for _ in range(60):
        robot.tick(0.5, 0.0)
    before = robot.true_pose
    robot.tick(0.0, 0.5)
    assert not robot.bumper
    assert robot.true_pose.heading == pytest.approx(before.heading + 0.5 * 0.04)


def test_speeds_beyond_what_the_robot_can_do_are_cut():
    robot = robot_in(room(Pose(1.0, 1.5, 0.0)))
    robot.tick(9.0, 9.0)
    assert robot.driven_m == pytest.approx(TICK_M)
    assert robot.true_pose.heading == pytest.approx(math.radians(50.0) * 0.04)


def test_one_disc_fires_at_each_tick_and_all_eight_in_turn():
    robot = robot_in(room(Pose(1.0, 1.5, 0.0)))
    silent = robot.config.robot.range_max_m
    robot.ring_m = np.full(8, -1.0)
    for disc in range(8):
        assert robot.ring_m[disc] == -1.0
        robot.tick(0.0, 0.0)
        assert 0.0 < robot.ring_m[disc] <= silent
    assert robot.time_s == pytest.approx(0.32)


def test_without_odometry_error_the_truth_and_the_odometry_are_one():
    start = Pose(1.0, 1.5, 0.7)
    robot = robot_in(room(start))
    for turn_rate in (0.4, -0.8, 0.1):
        for _ in range(20):
            robot.tick(0.1, turn_rate)
        robot.scan(1)
    believed = start @ robot.pose_robot_in_odometry
    assert (believed.x, believed.y, believed.heading) == pytest.approx(
        (robot.true_pose.x, robot.true_pose.y, robot.true_pose.heading)
    )


@pytest.mark.parametrize("direction", [1, -1])
def test_a_scan_is_a_full_turn_of_ninety_readings(direction):
    robot = robot_in(load_world("paper/corridor"))
    before = robot.pose_robot_in_odometry
    scan = robot.scan(direction)
    assert scan.ranges_m.shape == scan.headings_rad.shape == (90,)
    assert math.degrees(scan.headings_rad[1]) == pytest.approx(4.0 * direction)
    assert scan.pose_robot_in_odometry == before
    assert robot.pose_robot_in_odometry.heading - before.heading == pytest.approx(direction * math.tau)
    assert robot.pose_robot_in_odometry.distance_to(before) == 0.0
    assert ((scan.ranges_m > 0.0) & (scan.ranges_m <= 5.0)).all()


def test_a_scan_in_the_middle_of_a_room_measures_its_four_walls():
    walls = room(Pose(1.0, 1.5, 0.0))
    scan = robot_in(walls).scan(1)
    disc = scan.pose_sonar_in_robot
    to_the_west = int(np.argmin(np.abs(scan.headings_rad + disc.heading - math.pi)))
    offset = math.hypot(disc.x, disc.y)
    assert scan.ranges_m[to_the_west] == pytest.approx(1.0 - offset, abs=0.05)


def a_day(robot: Simulator) -> list[float]:
    for _ in range(50):
        robot.tick(0.3, 0.2)
    return [*robot.scan(1).ranges_m, *robot.ring_m, robot.true_pose.x, robot.true_pose.heading]


def test_the_same_seed_is_the_same_day_and_another_seed_is_another():
    world = load_world("paper/rooms")
    assert a_day(robot_in(world, "paper", 3)) == a_day(robot_in(world, "paper", 3))
    assert a_day(robot_in(world, "paper", 3)) != a_day(robot_in(world, "paper", 4))


def test_a_robot_that_is_reset_is_a_new_robot():
    world = load_world("paper/rooms")
    used = robot_in(world, "paper", 1)
    a_day(used)
    used.reset(np.random.default_rng(3))
    assert a_day(used) == a_day(robot_in(world, "paper", 3))


@pytest.mark.parametrize("seed", range(4))
def test_turning_in_one_call_measures_what_single_ticks_do(seed):
    rates = np.random.default_rng(seed).uniform(-2.0, 2.0, 30)
    one_by_one, at_once = (
        Simulator(load_world("paper/rooms"), SimulatorConfig(), np.random.default_rng(seed)) for _ in range(2)
    )
    for robot in (one_by_one, at_once):
        for _ in range(5):
            robot.tick(0.3, 0.4)
    odometry, rings = at_once.turn(rates)
    for k, rate in enumerate(rates.tolist()):
        one_by_one.tick(0.0, rate)
        assert tuple(odometry[k]) == one_by_one.pose_robot_in_odometry.as_row()
        assert (rings[k] == one_by_one.ring_m).all()
    assert at_once.true_pose == one_by_one.true_pose and at_once.true_trail == one_by_one.true_trail
    assert (at_once.time_s, at_once.bumper) == (one_by_one.time_s, one_by_one.bumper)
    for robot in (one_by_one, at_once):
        robot.tick(0.3, 0.0)
    assert at_once.true_pose == one_by_one.true_pose and (at_once.ring_m == one_by_one.ring_m).all()
