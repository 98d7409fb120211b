"""Run one episode: an environment, a policy, a record."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from sonar_explore import __version__
from sonar_explore.agents import Decision, ExplorationPolicy, make_agent
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.odometry import noise_name
from sonar_explore.envs.world import World
from sonar_explore.episodes.record import EpisodeRecord, StepRecord
from sonar_explore.episodes.recording import EpisodeLog, chain_record, grid_record, world_record
from sonar_explore.errors import SonarExploreError
from sonar_explore.explorer import Situation
from sonar_explore.geometry import Pose
from sonar_explore.replay.log import Recorder

MAX_SEED = 2**32 - 1


def run_episode(
    world: str | Path | World,
    agent: str | ExplorationPolicy = "frontier",
    slam: str = "chain",
    noise: str | None = "paper",
    seed: int = 0,
    *,
    config: ExplorationConfig | None = None,
    on_step: Callable[[StepRecord], None] = lambda step: None,
    recorder: Recorder | None = None,
) -> EpisodeRecord:
    """Explore a world once.

    Args:
        world: a name, a file, or a world; a generator such as `generated/office` draws the world by the seed.
        agent: a known name, `module:Name`, or a policy.
        slam: one of `sonar_explore.slam.SLAMS`.
        noise: odometry preset: `paper`, `ideal` or `worn`; None takes the configuration's own.
        seed: fixes everything but the wall time.
        config: every other choice.
        on_step: called with each step as it is made.
        recorder: notes down what the robot measures, for a replay.

    Raises:
        SonarExploreError: for an unknown name, a bad world, or a policy that chooses what is not there.
    """
    if not 0 <= seed <= MAX_SEED:
        raise SonarExploreError(f"seed {seed} is out of range; possible: 0 to {MAX_SEED}")
    began = time.perf_counter()
    policy = make_agent(agent) if isinstance(agent, str) else agent
    env = ExplorationEnv(world, slam, noise, config)
    env.overhear = recorder.of if recorder is not None else env.overhear
    env.reset(seed=seed)
    if hasattr(policy, "reset"):
        policy.reset(seed)
    log = EpisodeLog(env)
    while not env.end_reason:
        situation, decision = env.situation, _chosen(policy, env.situation)
        env.step(np.int64(decision.chosen))
        on_step(log.step(situation, decision))
    on_step(log.step(env.situation, None))
    names = {
        "agent": agent if isinstance(agent, str) else type(policy).__name__,
        "slam": slam,
        "noise": noise_name(env.config.simulator.noise) if noise is None else noise,
    }
    if recorder is not None:
        about = f"{env.world.name}, seed {seed}, noise {names['noise']}"
        recorder.close(about, env.world.start, [Pose(*step.true_pose) for step in log.steps])
    summary = log.summary(seed=seed, wall_time_s=round(time.perf_counter() - began, 3), **names)
    return EpisodeRecord(
        version=__version__,
        config=msgspec.to_builtins(env.config),
        world=world_record(env.world),
        summary=summary,
        steps=log.steps,
        chains=[chain_record(chain) for chain in env.situation.chains],
        grid=grid_record(env.situation.grid),
    )


def _chosen(policy: ExplorationPolicy, situation: Situation) -> Decision:
    """What the policy chooses, once it is seen to be a choice; where it raises, the line of it that did."""
    try:
        decision = policy.choose(situation)
    except SonarExploreError:
        raise
    except Exception as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        raise SonarExploreError(
            f"the agent's choose failed at {at.filename} line {at.lineno}: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(decision, Decision):
        raise SonarExploreError(f"the agent's choose returned {decision!r}; it must return a Decision")
    n = len(situation.candidates)
    if not 0 <= decision.chosen < n or len(decision.scores) != n:
        raise SonarExploreError(
            f"the agent chose candidate {decision.chosen} with {len(decision.scores)} scores; there are {n} candidates"
        )
    if not all(math.isfinite(term) for score in decision.scores for term in score.terms.values()):
        raise SonarExploreError("the agent gave a score that is no number; every term must be finite")
    return decision
