"""Whether a loop was closed: the robot has driven round, and then met the walls of its first scan again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonar_explore.envs.room import LEAST_BLOCK_M2
from sonar_explore.episodes.record import StepRecord
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.mapping.regions import enclosed_blocks
from sonar_explore.planning.loops import went_round


def loop_closed(scorer: Scorer, steps: Sequence[StepRecord]) -> bool:
    """Whether, once the true path has gone all the way round a block, a chain of the first scan was met again.

    Met again: associated in the final link graph, or merged.
    """
    first_chains = set(steps[0].new_chains)
    for step in steps[_driven_round(scorer, steps) :]:
        if any(a.kept and a.chain in first_chains for a in step.associations):
            return True
        if any(chain in first_chains for merge in step.merges for chain in merge):
            return True
    return False


def _driven_round(scorer: Scorer, steps: Sequence[StepRecord]) -> int:
    """Index of the first step at which a block has been driven round; len(steps) if never."""
    way = [(*pose[:2], step.index) for step in steps for pose in [*step.true_trail, step.true_pose]]
    blocks = enclosed_blocks(scorer.reachable, scorer.origin, scorer.resolution_m, LEAST_BLOCK_M2)
    round_at = went_round(np.array(way)[:, :2], blocks)
    return len(steps) if round_at is None else way[round_at][2]
