"""The plug-in point: a policy is a class with one method.

    class Mine:
        \"""Goes to the nearest candidate.\"""

        def choose(self, situation: Situation) -> Decision:
            scores = tuple(Score({"travel": -c.path_length_m}) for c in situation.candidates)
            return Decision.best(scores)

Use it with `--agent my_module:Mine`, or give it a name through the entry-point group `sonar_explore.agents`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sonar_explore.explorer import Situation


@dataclass(frozen=True)
class Score:
    """Why a candidate is worth going to."""

    terms: dict[str, float]
    """The weighted terms by name."""

    @property
    def total(self) -> float:
        """Sum of the terms."""
        return sum(self.terms.values())


@dataclass(frozen=True)
class Decision:
    """The choice, with the score of every candidate."""

    chosen: int
    """Index into `situation.candidates`."""
    scores: tuple[Score, ...]
    """One for each candidate, in their order."""

    @staticmethod
    def best(scores: Sequence[Score]) -> Decision:
        """The highest score; the earliest candidate among equals."""
        totals = np.array([score.total for score in scores])
        return Decision(int(np.argmax(totals)), tuple(scores))


class ExplorationPolicy(Protocol):
    """Chooses the next scan position.

    A class that is named on the command line is made as `Policy()`. If it has a method `reset(seed: int)`, it
    is called before each episode; randomness must come from that seed alone.
    """

    def choose(self, situation: Situation) -> Decision:
        """Choose one of `situation.candidates`, of which there is at least one; must not change the situation."""
        ...
