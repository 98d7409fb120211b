"""What every exploration policy promises, as one function for the tests of its author.

A whole test of a policy of yours:

    from sonar_explore.agents.contract import check_policy

    def test_my_policy_keeps_the_contract():
        check_policy(MyPolicy)
"""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from functools import cache

import numpy as np

from sonar_explore.agents import Decision, ExplorationPolicy
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.explorer import Situation


@cache
def situations(world: str = "paper/corridor", seed: int = 0, most: int = 6) -> tuple[Situation, ...]:
    """The first situations of an episode that always takes the first candidate."""
    env = ExplorationEnv(world)
    env.reset(seed=seed)
    met = [env.situation]
    while len(met) < most and not env.end_reason:
        env.step(np.int64(0))
        met.append(env.situation)
    return tuple(s for s in met if s.candidates)


def check_policy(make: Callable[[], ExplorationPolicy]) -> None:
    """Try a policy on real situations.

    Args:
        make: makes a new one, as the command line does; a class that needs no arguments.

    Raises:
        AssertionError: with a sentence that says what it breaks.
    """
    for seed in (0, 1):
        first = _decisions(make(), seed, situations())
        _check(_decisions(make(), seed, situations()) == first, "the seed must fix every decision")
    reused = make()
    _decisions(reused, 1, situations())
    same = _decisions(reused, 0, situations()) == _decisions(make(), 0, situations())
    _check(same, "after reset(seed) a used policy must decide like a new one")


def _decisions(policy: ExplorationPolicy, seed: int, met: tuple[Situation, ...]) -> list[Decision]:
    if hasattr(policy, "reset"):
        policy.reset(seed)
    return [_decision(policy, situation) for situation in met]


def _decision(policy: ExplorationPolicy, situation: Situation) -> Decision:
    shown = copy.deepcopy(situation)
    decision = policy.choose(shown)
    count = len(situation.candidates)
    _check(isinstance(decision, Decision), "choose must return a Decision")
    _check(0 <= decision.chosen < count, f"chose {decision.chosen} of {count} candidates")
    _check(len(decision.scores) == count, f"{len(decision.scores)} scores for {count} candidates")
    _check(bool(np.isfinite([s.total for s in decision.scores]).all()), "scores must be finite")
    _check(_same(shown, situation), "choose must not change the situation")
    return decision


def _check(kept: bool, otherwise: str) -> None:
    if not kept:
        raise AssertionError(otherwise)  # not `assert`: that one is silent under python -O


def _same(a: Situation, b: Situation) -> bool:
    return pickle.dumps(copy.deepcopy(a)) == pickle.dumps(copy.deepcopy(b))
