"""A scan of a real episode at which the link graph had work to do: what figures 5 to 12 are redrawn from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sonar_explore.agents import make_agent
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.geometry import Array, Segment
from sonar_explore.slam import Chain, ScanUpdate

WORLD, SEED = "paper/bend", 0
FEATURES = 5  # about as many associations as the paper's example has
MOST = 7  # more make no readable picture


@dataclass(frozen=True)
class Moment:
    """One update, and the chains as it found them."""

    chains: tuple[Chain, ...]
    update: ScanUpdate
    world: str
    seed: int

    def chain(self, chain_id: int) -> Chain:
        """By id."""
        return next(chain for chain in self.chains if chain.id == chain_id)

    @property
    def adr_rad(self) -> Array:
        """Of every association, shape (n,), [rad]."""
        return np.array([a.adr_rad for a in self.update.associations])

    @property
    def ndr_m(self) -> Array:
        """Of every association, shape (n,), [m]."""
        return np.array([a.ndr_m for a in self.update.associations])

    @property
    def normals(self) -> Array:
        """Of the roots, shape (n, 2)."""
        chains = [self.chain(a.association.chain) for a in self.update.associations]
        return np.array([c.root.segment.unit_normal for c in chains])

    def placed(self, feature: int, *, corrected: bool) -> Segment:
        """A feature in the map, by the pose before or after the correction."""
        pose = self.update.pose if corrected else self.update.predicted_pose
        return self.update.features[feature].segment.transformed(pose)

    @property
    def names(self) -> list[str]:
        """A letter for each associated feature, for each association."""
        features = [a.association.feature for a in self.update.associations]
        order = list(dict.fromkeys(features))
        return ["abcdefghijklmnop"[order.index(f)] for f in features]

    @property
    def rank(self) -> tuple[int, int, int]:
        """How much it shows: both fits cut something, three features stay or more, about as many as in the paper."""
        graphs, n = self.update.link_graphs, len(self.update.associations)
        if graphs.pair is None or n > MOST:
            return 0, 0, 0
        by_angle = n - int(graphs.angle_fits[graphs.pair[0]].sum())
        by_distance = n - int(graphs.distance_fits[graphs.pair[1]].sum())
        kept = {name for name, edge in zip(self.names, graphs.final, strict=True) if edge}
        return int(by_angle > 0) + int(by_distance > 0), min(len(kept), 3), -abs(n - FEATURES)


def moments(world: str = WORLD, seed: int = SEED) -> Iterator[Moment]:
    """Every scan of an episode to the paper's letter: there the link graph alone removes false associations."""
    env = ExplorationEnv(world, "literal", "paper")
    env.reset(seed=seed)
    policy = make_agent("frontier")
    while not env.end_reason:
        chains, situation = env.situation.chains, env.situation
        env.step(np.int64(policy.choose(situation).chosen))
        yield Moment(chains, env.update, world, seed)


def telling_moment(world: str = WORLD, seed: int = SEED) -> Moment:
    """The first of those that show most."""
    return max(moments(world, seed), key=lambda moment: (*moment.rank, -moment.update.index))
