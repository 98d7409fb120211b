"""The nearest frontier (Yamauchi 1997): the usual yardstick."""

from __future__ import annotations

from sonar_explore.agents.base import Decision, Score
from sonar_explore.explorer import Situation


class NearestPolicy:
    """Goes to the candidate with the shortest path, whatever it shows."""

    def choose(self, situation: Situation) -> Decision:
        """The shortest path."""
        return Decision.best([Score({"travel": -c.path_length_m}) for c in situation.candidates])
