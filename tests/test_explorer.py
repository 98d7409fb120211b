# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""The robot's mind: it maps a log as it maps what it drives, goes far in legs, and puts aside what it cannot reach."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
import shapely

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.simulator import Simulator
from sonar_explore.envs.world import World
from sonar_explore.explorer import Explorer
from sonar_explore.geometry import Pose
from sonar_explore.mapping.grid import FREE, OCCUPIED, GridFrame
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.candidates import Candidate
from sonar_explore.planning.driving import DriveEnd
from sonar_explore.planning.paths import PlanningConfig, SafePaths
from sonar_explore.planning.surroundings import Surroundings
from sonar_explore.slam import make_slam

CONFIG = ExplorationConfig().with_noise("ideal")
WALLS = np.array([[-1, 0.8, 9, 0.8], [-1, -0.8, 9, -0.8], [-1, -0.8, -1, 0.8]], dtype=float)
CORRIDOR = World("corridor", "", WALLS, np.zeros(3), np.zeros((0, 3)), Pose(0, 0, 0), False)


class Parked:
    """A robot that has nothing but its odometry: nobody may drive it or ask it for a scan."""

    pose_robot_in_odometry = Pose(0.0, 0.0, 0.0)

    def __getattr__(self, name):
        raise AssertionError(f"the robot was asked for {name}")


class Stuck:
    """A robot whose every step ends in a touch."""

    bumper = True
    drive_leg = None

    def __init__(self, robot):
        self._robot = robot

    def __getattr__(self, name):
        return getattr(self._robot, name)

    def tick(self, speed_m_s, turn_rate_rad_s):
        self._robot.tick(0.0, turn_rate_rad_s)


def explorer_in(config=CONFIG, wrap=lambda robot: robot):
    robot = Simulator(CORRIDOR, config.simulator, np.random.default_rng(0))
    return robot, Explorer(wrap(robot), make_slam("chain", Pose(0, 0, 0), config.slam), config)


def place(x, y):
    return Candidate(x, y, 1.0, 1.0, (), 0.0, ())


def wall_on_the_map(length_rows):
    """A free field of 4 m by 4 m, and a wall across it from below at x = 2 m."""
    states = np.full((80, 80), FREE, dtype=np.uint8)
    states[:length_rows, 40] = OCCUPIED
    return SafePaths(
        OccupancyGrid(GridFrame(0.0, 0.0, 0.05, (80, 80)), states), 1.0, 1.0, 0.18, PlanningConfig()
    )


@pytest.mark.parametrize(("length_rows", "round_it"), [(25, True), (70, False), (80, False)])
def test_a_place_behind_a_doubted_wall_is_driven_to_round_the_wall_unless_that_is_much_longer(
    length_rows, round_it
):
    _, explorer = explorer_in()
    surroundings = explorer._surroundings
    maps = {False: wall_on_the_map(length_rows), True: wall_on_the_map(0)}
    surroundings.paths_as_far_as = lambda pose, way_m: maps[surroundings.doubtful]
    surroundings.doubtful = surroundings.daring = True
    candidate = Candidate(3.0, 1.0, 2.0, 2.0, (), 0.0, ())
    way = explorer._way(Pose(1.0, 1.0, 0.0), candidate)
    assert way is not None and (way[:, 1].max() > 1.3) == round_it
    assert surroundings.doubtful and surroundings.daring


def farthest(situation):
    return max(situation.candidates, key=lambda c: c.x)


def driven_down(metres):
    robot, explorer = explorer_in()
    explorer.look()
    for _ in range(12):
        explorer.go_to(farthest(explorer.situation()))
        explorer.look()
        if robot.true_pose.x > metres:
            return robot, explorer
    raise AssertionError(f"only {robot.true_pose.x:.2f} m in 12 drives")


def test_a_log_is_mapped_without_a_robot_that_drives():
    robot = Simulator(CORRIDOR, CONFIG.simulator, np.random.default_rng(1))
    scans = []
    for _ in range(3):
        scans.append(robot.scan(1))
        for _ in range(50):
            robot.tick(0.3, 0.0)
    explorer = Explorer(Parked(), make_slam("chain", Pose(0, 0, 0), CONFIG.slam), CONFIG)
    updates = [explorer.observe(scan) for scan in scans]
    assert [u.index for u in updates] == [0, 1, 2]
    assert updates[-1].pose.x == pytest.approx(1.2, abs=0.05)
    assert all(explorer.grid.states[explorer.grid.frame.cell(u.pose.x, u.pose.y)] == FREE for u in updates)


def test_looking_and_reading_the_same_scans_from_a_log_draw_the_same_map():
    _, explorer = explorer_in(replace(CONFIG, alternate_spin=False))
    explorer.look()
    again = Explorer(Parked(), make_slam("chain", Pose(0, 0, 0), CONFIG.slam), CONFIG)
    twin = Simulator(CORRIDOR, CONFIG.simulator, np.random.default_rng(0))
    again.observe(twin.scan(1))
    assert explorer.grid.frame == again.grid.frame
    assert (explorer.grid.states == again.grid.states).all()


def test_scans_turn_left_and_right_in_turn():
    robot, explorer = explorer_in()
    headings = []
    for _ in range(4):
        explorer.look()
        headings.append(robot.pose_robot_in_odometry.heading)
    assert np.sign(np.diff([0.0, *headings])).tolist() == [1, -1, 1, -1]


def turns_in_a_hall(y, **options):
    """By how much each of three scans turned the robot, [deg], so far up or down in a hall of 20 m."""
    walls = np.array(
        [[-10, -10, 10, -10], [10, -10, 10, 10], [10, 10, -10, 10], [-10, 10, -10, -10]], dtype=float
    )
    hall = World("hall", "", walls, np.zeros(4), np.zeros((0, 3)), Pose(0, y, 0), False)
    config = replace(CONFIG, **options)
    robot = Simulator(hall, config.simulator, np.random.default_rng(0))
    explorer = Explorer(robot, make_slam("chain", Pose(0, y, 0), config.slam), config)
    headings = [robot.pose_robot_in_odometry.heading]
    for _ in range(3):
        explorer.look()
        headings.append(robot.pose_robot_in_odometry.heading)
    return np.degrees(np.abs(np.diff(headings))).round().tolist()


def test_where_a_scan_heard_nothing_in_the_middle_of_a_hall_the_next_ones_are_ring_scans():
    assert turns_in_a_hall(0.0) == [360, 70, 70]


def test_beside_a_wall_of_the_hall_all_scans_are_full_turns():
    assert turns_in_a_hall(8.5) == [360, 360, 360]


def test_without_ring_scans_in_the_open_all_scans_are_full_turns():
    assert turns_in_a_hall(0.0, ring_in_the_open=False) == [360, 360, 360]


def test_a_long_way_is_driven_in_legs():
    robot, explorer = driven_down(4.5)
    leg = CONFIG.planning.leg_m
    ends, touches = [], robot.contacts
    for _ in range(8):
        before = robot.driven_m
        ends.append(explorer.go_to(place(0.0, 0.0)).end)
        assert robot.driven_m - before <= 1.5 * leg + 0.3
        explorer.look()
        goal = (0.0, 0.0) if ends[-1] is DriveEnd.UNDERWAY else None
        assert explorer.situation().underway_to == goal
        if ends[-1] is DriveEnd.ARRIVED:
            break
    assert ends[-1] is DriveEnd.ARRIVED and len(ends) >= 3
    assert set(ends[:-1]) == {DriveEnd.UNDERWAY}
    assert robot.true_pose.distance_to(Pose(0, 0, 0)) < 0.15
    assert robot.contacts == touches == 0


@pytest.mark.parametrize(("wall_m", "stop_m"), [(1.0, 1.5), (4.5, 2.7), (9.0, 4.5)])
def test_a_leg_ends_where_a_scan_hears_a_wall_or_after_three_where_none_would(wall_m, stop_m):
    _, explorer = explorer_in()
    states = np.full((100, 200), FREE, dtype=np.uint8)
    states[:, round(wall_m / 0.05)] = OCCUPIED
    states[45:55, round(wall_m / 0.05)] = FREE  # a door
    explorer._surroundings._grids[False, False] = OccupancyGrid(
        GridFrame(0.0, 0.0, 0.05, states.shape), states
    )
    leg = explorer._first_leg(np.array([[0.0, 2.5], [9.9, 2.5]]))
    assert leg[-1] == pytest.approx([stop_m, 2.5], abs=0.3)


def test_a_place_that_cannot_be_got_to_is_put_aside():
    _, explorer = explorer_in(wrap=Stuck)
    explorer.look()
    chosen = farthest(explorer.situation())
    trip = explorer.go_to(chosen)
    assert trip.end in (DriveEnd.BUMPED, DriveEnd.BLOCKED)
    for c in explorer.situation().candidates:
        assert np.hypot(c.x - chosen.x, c.y - chosen.y) >= CONFIG.candidates.apart_m


def test_a_place_off_the_map_is_no_way_and_moves_nothing():
    robot, explorer = explorer_in()
    explorer.look()
    assert explorer.go_to(place(50.0, 50.0)).end is DriveEnd.BLOCKED
    assert robot.driven_m == 0.0


def test_when_nothing_is_left_it_stays_so_and_the_map_is_the_believed_one():
    walls = np.array([[-1, 1, 1.2, 1], [-1, -1, 1.2, -1], [-1, -1, -1, 1], [1.2, -1, 1.2, 1]], dtype=float)
    robot = Simulator(
        World("room", "", walls, np.zeros(4), np.zeros((0, 3)), Pose(0, 0, 0), False),
        CONFIG.simulator,
        np.random.default_rng(0),
    )
    explorer = Explorer(robot, make_slam("chain", Pose(0, 0, 0), CONFIG.slam), CONFIG)
    explorer.look()
    for _ in range(60):
        mapped = explorer.grid
        situation = explorer.situation()
        if not situation.candidates:
            break
        explorer.go_to(situation.candidates[0])
        explorer.look()
    assert not situation.candidates
    again = explorer.situation()
    assert not again.candidates
    assert (again.grid.states == situation.grid.states).all()
    assert again.grid.occupied.sum() > 0.9 * mapped.occupied.sum()  # a doubted map has half as many


def test_a_known_pose_is_believed_at_once():
    robot = Simulator(CORRIDOR, CONFIG.simulator, np.random.default_rng(0))
    told = Pose(1.0, 2.0, 0.5)
    slam = make_slam("truth", told, CONFIG.slam)
    explorer = Explorer(robot, slam, CONFIG, known_pose=lambda: told)
    assert explorer.look().pose == told and explorer.pose() == told


def test_an_explorer_that_nobody_needs_goes_at_once():
    gc.collect()
    gc.disable()
    try:
        _, explorer = explorer_in()
        explorer.look()
        explorer.go_to(farthest(explorer.situation()))
        gone = weakref.ref(explorer)
        del explorer
        assert gone() is None
    finally:
        gc.enable()


def test_the_map_of_the_last_scans_alone_has_no_wall_and_no_room_of_those_before():
    config = replace(CONFIG, slam=replace(CONFIG.slam, odometry=replace(CONFIG.slam.odometry, enabled=False)))
    robot = Simulator(CORRIDOR, config.simulator, np.random.default_rng(0))
    slam = make_slam("chain", Pose(0, 0, 0), config.slam)
    surroundings = Surroundings(slam, config)
    for x in (0.0, 6.0):
        slam.place(Pose(x, 0.0, 0.0))
        robot.true_pose = Pose(x, 0.0, 0.0)
        scan = robot.scan(1)
        surroundings.add_scan(scan, slam.update(scan).features)
    whole = surroundings.grid
    surroundings.first_scan = 1
    lately, at = surroundings.grid, surroundings.scan_positions
    assert at.tolist() == [[6.0, 0.0]]
    assert whole.free[whole.frame.cell(0.0, 0.0)] and whole.occupied[whole.frame.cell(0.0, 0.8)]
    assert lately.free[lately.frame.cell(6.0, 0.0)] and lately.frame.x0 > 1.0
    assert surroundings.whole_grid is whole and len(surroundings.all_scan_positions) == 2
    surroundings.first_scan = 0
    assert surroundings.grid is whole


def test_what_is_hearsay_shuts_nothing_once_it_is_not_believed_until_the_next_scan():
    _, explorer = explorer_in()
    explorer.look()
    surroundings = explorer._surroundings
    across, sure = np.array([[0.7, -0.8, 0.7, 0.8]]), np.array([[-0.7, -0.8, -0.7, 0.8]])
    open_m2 = surroundings.free_m2
    surroundings.add_passed(np.vstack([across, sure]), sure)
    surroundings.believe_hearsay(False)
    less_m2 = surroundings.free_m2
    surroundings.believe_hearsay(True)
    assert surroundings.free_m2 < less_m2 < open_m2
    surroundings.believe_hearsay(False)
    assert surroundings.has_hearsay
    explorer.look()
    assert surroundings.hearsay


def test_walls_heard_from_near_by_alone_are_no_hearsay():
    _, explorer = explorer_in()
    explorer.look()
    surroundings, walls = explorer._surroundings, np.array([[0.7, -0.8, 0.7, 0.8]])
    surroundings.add_passed(walls, walls)
    assert not surroundings.has_hearsay
    surroundings.add_passed(walls, walls[:0])
    assert surroundings.has_hearsay
    surroundings.add_passed(walls, walls)
    assert surroundings.has_hearsay


def test_who_decides_sees_the_whole_map_while_the_last_scans_alone_lead_the_way():
    _, explorer = explorer_in()
    for _ in range(2):
        explorer.look()
        explorer.go_to(farthest(explorer.situation()))
    explorer.look()

    def lately(pose):
        explorer._surroundings.first_scan = 2
        return ()

    explorer._offers.now = lately
    seen = explorer.situation()
    assert len(seen.scan_positions) == 3 and explorer._surroundings.grid.frame != seen.grid.frame


def test_what_lies_inside_lies_so_far_from_where_what_is_known_ends():
    _, explorer = explorer_in()
    explorer.look()
    for by_m, is_inside in (0.6, True), (0.9, False):
        assert shapely.contains_xy(explorer._surroundings.inside(by_m), 0.0, 0.0) == is_inside
    assert not shapely.contains_xy(explorer._surroundings.inside(0.0), 0.0, 1.8)
