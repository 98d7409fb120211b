"""Dual association: one feature that two chains still claim joins them (section III.G, READING section 9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sonar_explore.slam.association import Association
from sonar_explore.slam.chains import ChainMap


@dataclass(frozen=True)
class Merge:
    """Two chains that turned out to be one wall: a closed loop, or a missing link."""

    survivor: int
    """Id of the chain that keeps its root."""
    absorbed: int
    """Id of the chain whose root became a link."""


def merge_dual_associations(chains: ChainMap, kept: Sequence[Association]) -> tuple[Merge, ...]:
    """Merge the chains that share a feature of the final link graph.

    Called after the correction. Nothing is moved: a loop's residual gap stays in the map.
    """
    merges: list[Merge] = []
    features = {association.feature for association in kept}
    if len(features) == len(kept):
        return ()
    for feature in sorted(features):
        claims = {surviving(a.chain, merges) for a in kept if a.feature == feature}
        if len(claims) == 1:
            continue
        best, *others = sorted(claims, key=lambda chain: (-chains.root_probability(chain), chain))
        for other in others:
            chains.merge(best, other)
            merges.append(Merge(best, other))
    return tuple(merges)


def surviving(chain_id: int, merges: Sequence[Merge]) -> int:
    """The chain that holds this chain's links after the merges, in the order in which they were made."""
    for merge in merges:
        if chain_id == merge.absorbed:
            chain_id = merge.survivor
    return chain_id
