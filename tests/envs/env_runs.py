"""Runs of an environment, as the tests of the environments make them."""

import gymnasium as gym
import numpy as np

from sonar_explore.envs.world import World
from sonar_explore.geometry import Pose


def chosen(env: gym.Env, observation: dict) -> object:
    """A random action, one that the mask allows where there is one."""
    return env.action_space.sample(observation.get("action_mask"))


def trajectory(env: gym.Env, seed: int | None, steps: int) -> list:
    observation, info = env.reset(seed=seed)
    env.action_space.seed(5)
    return [(observation, info), *continued(env, observation, steps)]


def continued(env: gym.Env, observation: dict, steps: int) -> list:
    """So many more steps, or up to the end."""
    out: list[tuple] = []
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
