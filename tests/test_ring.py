"""The ring scan: every bearing is heard, a fifth of the turn is turned, and a wall is where it is."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonar_explore.amigobot import AmigoBot
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.acoustics import SonarPhysics
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.world import World
from sonar_explore.episodes.run import run_episode
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.mapping.looks import BINS, MappingConfig, look_of
from sonar_explore.reports.episode import episode_page
from sonar_explore.ring import RingPlan
from sonar_explore.slam.features import FeatureConfig, FeatureKind, extract_features

ROBOT = AmigoBot()
GAP = math.radians(70.0)
QUIET = SonarPhysics(sigma_m=0.0, sigma_per_m=0.0, dropout=0.0, temperature_error_k=0.0)
steps = st.floats(2.0, 6.0).map(math.radians)
directions = st.sampled_from([-1, 1])


def robot_before_a_wall(bearing: float, distance: float, heading: float = 0.0) -> Simulator:
    """A wall of 8 m whose normal lies under this bearing from the robot."""
    direction = bearing + heading
    foot = distance * np.array([math.cos(direction), math.sin(direction)])
    along = 4.0 * np.array([-math.sin(direction), math.cos(direction)])
    walls = np.array([[*(foot - along), *(foot + along)]])
    world = World("wall", "A wall", walls, np.zeros(1), np.zeros((0, 3)), Pose(0, 0, heading), False)
    config = SimulatorConfig(sonar=QUIET, noise=noise_preset("ideal"))
    return Simulator(world, config, np.random.default_rng(0))


@given(steps, directions)
def test_every_bearing_is_heard_and_none_by_two(step, direction):
    plan = RingPlan.of(ROBOT, step, direction)
    bearings = plan.headings_rad + plan.mounts[:, 2]
    gaps = np.diff(np.append(bearings, bearings[0] + math.tau))
    assert gaps.min() >= 0.5 * abs(plan.step_rad) - 1e-9
    assert gaps.max() <= 2.0 * abs(plan.step_rad)
    assert gaps.sum() == pytest.approx(math.tau)


@given(steps, directions)
def test_the_turn_is_the_widest_gap_of_the_ring(step, direction):
    plan = RingPlan.of(ROBOT, step, direction)
    assert plan.steps * plan.step_rad == pytest.approx(direction * GAP)
    assert abs(plan.step_rad) <= step + 1e-9


@given(steps, directions)
def test_each_reading_is_taken_by_the_disc_that_sits_where_the_plan_says(step, direction):
    plan = RingPlan.of(ROBOT, step, direction)
    for mount, disc in zip(plan.mounts, plan.disc, strict=True):
        sonar = ROBOT.sonars[disc]
        assert (mount[0], mount[1]) == (sonar.x, sonar.y)
        assert wrap_angle(mount[2] - sonar.heading) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(0.5, 1.8), st.floats(-math.pi, math.pi), directions)
def test_a_wall_under_any_bearing_is_one_wall_where_it_is(bearing, distance, heading, direction):
    scan = robot_before_a_wall(bearing, distance, heading).ring_scan(direction)
    (wall,) = extract_features(scan, FeatureConfig(beam_check=True))
    assert wall.kind is FeatureKind.WALL
    assert wall.range_m == pytest.approx(distance, abs=0.006)
    assert abs(wrap_angle(wall.bearing_rad - bearing)) <= math.radians(3.5)


@settings(max_examples=60, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(0.5, 1.3), directions)
def test_what_it_clears_ends_before_the_wall(bearing, distance, direction):
    scan = robot_before_a_wall(bearing, distance).ring_scan(direction)
    config = MappingConfig()
    look = look_of(scan, extract_features(scan, FeatureConfig()), config)
    bins = (np.arange(BINS) + 0.5) * math.tau / BINS
    across = look.clear_m * np.cos(bins - bearing)
    heard = np.abs(wrap_angle(bins - bearing)) <= math.radians(8.0)
    assert across[heard].max() <= distance


@pytest.mark.parametrize("direction", [-1, 1])
def test_it_takes_less_than_half_the_time_of_a_full_turn_and_a_fifth_of_the_turning(direction):
    ring, turn = (robot_before_a_wall(0.0, 1.0) for _ in range(2))
    ring.ring_scan(direction)
    turn.scan(direction)
    assert ring.pose_robot_in_odometry.heading == pytest.approx(direction * GAP)
    assert ring.true_pose.heading == pytest.approx(direction * GAP)
    assert ring.time_s < 0.5 * turn.time_s


def test_an_episode_of_ring_scans_is_recorded_with_its_discs_and_can_be_reported():
    config = ExplorationConfig(scan="ring", max_scans=4)
    record = run_episode("paper/corridor", seed=1, config=config)
    assert record.steps == run_episode("paper/corridor", seed=1, config=config).steps
    for step in record.steps:
        assert len(step.scan_ring) == len(step.scan_ranges_m)
        assert {disc[:2] for disc in step.scan_ring} == {(sonar.x, sonar.y) for sonar in ROBOT.sonars}
    assert "<svg" in episode_page(record)


def test_an_unknown_kind_of_scan_is_refused_with_those_that_are_known():
    with pytest.raises(SonarExploreError, match="ring, turn"):
        ExplorationConfig(scan="spiral")


def test_smoothed_closes_a_loop_by_walls_where_no_scan_hears_points():
    record = run_episode("paper/loop", slam="smoothed", config=ExplorationConfig(scan="ring"))
    assert record.summary.loop_closed
