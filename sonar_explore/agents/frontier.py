"""The paper's strategy (sections I and III.E, READING section 10) as an explicit score."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sonar_explore.agents.base import Decision, Score
from sonar_explore.explorer import Situation
from sonar_explore.planning.candidates import Candidate


@dataclass(frozen=True)
class FrontierWeights:
    """What a scan position is worth, in metres of travel."""

    area: float = 2.0
    """New area, [per m2], up to `area_enough_m2`: some unassociated features are encouraged."""
    area_enough_m2: float = 1.5
    """More new area than this makes a place no better, [m2]."""
    association: float = 1.5
    """Certainty of the chains that should answer (0 to 2): a scan that can be associated gives no dangling chain."""
    travel: float = 1.0
    """Path length, [per m]."""
    missing_link: float = 3.0
    """Meeting a dangling chain together with a normal one."""
    underway: float = 1.0
    """Going on to where the last leg was going: what looks a little better half-way would send it to and fro."""
    underway_m: float = 0.75
    """A place within this distance of it is as good, [m]."""


class FrontierPolicy:
    """Newest area in reach, where known chains answer; goes to look for the missing link of dangling chains."""

    def __init__(self, weights: FrontierWeights | None = None) -> None:
        self.weights = weights or FrontierWeights()

    def choose(self, situation: Situation) -> Decision:
        """The candidate with the highest score."""
        goal = situation.underway_to or (math.inf, math.inf)
        return Decision.best([self._score(candidate, goal) for candidate in situation.candidates])

    def _score(self, c: Candidate, goal: tuple[float, float]) -> Score:
        w = self.weights
        return Score(
            {
                "new_area": w.area * min(c.new_area_m2, w.area_enough_m2),
                "associations": w.association * c.certainty,
                "travel": -w.travel * c.path_length_m,
                "missing_link": w.missing_link * bool(c.missing_links),
                "underway": w.underway * (math.hypot(c.x - goal[0], c.y - goal[1]) <= w.underway_m),
            }
        )
