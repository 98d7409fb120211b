"""Link graphs: the associations that agree with one another (section III.C, READING section 6).

A false association shows by its error, which is not the error that the true ones share. Each association in
turn is fitted exactly; the associations that then fit too are the edges of its link graph.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, wrap_undirected
from sonar_explore.slam.association import Association
from sonar_explore.slam.residuals import Residuals

ANGLE_MARGIN_RAD = math.radians(2.0)  # epsilon, section III.C
DISTANCE_MARGIN_M = 0.05  # epsilon 2, section III.C
SLACK = 1e-9  # what lies on the limit is inside, whatever the rounding

Edges = NDArray[np.bool_]


@dataclass(frozen=True)
class LinkGraphConfig:
    """The margins of section III.C."""

    angle_margin_rad: float = ANGLE_MARGIN_RAD
    """th = mean |ADR| + this, [rad]."""
    distance_margin_m: float = DISTANCE_MARGIN_M
    """th2 = mean |d| + this, [m]."""


@dataclass(frozen=True, eq=False)
class LinkGraphs:
    """The initial link graph, its fits and the final winner. Edge i is association i."""

    associations: tuple[Association, ...]
    """The edges of the initial link graph (figure 6), n of them."""
    angle_fits: Edges
    """Row i: the edges kept when i's angle is fitted exactly (figure 7), shape (n, n)."""
    distance_fits: Edges
    """Row i: the edges kept when i's distance is fitted exactly (figure 8), shape (n, n)."""
    angle_winners: tuple[int, ...]
    """All rows of `angle_fits` with most edges."""
    distance_winners: tuple[int, ...]
    """All rows of `distance_fits` with most edges."""
    pair: tuple[int, int] | None
    """The angle winner and the distance winner whose common edges are the final graph."""
    final: Edges
    """The final winner (figure 9), shape (n,)."""

    @property
    def kept(self) -> tuple[Association, ...]:
        """The associations of the final link graph."""
        return tuple(a for a, keep in zip(self.associations, self.final, strict=True) if keep)

    def graph(self, edges: Edges | None = None) -> Any:
        """A `networkx.Graph` for pictures: nodes ("chain", id) above and ("feature", index) below.

        `edges` is a row of the fits or `final`; without it, the initial graph. Edge attribute `association`
        is the edge's place in `associations`.
        """
        import networkx as nx

        chosen = np.ones(len(self.associations), dtype=bool) if edges is None else edges
        graph = nx.Graph()
        for i in np.flatnonzero(chosen):
            chain, feature = ("chain", self.associations[i].chain), ("feature", self.associations[i].feature)
            graph.add_node(chain, bipartite=0)
            graph.add_node(feature, bipartite=1)
            graph.add_edge(chain, feature, association=int(i))
        return graph


def fit_link_graphs(
    associations: Sequence[Association], residuals: Residuals, config: LinkGraphConfig
) -> LinkGraphs:
    """Angle fit, distance fit, and the pair of winners with most edges in common."""
    angle_misfit = _angle_misfit(residuals, config)
    distance_misfit = _distance_misfit(residuals, config)
    angle_fits, distance_fits = angle_misfit <= 1.0 + SLACK, distance_misfit <= 1.0 + SLACK
    angle_winners, distance_winners = _most_edges(angle_fits), _most_edges(distance_fits)
    ranked = [
        (_rank(angle_fits[a] & distance_fits[d], angle_misfit[a] + distance_misfit[d], residuals), (a, d))
        for a in angle_winners
        for d in distance_winners
    ]
    pair = min(ranked)[1] if ranked else None
    final = angle_fits[pair[0]] & distance_fits[pair[1]] if pair else np.zeros(0, dtype=bool)
    return LinkGraphs(
        tuple(associations), angle_fits, distance_fits, angle_winners, distance_winners, pair, final
    )


def _angle_misfit(residuals: Residuals, config: LinkGraphConfig) -> Array:
    """|wrap(ADR_j - ADR_i)| / th, row i fitted, shape (n, n)."""
    adr = residuals.adr_rad
    if not adr.size:
        return np.zeros((0, 0))
    threshold = np.abs(adr).mean() + config.angle_margin_rad
    misfit: Array = np.abs(wrap_undirected(adr[None, :] - adr[:, None])) / threshold
    return misfit


def _distance_misfit(residuals: Residuals, config: LinkGraphConfig) -> Array:
    """|d_j - d_i (n_i . n_j)| / th2 after the shift -d_i n_i, row i fitted, shape (n, n)."""
    distance = residuals.ndr_m
    if not distance.size:
        return np.zeros((0, 0))
    threshold = np.abs(distance).mean() + config.distance_margin_m
    shifted = distance[None, :] - distance[:, None] * (residuals.normals @ residuals.normals.T)
    misfit: Array = np.abs(shifted) / threshold
    return misfit


def _most_edges(fits: Edges) -> tuple[int, ...]:
    counts = fits.sum(axis=1)
    return tuple(int(i) for i in np.flatnonzero(counts == counts.max(initial=0)))


def _rank(common: Edges, misfit: Array, residuals: Residuals) -> tuple[int, float, float]:
    """Most common edges first; ties by the smaller sum of misfits, then the larger sum of P(root)."""
    cost = round(float(misfit[common].sum()), 9)
    trust = round(float(residuals.root_probability[common].sum()), 9)
    return -int(common.sum()), cost, -trust
