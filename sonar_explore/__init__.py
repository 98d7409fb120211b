"""sonar_explore: a robot with nothing but sonar explores an unknown building."""

from __future__ import annotations

from gymnasium.envs.registration import register

__version__ = "0.1.0"

register(
    "sonar_explore/AmigoBot-v0",
    entry_point="sonar_explore.envs.amigobot_env:AmigoBotEnv",
    max_episode_steps=5000,
)
register(
    "sonar_explore/Exploration-v0",
    entry_point="sonar_explore.envs.exploration_env:ExplorationEnv",
    vector_entry_point="sonar_explore.envs.vector:exploration",
)
