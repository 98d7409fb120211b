# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The driver gets there where the way is free, and touches nothing where it is not."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose
from sonar_explore.planning.driving import DriveEnd, Driver, DrivingConfig
from sonar_explore.slam import ChainSlam, SlamConfig

CONFIG = SimulatorConfig(noise=noise_preset("ideal"))
ORIGIN = Pose(0.0, 0.0, 0.0)


def driver_in(walls, start=ORIGIN, points=()):
    rows = np.array(walls, dtype=float).reshape(-1, 4)
    world = World("field", "A field", rows, np.zeros(len(rows)), np.zeros((0, 3)), start, False)
    robot = Simulator(world, CONFIG, np.random.default_rng(0))
    return robot, Driver(
        robot, CONFIG.robot, lambda: robot.true_pose, lambda: np.reshape(points, (-1, 2)), DrivingConfig()
    )


FENCE = [[-4, -4, 4, -4], [4, -4, 4, 4], [4, 4, -4, 4], [-4, 4, -4, -4]]


@pytest.mark.parametrize("heading", [0.0, 1.2, 3.0, -2.0])
def test_the_end_of_a_free_path_is_reached_whichever_way_the_robot_looks(heading):
    robot, driver = driver_in(FENCE, Pose(0.0, 0.0, heading))
    path = np.array([[0.0, 0.0], [1.0, 0.5], [1.2, -0.8], [-0.6, -0.6]])
    report = driver.follow(path)
    assert report.end is DriveEnd.ARRIVED and len(report.obstacle) == 0
    assert robot.true_pose.distance_to(Pose(path[-1, 0], path[-1, 1], 0.0)) <= 2.0 * DrivingConfig().arrived_m
    assert robot.contacts == 0


@pytest.mark.parametrize("angle_deg", range(-75, 80, 5))
def test_a_wall_that_the_map_does_not_know_stops_the_drive_before_a_touch_at_any_slant(angle_deg):
    angle = math.radians(angle_deg)
    turn = Pose(max(1.2, 0.45 / math.cos(angle)), 0.0, angle)
    wall = turn.transform(np.array([[0.0, -6.0], [0.0, 6.0]])).reshape(1, 4)
    robot, driver = driver_in(wall)
    report = driver.follow(np.array([[0.0, 0.0], [2.5, 0.0]]))
    assert report.end is DriveEnd.BLOCKED
    assert robot.contacts == 0 and robot.driven_m > 0.2
    at = robot.true_pose.transform(report.obstacle[[2]])
    assert abs(turn.inverse().transform(at)[0, 0]) < 0.08  # the middle of the piece is on the wall


@pytest.mark.parametrize("angle_deg", [0, 20, 45])
def test_a_drive_begun_at_a_wall_leaves_it(angle_deg):
    robot, driver = driver_in([[0.24, -3, 0.24, 3]], Pose(0.0, 0.0, math.radians(angle_deg)))
    assert driver.follow(np.array([[0.0, 0.0], [-1.0, 0.3]])).end is DriveEnd.ARRIVED
    assert robot.contacts == 0


@pytest.mark.parametrize("width_m", [0.7, 1.0, 1.6])
def test_a_corridor_is_driven_down_its_middle(width_m):
    half = 0.5 * width_m
    robot, driver = driver_in([[-2, half, 6, half], [-2, -half, 6, -half]])
    assert driver.follow(np.array([[0.0, 0.0], [2.5, 0.0]])).end is DriveEnd.ARRIVED
    assert robot.contacts == 0


def test_after_a_scan_what_was_heard_before_no_longer_bars_the_way():
    robot, driver = driver_in([[0.6, -3, 0.6, 3]])
    path = np.array([[0.0, 0.0], [2.0, 0.0]])
    assert driver.follow(path).end is DriveEnd.BLOCKED
    driver.forget()
    before = robot.driven_m
    assert driver.follow(path).end is DriveEnd.BLOCKED
    assert robot.contacts == 0 and robot.driven_m - before < 0.15


def test_turns_in_one_call_are_those_of_single_ticks():
    path = np.array([[0.0, 0.0], [1.0, 0.5], [1.2, -0.8], [-0.6, -0.6]])
    ends = []
    for poses in (None, np.array):  # odometry is believed as it is
        robot, driver = driver_in(FENCE, Pose(0.0, 0.0, 2.0))
        driver._pose, driver._poses = partial(getattr, robot, "pose_robot_in_odometry"), poses
        assert driver.follow(path - path[0]).end is DriveEnd.ARRIVED
        ends.append((robot.true_pose, robot.time_s, robot.ring_m.tolist(), driver._ticks))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("disc", range(8))
def test_a_wall_close_ahead_is_heard_before_the_first_move_whichever_disc_fires_first(disc):
    turn = math.radians(15.0)  # square to a front disc
    wall = Pose(0.23 * math.cos(turn), 0.23 * math.sin(turn), turn).transform(
        np.array([[0.0, -3.0], [0.0, 3.0]])
    )
    robot, driver = driver_in(wall.reshape(1, 4))
    for _ in range(len(CONFIG.robot.sonars) + disc):
        driver._tick(0.0, 0.0)
    driver.forget()  # a scan
    report = driver.follow(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert report.end is DriveEnd.BLOCKED
    assert robot.contacts == 0


@pytest.mark.parametrize("seed", range(8))
def test_a_glance_hears_a_wall_wherever_between_the_axes_its_normal_points(seed):
    bearing = math.radians(41.0 + 49.0 * (seed + 0.5) / 8.0)
    turn = Pose(0.5 * math.cos(bearing), 0.5 * math.sin(bearing), bearing)
    wall = turn.transform(np.array([[0.0, -3.0], [0.0, 3.0]])).reshape(1, 4)
    for first in range(len(CONFIG.robot.sonars)):
        robot, driver = driver_in(wall)
        for _ in range(first):
            driver._tick(0.0, 0.0)
        driver.forget()
        driver._glance()
        assert driver._echoes.in_the_way(Pose(0.0, 0.0, bearing), 0.5, 0.4) is not None
        assert robot.driven_m == 0.0 and abs(robot.true_pose.heading) < 1e-9


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("off_m", [0.333, 0.345, 0.362])
def test_a_wall_that_is_neared_at_a_slant_is_heard_again_before_it_comes_too_near(off_m, side):
    nearest_m = []
    for angle in np.radians(np.arange(15.0, 22.0)):
        start = Pose(0.0, side * off_m, -side * angle)
        robot, driver = driver_in([[-9, 0, 9, 0]], start)
        driver.follow(np.array([[0.0, start.y], [math.cos(angle), start.y - side * math.sin(angle)]]))
        nearest_m.append(abs(robot.true_pose.y))  # where it ends: all the way it comes nearer
    assert min(nearest_m) > CONFIG.robot.radius_m + DrivingConfig().side_m + 0.02


@pytest.mark.parametrize("normal_deg", [55, 60, 65, 70, 75])
def test_a_wall_that_begins_at_a_known_edge_beside_the_way_is_not_touched(normal_deg):
    """From before the edge it sends nothing back, and beyond it its normal lies between the axes of the discs."""
    normal = math.radians(normal_deg)
    for x in np.arange(0.10, 0.31, 0.02):
        for y in (0.22, 0.235, 0.25, 0.265):
            box = Pose(x, y, normal).transform(np.array([[0.0, 0.0], [0.0, -0.5], [0.4, -0.5], [0.4, 0.0]]))
            robot, driver = driver_in(np.hstack([box, np.roll(box, -1, axis=0)]), points=box[0])
            driver.follow(np.array([[0.0, 0.0], [1.2, 0.0]]))
            assert robot.contacts == 0


def test_near_an_edge_the_robot_glances_more_often_and_in_the_open_no_more_than_it_must():
    turned_s = []
    for y in (0.30, 0.36, 0.9):
        robot, driver = driver_in([[0.4, y, 0.4, 3.0]], points=[0.4, y])
        assert driver.follow(np.array([[0.0, 0.0], [1.1, 0.0]])).end is DriveEnd.ARRIVED
        turned_s.append(robot.time_s - robot.driven_m / DrivingConfig().speed_m_s)
    once_s = 4.0 * DrivingConfig().glance_rad / CONFIG.robot.turn_rate_max_rad_s
    assert turned_s[0] > turned_s[1] > turned_s[2] > 3 * once_s


class TickByTick:
    """A robot that cannot steer itself."""

    def __init__(self, robot):
        self._robot = robot

    def __getattr__(self, name):
        if name == "drive_leg":
            raise AttributeError(name)
        return getattr(self._robot, name)


def believing_driver(robot, slam):
    return Driver(
        robot,
        CONFIG.robot,
        lambda: slam.predict(robot.pose_robot_in_odometry),
        lambda: np.array([[0.5, 0.5]]),
        DrivingConfig(),
        slam.predict_along,
        lambda: slam.belief,
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_a_robot_that_steers_itself_drives_hears_and_believes_as_one_that_is_steered(seed):
    rng = np.random.default_rng(seed)
    ends, walls = rng.uniform(-2.0, 2.0, (4, 2)), FENCE
    if rng.random() < 0.7:
        walls = [*FENCE, *np.hstack([ends, ends + rng.uniform(-0.8, 0.8, (4, 2))]).tolist()]
    path = np.vstack([[0.0, 0.0], rng.uniform(-1.5, 1.5, (3, 2))])
    found = []
    for own in (True, False):
        world = World(
            "field", "A field", np.array(walls), np.zeros(len(walls)), np.zeros((0, 3)), ORIGIN, False
        )
        simulator = Simulator(world, SimulatorConfig(), np.random.default_rng(seed))
        slam = ChainSlam(ORIGIN, SlamConfig.robust())
        driver = believing_driver(simulator if own else TickByTick(simulator), slam)
        reports = [driver.follow(path) for _ in range(2)]
        slam._filter._spread()
        found.append(
            (
                [(r.end, r.obstacle.tolist()) for r in reports],
                (simulator.true_pose, simulator.pose_robot_in_odometry, simulator.ring_m.tolist()),
                (simulator.time_s, simulator.driven_m, simulator.contacts, simulator.bumper),
                (simulator.true_trail, simulator._next_disc, simulator._rng.bit_generator.state),
                (slam.pose, slam._filter.covariance.tolist()),
                (
                    driver._echoes._pieces[: driver._echoes._count].tolist(),
                    driver._ticks,
                    driver._since_glance,
                ),
            )
        )
    assert found[0] == found[1]
