"""Every shipped policy keeps the contract, and policies of others are found."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sonar_explore.agents import Decision, Score, known_agents, make_agent
from sonar_explore.agents.contract import check_policy, situations
from sonar_explore.agents.frontier import FrontierPolicy, FrontierWeights
from sonar_explore.agents.nearest import NearestPolicy
from sonar_explore.agents.random import RandomPolicy
from sonar_explore.errors import SonarExploreError
from sonar_explore.explorer import Situation


class Farthest:
    """Goes where the way is longest: what an author writes in a file of their own."""

    def choose(self, situation: Situation) -> Decision:
        return Decision.best([Score({"travel": c.path_length_m}) for c in situation.candidates])


class NoPolicy:
    """Cannot choose."""


def of(*changes: dict) -> Situation:
    """A situation with these candidates, else like a real one."""
    some = situations()[0]
    return replace(some, candidates=tuple(replace(some.candidates[0], **change) for change in changes))


def plain(**change: object) -> dict:
    return {"path_length_m": 1.0, "new_area_m2": 1.0, "certainty": 1.0, "missing_links": (), **change}


@pytest.mark.parametrize("name", sorted(known_agents()))
def test_every_installed_policy_keeps_the_contract(name):
    check_policy(lambda: make_agent(name))


def test_a_policy_of_somebody_else_keeps_it_too():
    check_policy(Farthest)


class Outside(Farthest):
    def choose(self, situation: Situation) -> Decision:
        return replace(super().choose(situation), chosen=len(situation.candidates))


class Mumbling(Farthest):
    def choose(self, situation: Situation) -> Decision:
        return replace(super().choose(situation), scores=())


class Moody(Farthest):
    generator = np.random.default_rng(0)

    def choose(self, situation: Situation) -> Decision:
        return Decision.best([Score({"mood": float(self.generator.random())}) for _ in situation.candidates])


class Vandal(Farthest):
    def choose(self, situation: Situation) -> Decision:
        situation.grid.states[0, 0] ^= 1
        return super().choose(situation)


@pytest.mark.parametrize(
    ("policy", "sentence"),
    [
        (Outside, "chose"),
        (Mumbling, "0 scores"),
        (Moody, "seed must fix"),
        (Vandal, "must not change"),
    ],
)
def test_the_contract_catches_a_policy_that_breaks_it(policy: Callable, sentence: str):
    with pytest.raises(AssertionError, match=sentence):
        check_policy(policy)


def test_the_best_of_equals_is_the_first():
    assert Decision.best([Score({"a": 1.0}), Score({"a": 2.0}), Score({"a": 1.5, "b": 0.5})]).chosen == 1


def test_a_score_is_the_sum_of_its_terms():
    assert Score({"area": 2.0, "travel": -0.5}).total == 1.5


def test_nearest_goes_to_the_nearest():
    situation = of(plain(path_length_m=3.0), plain(path_length_m=0.5), plain(path_length_m=1.0))
    assert NearestPolicy().choose(situation).chosen == 1


def test_frontier_prefers_new_area_up_to_enough_of_it():
    policy = FrontierPolicy()
    assert policy.choose(of(plain(new_area_m2=0.2), plain(new_area_m2=1.0))).chosen == 1
    assert policy.choose(of(plain(new_area_m2=2.0), plain(new_area_m2=9.0))).chosen == 0


def test_frontier_prefers_places_where_known_chains_answer():
    assert FrontierPolicy().choose(of(plain(certainty=0.0), plain(certainty=2.0))).chosen == 1


def test_frontier_goes_some_way_for_a_missing_link_but_not_any_way():
    policy = FrontierPolicy(FrontierWeights(missing_link=3.0, travel=1.0))
    near = plain(path_length_m=1.0)
    assert policy.choose(of(near, plain(path_length_m=3.5, missing_links=(4,)))).chosen == 1
    assert policy.choose(of(near, plain(path_length_m=4.5, missing_links=(4,)))).chosen == 0


def test_frontier_goes_on_to_where_it_was_going_unless_something_is_clearly_better():
    policy = FrontierPolicy(FrontierWeights(underway=1.0, travel=1.0))
    there, here = plain(x=5.0, y=0.0, path_length_m=3.0), plain(x=0.0, y=0.0, path_length_m=2.5)
    assert policy.choose(of(there, here)).chosen == 1
    assert policy.choose(replace(of(there, here), underway_to=(5.2, 0.1))).chosen == 0
    near = plain(x=0.0, y=0.0, path_length_m=1.0)
    assert policy.choose(replace(of(there, near), underway_to=(5.2, 0.1))).chosen == 1


def test_random_takes_every_candidate_sooner_or_later():
    policy, situation = RandomPolicy(), of(plain(), plain(), plain())
    assert {policy.choose(situation).chosen for _ in range(50)} == {0, 1, 2}


def test_the_shipped_policies_are_known_by_name_and_say_what_they_do():
    assert {"frontier", "nearest", "random"} <= set(known_agents())
    assert all(line.endswith(".") for line in known_agents().values())


def test_a_policy_is_found_by_module_and_name():
    assert isinstance(make_agent(f"{__name__}:Farthest"), Farthest)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("frontire", "did you mean .frontier.*or module:Name"),
        ("nowhere_to_be_found:Policy", "cannot be loaded"),
        (f"{__name__}:Missing", "cannot be loaded"),
        (f"{__name__}:NoPolicy", "no method choose"),
        (":", "cannot be loaded: no names of a module and a class; give module:Name"),
        ("my-module:Policy", "cannot be loaded: no names of a module and a class; give module:Name"),
        ("json:dumps", "cannot be made: .* missing 1 required"),
        ("json:__name__", "cannot be made: .* not callable"),
    ],
)
def test_a_name_that_is_no_policy_is_one_line_that_helps(name, words):
    with pytest.raises(SonarExploreError, match=words):
        make_agent(name)
