"""Whether a loop was closed: the robot has driven round, and then met the walls of its first scan again."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import ndimage
from skimage.measure import label, regionprops

from sonar_explore.episodes.record import StepRecord
from sonar_explore.episodes.scoring import Scorer

LEAST_BLOCK_M2 = 1.0
"""A pillar is no loop: what the way leads round has at least this area, [m2]."""


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
    x, y, index = _true_path(steps)
    ends = [len(steps)]
    for cx, cy in _blocks(scorer):
        angle = np.unwrap(np.arctan2(y - cy, x - cx))
        turned = np.maximum.accumulate(angle) - np.minimum.accumulate(angle)
        around = np.flatnonzero(turned >= math.tau)
        if len(around):
            ends.append(int(index[around[0]]))
    return min(ends)


def _true_path(steps: Sequence[StepRecord]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = [(*p[:2], s.index) for s in steps for p in [*s.true_trail, s.true_pose]]
    x, y, index = np.array(rows).T
    return x, y, index.astype(int)


def _blocks(scorer: Scorer) -> list[tuple[float, float]]:
    """Centres of the unreachable areas that reachable space surrounds."""
    filled = ndimage.binary_fill_holes(scorer.reachable)
    res = scorer.resolution_m
    x0, y0 = scorer.origin
    regions = regionprops(label(filled & ~scorer.reachable, connectivity=1))
    return [
        (x0 + (r.centroid[1] + 0.5) * res, y0 + (r.centroid[0] + 0.5) * res)
        for r in regions
        if r.area * res**2 >= LEAST_BLOCK_M2
    ]
