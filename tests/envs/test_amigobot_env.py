"""AmigoBot-v0: wheel speeds in, echoes and odometry out."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from env_runs import room, trajectory

from sonar_explore.envs.amigobot_env import COUNT_EVERY_M, AmigoBotEnv
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

pytestmark = pytest.mark.filterwarnings("error")


def test_full_speed_ahead_goes_eight_centimetres_a_period():
    env = AmigoBotEnv("paper/corridor", noise="ideal")
    env.reset(seed=0)
    observation, *_ = env.step(np.array([1.0, 0.0], dtype=np.float32))
    assert observation["odometry"] == pytest.approx([0.08, 0.0, 0.0], abs=1e-6)


def test_positive_turns_are_counter_clockwise_and_headings_stay_wrapped():
    env = AmigoBotEnv("paper/corridor", noise="ideal")
    env.reset(seed=0)
    headings = [float(env.step(np.array([0.0, 1.0]))[0]["odometry"][2]) for _ in range(60)]
    assert headings[0] == pytest.approx(np.radians(8.0), abs=1e-6)
    assert max(headings) <= np.pi and min(headings) < 0.0


def test_a_touch_costs_once_sets_the_bumper_and_ends_nothing():
    env = AmigoBotEnv(room(1.5), noise="ideal")
    env.reset(seed=0)
    steps = [env.step(np.array([1.0, 0.0])) for _ in range(12)]
    assert steps[-1][0]["bumper"].tolist() == [1]
    assert steps[-1][4]["contacts"] == 1
    assert sum(reward for _, reward, *_ in steps) == pytest.approx(-1.0, abs=0.1)


def test_the_rewards_of_new_area_add_up_to_the_area_explored():
    env = AmigoBotEnv("paper/corridor", noise="ideal")
    _, info = env.reset(seed=0)
    before = info["truth"]["explored_fraction"]
    total = 0.0
    for _ in range(20):
        _, reward, _, _, info = env.step(np.array([1.0, 0.0]))
        total += reward
    gained = (info["truth"]["explored_fraction"] - before) * env.scorer.reachable_area_m2
    assert gained > 0.5
    assert total + info["contacts"] == pytest.approx(gained)


def test_standing_still_pays_nothing_and_the_area_is_not_counted_before_ten_centimetres():
    env = AmigoBotEnv("paper/corridor", noise="ideal", control_period_s=0.04)
    env.reset(seed=0)
    assert env.step(np.array([0.0, 1.0]))[1] == 0.0
    driven, rewards = 0.0, []
    while driven < COUNT_EVERY_M - 0.025:
        rewards.append(env.step(np.array([1.0, 0.0]))[1])
        driven += 0.02
    assert set(rewards) == {0.0}


def test_a_room_seen_whole_ends_the_episode_as_explored():
    env = AmigoBotEnv(replace(room(4.0), start=Pose(2.0, 1.2, 0.0)), noise="ideal")
    env.reset(seed=0)
    for _ in range(100):
        _, _, terminated, truncated, info = env.step(np.array([1.0, 0.716]))  # a circle of 0.8 m
        if terminated:
            break
    assert terminated and not truncated
    assert info["end_reason"] == "explored"


def test_the_time_limit_truncates():
    env = gym.make("sonar_explore/AmigoBot-v0", world="paper/corridor", max_episode_steps=5)
    assert trajectory(env, 0, 50)[-1][2:4] == (False, True)
    assert gym.spec("sonar_explore/AmigoBot-v0").max_episode_steps == 5000


@pytest.mark.parametrize("period", [0.0, 0.05, -0.04, float("nan")])
def test_a_control_period_that_is_no_multiple_of_the_ping_interval_is_an_error(period):
    with pytest.raises(SonarExploreError, match="multiples"):
        AmigoBotEnv(control_period_s=period)


@pytest.mark.parametrize("action", [[np.nan, 0.0], [1.0], 1.0, [1.0, 0.0, 0.0]])
def test_an_action_that_is_no_pair_of_speeds_is_an_error(action):
    env = AmigoBotEnv()
    env.reset(seed=0)
    with pytest.raises(SonarExploreError, match="no pair of speeds"):
        env.step(np.array(action))


def test_what_the_robot_is_told_does_not_hold_the_truth():
    env = AmigoBotEnv("paper/rooms", noise="worn")
    env.reset(seed=0)
    for _ in range(60):
        observation, _, _, _, info = env.step(np.array([0.3, 0.8]))
    believed = env.world.start @ env.simulator.pose_robot_in_odometry
    assert abs(believed.heading - info["truth"]["pose"][2]) > 1e-3
    assert set(observation) == {"sonar", "odometry", "bumper"}
