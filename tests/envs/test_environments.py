"""Both environments keep Gymnasium's promises."""

import json
import pickle
import warnings
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import sonar_explore  # noqa: F401 - registers the ids
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.amigobot_env import COUNT_EVERY_M, AmigoBotEnv
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

IDS = ("sonar_explore/AmigoBot-v0", "sonar_explore/Exploration-v0")
both = pytest.mark.parametrize("name", IDS)


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def chosen(env: gym.Env, observation: dict) -> object:
    """A random action, one that the mask allows where there is one."""
    return env.action_space.sample(observation.get("action_mask"))


def trajectory(env: gym.Env, seed: int | None, steps: int) -> list:
    observation, info = env.reset(seed=seed)
    env.action_space.seed(5)
    out: list[tuple] = [(observation, info)]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(chosen(env, observation))
        out.append((observation, reward, terminated, truncated, info))
        if terminated or truncated:
            break
    return out


def room(side_m: float) -> World:
    corners = np.array([[0, 0], [side_m, 0], [side_m, side_m], [0, side_m], [0, 0]], dtype=float)
    return World(
        name="room",
        title="An empty room",
        walls=np.hstack([corners[:-1], corners[1:]]),
        roughness=np.zeros(4),
        cylinders=np.zeros((0, 3)),
        start=Pose(side_m / 2, side_m / 2, 0.0),
        has_loop=False,
    )


# --- both ------------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize("render_mode", [None, "rgb_array", "ansi"])
def test_the_checker_finds_nothing(name, render_mode):
    env = gym.make(f"sonar_explore:{name}", world="paper/corridor", render_mode=render_mode)
    check_env(env.unwrapped)


@both
def test_two_instances_with_one_seed_make_one_trajectory(name):
    first, second = (trajectory(gym.make(name, world="paper/corridor"), 11, 6) for _ in range(2))
    assert pickle.dumps(first) == pickle.dumps(second)


@both
def test_another_seed_makes_another_trajectory(name):
    env = gym.make(name, world="paper/corridor")
    assert pickle.dumps(trajectory(env, 1, 3)) != pickle.dumps(trajectory(env, 2, 3))


@both
def test_no_seed_goes_on_with_the_generator_instead_of_starting_it_again(name):
    env = gym.make(name, world="paper/corridor")
    first, second = trajectory(env, 3, 2), trajectory(env, None, 2)
    assert pickle.dumps(first) != pickle.dumps(second)
    assert pickle.dumps([trajectory(env, 3, 2), trajectory(env, None, 2)]) == pickle.dumps([first, second])


@both
def test_info_has_the_same_keys_and_types_from_reset_and_from_every_step(name):
    def shape(info: dict) -> dict:
        return {
            key: shape(value) if isinstance(value, dict) else (type(value), getattr(value, "dtype", None))
            for key, value in info.items()
        }

    steps = trajectory(gym.make(name, world="paper/corridor"), 0, 4)
    for step in steps[1:]:
        assert shape(step[-1]) == shape(steps[0][-1])


@both
def test_no_array_is_handed_out_twice(name):
    steps = trajectory(gym.make(name, world="paper/corridor"), 0, 3)
    before = pickle.dumps(steps[:-1])
    for value in steps[-1][0].values():
        value[...] = 0
    assert pickle.dumps(steps[:-1]) == before


@both
def test_the_specification_travels_as_json(name):
    env = gym.make(name, world="paper/bend", noise="worn")
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.world.name == "paper/bend"
    json.loads(env.spec.to_json())


@both
@pytest.mark.parametrize("vector", [gym.vector.SyncVectorEnv, gym.vector.AsyncVectorEnv])
def test_two_side_by_side_give_what_each_gives_alone(name, vector):
    def make() -> gym.Env:
        return gym.make(f"sonar_explore:{name}", world="paper/corridor")

    envs = vector([make, make])
    try:
        observations, _ = envs.reset(seed=[4, 5])
        actions = np.zeros_like(envs.action_space.sample())
        stepped, *_ = envs.step(actions)
    finally:
        envs.close()
    alone = make()
    for i, seed in enumerate((4, 5)):
        expected, _ = alone.reset(seed=seed)
        after, *_ = alone.step(actions[i])
        for key in expected:
            np.testing.assert_array_equal(observations[key][i], expected[key])
            np.testing.assert_array_equal(stepped[key][i], after[key])


@both
def test_pictures_show_something_and_text_shows_the_robot(name):
    picture = gym.make(name, world="paper/corridor", render_mode="rgb_array")
    picture.reset(seed=0)
    first = picture.render()
    assert first.dtype == np.uint8
    assert len(np.unique(first.reshape(-1, 3), axis=0)) >= 3
    text = gym.make(name, world="paper/corridor", render_mode="ansi")
    text.reset(seed=0)
    assert text.render().count("R") == 1


@both
def test_a_generator_is_a_new_building_at_each_reset_and_a_numbered_one_stays(name):
    def met(world: str, seeds: list[int | None]) -> list[str]:
        env = gym.make(name, world=world)
        observations = [env.reset(seed=seed) for seed in seeds]
        assert all(env.observation_space.contains(observation) for observation, _ in observations)
        return [info["truth"]["world"] for _, info in observations]

    drawn = met("generated/hall?difficulty=0.2", [7, None, None, 7])
    assert len(set(drawn)) == 3 and drawn[3] == drawn[0]
    assert set(met("generated/hall-3", [7, None])) == {"generated/hall-3"}


@both
def test_a_drawn_building_comes_back_by_its_name_and_is_scored_as_itself(name):
    drawn = gym.make(name, world="generated/home?difficulty=0.1").unwrapped
    _, info = drawn.reset(seed=3)
    again = gym.make(name, world=info["truth"]["world"]).unwrapped
    np.testing.assert_array_equal(again.world.walls, drawn.world.walls)
    assert again.scorer.reachable_area_m2 == drawn.scorer.reachable_area_m2
    assert drawn.simulator.world is drawn.world is drawn.scorer.world


@both
def test_the_checker_finds_nothing_where_worlds_are_drawn(name):
    check_env(gym.make(f"sonar_explore:{name}", world="generated/hall?difficulty=0").unwrapped)


@both
def test_an_unknown_world_is_an_error_that_names_the_known_ones(name):
    with pytest.raises(SonarExploreError, match="paper/corridor"):
        gym.make(name, world="paper/moon")


@both
def test_the_docstring_is_the_page(name):
    page = gym.make(name).unwrapped.__doc__
    for section in (
        *("Description", "Action Space", "Observation Space", "Rewards", "Starting State"),
        *("Episode End", "Information", "Arguments", "Version History"),
    ):
        assert f"## {section}\n" in page


# --- AmigoBot-v0 -----------------------------------------------------------------------------------------


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


def test_a_speed_that_is_no_number_is_an_error():
    env = AmigoBotEnv()
    env.reset(seed=0)
    with pytest.raises(SonarExploreError):
        env.step(np.array([np.nan, 0.0]))


def test_what_the_robot_is_told_does_not_hold_the_truth():
    env = AmigoBotEnv("paper/rooms", noise="worn")
    env.reset(seed=0)
    for _ in range(60):
        observation, _, _, _, info = env.step(np.array([0.3, 0.8]))
    believed = env.world.start @ env.simulator.pose_robot_in_odometry
    assert abs(believed.heading - info["truth"]["pose"][2]) > 1e-3
    assert set(observation) == {"sonar", "odometry", "bumper"}


# --- Exploration-v0 --------------------------------------------------------------------------------------


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


def test_fewer_actions_than_candidates_could_need_is_an_error():
    with pytest.raises(SonarExploreError, match="max_candidates"):
        ExplorationEnv(max_candidates=3)
