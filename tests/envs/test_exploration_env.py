"""Exploration-v0: the next scan position in, map and candidates out."""

import gymnasium as gym
import numpy as np
import pytest
from env_runs import room, trajectory
from gymnasium.error import ResetNeeded

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.errors import SonarExploreError
from sonar_explore.explorer import MIN_FRONTIER_M
from sonar_explore.mapping.frontiers import find_frontiers
from sonar_explore.mapping.occupancy import OccupancyGrid

pytestmark = pytest.mark.filterwarnings("error")


def test_random_allowed_decisions_end_for_a_stated_reason():
    env = gym.make(
        "sonar_explore/Exploration-v0", world="paper/corridor", config=ExplorationConfig(max_scans=15)
    )
    end = trajectory(env, 1, 100)[-1]
    assert end[2] != end[3]
    assert end[4]["end_reason"] in {"explored", "stuck"} if end[2] else {"scan_limit"}
    assert end[4]["end_reason"]


def test_the_scan_limit_truncates_and_says_so():
    env = gym.make("sonar_explore/Exploration-v0", config=ExplorationConfig(max_scans=3))
    steps = trajectory(env, 0, 10)
    assert len(steps) == 3
    assert steps[-1][2:4] == (False, True)
    assert steps[-1][4]["end_reason"] == "scan_limit"


def test_the_number_of_scans_can_be_given_without_a_configuration():
    env = gym.make("sonar_explore/Exploration-v0", world="paper/corridor", max_scans=2)
    assert trajectory(env, 0, 10)[-1][4]["end_reason"] == "scan_limit"
    assert env.unwrapped.config.max_scans == 2
    with pytest.raises(SonarExploreError, match="at least 1"):
        ExplorationEnv("paper/corridor", max_scans=0)


def test_the_mask_is_told_three_times_the_same():
    env = ExplorationEnv("paper/corridor")
    observation, info = env.reset(seed=0)
    np.testing.assert_array_equal(observation["action_mask"], info["action_mask"])
    np.testing.assert_array_equal(observation["action_mask"], env.action_masks())
    assert observation["action_mask"].sum() == len(env.situation.candidates)


@pytest.mark.parametrize("method", ["action_masks", "render"])
def test_nothing_is_told_before_the_first_reset(method):
    env = ExplorationEnv("paper/corridor", render_mode="ansi")
    with pytest.raises(ResetNeeded, match=method):
        getattr(env, method)()


def test_a_decision_that_is_not_offered_is_an_error():
    env = ExplorationEnv("paper/corridor")
    env.reset(seed=0)
    with pytest.raises(SonarExploreError, match="not possible"):
        env.step(np.int64(31 if len(env.situation.candidates) < 32 else 32))


def test_where_nothing_is_left_after_the_first_scan_one_action_is_possible_and_ends_the_episode():
    env = ExplorationEnv(room(0.9), noise="ideal")
    observation, info = env.reset(seed=0)
    assert not env.situation.candidates
    assert observation["action_mask"].tolist()[:2] == [1, 0]
    _, reward, terminated, truncated, info = env.step(np.int64(0))
    assert (reward, terminated, truncated, info["end_reason"]) == (0.0, True, False, "explored")


def test_no_more_candidates_are_offered_than_there_are_actions():
    few = ExplorationEnv("paper/corridor", max_candidates=3)
    all_ = ExplorationEnv("paper/corridor")
    assert len(few.observation_space["candidates"].low) == few.action_space.n == 3
    for env in (few, all_):
        env.reset(seed=0)
    assert len(all_.situation.candidates) > 3
    assert few.situation.candidates == all_.situation.candidates[:3]


@pytest.mark.parametrize("size", ["max_candidates", "max_chains"])
def test_an_observation_has_room_for_one_of_each_at_least(size):
    with pytest.raises(SonarExploreError, match=f"{size} is 0; at least 1"):
        ExplorationEnv(**{size: 0})


def test_frontiers_of_a_situation_are_those_of_its_map_whenever_they_are_asked_for():
    env = ExplorationEnv("paper/corridor")
    env.reset(seed=0)
    early, seen = env.situation, []
    for _ in range(4):
        seen.append(env.situation)
        env.step(np.int64(0))
    for situation in (seen[-1], early, *seen):
        grid = OccupancyGrid(situation.grid.frame, situation.grid.states)
        alone = find_frontiers(grid, env.config.simulator.robot.radius_m, MIN_FRONTIER_M)
        assert [f.centroid for f in situation.frontiers] == [f.centroid for f in alone]
    assert early.frontiers
