"""Both environments keep Gymnasium's promises."""

import copy
import json
import pickle

import gymnasium as gym
import numpy as np
import pytest
from env_runs import continued, trajectory
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import sonar_explore  # noqa: F401 - registers the ids
from sonar_explore.errors import SonarExploreError

IDS = ("sonar_explore/AmigoBot-v0", "sonar_explore/Exploration-v0")
both = pytest.mark.parametrize("name", IDS)
pytestmark = pytest.mark.filterwarnings("error")


@both
@pytest.mark.parametrize("render_mode", [None, "rgb_array", "ansi"])
def test_the_checker_finds_nothing(name, render_mode):
    env = gym.make(f"sonar_explore:{name}", world="paper/corridor", render_mode=render_mode)
    check_env(env.unwrapped)


@both
def test_a_step_before_the_first_reset_says_that_a_reset_is_needed(name):
    env = gym.make(f"sonar_explore:{name}", world="paper/corridor").unwrapped
    with pytest.raises(ResetNeeded, match=r"env\.step\(\) before calling env\.reset\(\)"):
        env.step(env.action_space.sample())


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


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize(
    "name, options",
    [
        (IDS[0], {}),
        *((IDS[1], {"slam": slam}) for slam in ("chain", "smoothed", "truth")),
        (IDS[1], {"world": "generated/home"}),
    ],
)
def test_a_copy_made_in_the_middle_of_an_episode_goes_on_like_the_original(name, options, copied):
    env = gym.make(name, **{"world": "paper/rooms"} | options)
    begun = trajectory(env, 11, 5)
    twin = copied(env)
    by_twin, by_env = (continued(one, begun[-1][0], 5) for one in (twin, env))
    again = gym.make(name, **{"world": "paper/rooms"} | options)
    trajectory(again, 11, 5)
    alone = continued(again, begun[-1][0], 5)
    assert pickle.dumps(by_twin) == pickle.dumps(by_env) == pickle.dumps(alone)


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
def test_every_picture_has_the_same_size_so_that_films_can_be_made_of_them(name):
    env = gym.make(name, world="generated/home", render_mode="rgb_array")
    shapes = set()
    for seed in range(3):
        trajectory(env, seed, 4)
        shapes.add(env.render().shape)
    seen = gym.wrappers.AddRenderObservation(env, render_only=False)
    assert shapes == {seen.observation_space["pixels"].shape}
    assert all(step[0] in seen.observation_space for step in trajectory(seen, 3, 4))


@pytest.mark.parametrize("shape", [(1, 1), (480, 59), (0, 640), (640,), 640])
def test_a_map_that_would_hold_less_than_one_scan_clears_is_refused(shape):
    with pytest.raises(SonarExploreError, match="at least 60 x 60 cells"):
        gym.make("sonar_explore/Exploration-v0", map_shape=shape)


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
def test_a_configuration_that_is_a_dict_is_refused(name):
    with pytest.raises(SonarExploreError, match="config is a dict; give a"):
        gym.make(name, config={})


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
