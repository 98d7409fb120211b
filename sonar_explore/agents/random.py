"""Any candidate, by chance: the floor that a policy must beat."""

from __future__ import annotations

import numpy as np

from sonar_explore.agents.base import Decision, Score
from sonar_explore.explorer import Situation


class RandomPolicy:
    """Goes to a random candidate; the seed of the episode fixes which."""

    def __init__(self) -> None:
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Begin an episode."""
        self._rng = np.random.default_rng(seed)

    def choose(self, situation: Situation) -> Decision:
        """Uniform over the candidates."""
        draws = self._rng.random(len(situation.candidates))
        return Decision.best([Score({"chance": float(d)}) for d in draws])
