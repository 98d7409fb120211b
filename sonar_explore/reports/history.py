"""Which chain each feature belonged to, and when: told again from the steps of a record."""

from __future__ import annotations

from dataclasses import dataclass, field

from sonar_explore.episodes.record import EpisodeRecord, Segment4, StepRecord


@dataclass
class ChainHistory:
    """Chains as they grew; ids are those of the moment, `final` follows the merges to the end."""

    born_in: dict[tuple[int, int], int] = field(default_factory=dict)
    """Chain that the feature (step, index) joined, once that step's merges were made."""
    roots: set[tuple[int, int]] = field(default_factory=set)
    """Features (step, index) that rooted a chain."""
    merges: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Absorbed chain -> (surviving chain, step)."""
    links: dict[tuple[int, int], Segment4] = field(default_factory=dict)
    """Link that each association (step, index) pointed at, where it is known, [m]."""

    def final(self, chain: int) -> int:
        """The chain's id at the end of the episode."""
        while chain in self.merges:
            chain = self.merges[chain][0]
        return chain


def chain_history(record: EpisodeRecord) -> ChainHistory:
    """Follow features into chains and chains into each other, step by step."""
    history = ChainHistory()
    grown: dict[int, list[Segment4]] = {}
    for step in record.steps:
        for index, association in enumerate(step.associations):
            known = grown.get(association.chain, [])
            if known:
                history.links[step.index, index] = known[min(association.link, len(known) - 1)]
        for survivor, absorbed in step.merges:  # before the chains grow, as SLAM does it
            if history.final(survivor) != absorbed:  # a circle would never end
                history.merges[absorbed] = (survivor, step.index)
                grown.setdefault(survivor, []).extend(grown.pop(absorbed, []))
        for feature, chain in sorted(_memberships(step).items()):
            chain = history.final(chain)
            history.born_in[step.index, feature] = chain
            grown.setdefault(chain, []).append(step.features[feature].segment)
        history.roots |= {(step.index, feature) for feature in _roots(step)}
    return history


def _memberships(step: StepRecord) -> dict[int, int]:
    """Feature index -> chain: by a kept association, else as the root of a new chain."""
    kept: dict[int, int] = {}
    for association in step.associations:
        if association.kept and 0 <= association.feature < len(step.features):
            kept.setdefault(association.feature, association.chain)
    return kept | dict(zip(_roots(step), step.new_chains, strict=False))


def _roots(step: StepRecord) -> list[int]:
    """Walls that no association kept, one for each new chain, in order."""
    kept = {association.feature for association in step.associations if association.kept}
    free = [i for i, f in enumerate(step.features) if f.kind == "wall" and i not in kept]
    return free[: len(step.new_chains)]
