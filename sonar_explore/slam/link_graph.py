"""Link graphs: the associations that agree with one another (section III.C, READING section 6).

A false association shows by its error, which is not the error that the true ones share. Each association in
turn is fitted exactly; the associations that then fit too are the edges of its link graph.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_allocating_kernel, kernel
from sonar_explore.slam.association import Association
from sonar_explore.slam.residuals import Residuals
from sonar_explore.sums import dot, total

ANGLE_MARGIN_RAD = math.radians(2.0)  # epsilon, section III.C
DISTANCE_MARGIN_M = 0.05  # epsilon 2, section III.C
SLACK = 1e-9  # what lies on the limit is inside, whatever the rounding
TIE = 1e9  # sums equal to nine decimals are a tie

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
    most: Edges
    """Which rows of `angle_fits`, and of `distance_fits`, have most edges, shape (2, n)."""
    pair: tuple[int, int] | None
    """The angle winner and the distance winner whose common edges are the final graph."""
    final: Edges
    """The final winner (figure 9), shape (n,)."""

    @property
    def angle_winners(self) -> tuple[int, ...]:
        """All rows of `angle_fits` with most edges."""
        return tuple(np.flatnonzero(self.most[0]).tolist())

    @property
    def distance_winners(self) -> tuple[int, ...]:
        """All rows of `distance_fits` with most edges."""
        return tuple(np.flatnonzero(self.most[1]).tolist())

    @cached_property
    def kept(self) -> tuple[Association, ...]:
        """The associations of the final link graph."""
        return tuple(compress(self.associations, self.final.tolist()))

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
    n = len(associations)
    fits, most = np.empty((2, n, n), dtype=bool), np.empty((2, n), dtype=bool)
    pair, final = None, np.empty(n, dtype=bool)
    if n:
        margins = config.angle_margin_rad, config.distance_margin_m
        found = residuals.adr_rad, residuals.ndr_m, residuals.normals, residuals.root_probability
        pair = _fitted(*found, *margins, fits, most, final)
    return LinkGraphs(tuple(associations), fits[0], fits[1], most, pair, final)


@kernel
def _fitted(adr, ndr, normals, root_probability, angle_margin, distance_margin, fits, most, final):  # type: ignore[no-untyped-def]
    """Both fits, the rows with most edges, and the edges that the winning pair has in common; the pair."""
    n = len(adr)
    misfits = np.empty((2, n, n))
    _angle_misfit(adr, angle_margin, misfits[0])
    _distance_misfit(ndr, normals, distance_margin, misfits[1])
    angle, distance = _best_pair(misfits, root_probability, fits, most)
    for j in range(n):
        final[j] = fits[0, angle, j] and fits[1, distance, j]
    return angle, distance


@inner_allocating_kernel
def _angle_misfit(adr, margin, misfit):  # type: ignore[no-untyped-def]
    """|wrap(ADR_j - ADR_i)| / th, row i fitted, shape (n, n)."""
    n = len(adr)
    threshold = total(np.abs(adr)) / n + margin
    for i in range(n):
        for j in range(n):
            turn = math.pi / 2 - (math.pi / 2 - (adr[j] - adr[i])) % math.pi
            misfit[i, j] = abs(turn) / threshold


@inner_allocating_kernel
def _distance_misfit(ndr, normals, margin, misfit):  # type: ignore[no-untyped-def]
    """|d_j - d_i facing_ij| / th2, row i fitted by the shift -d_i n_i; facing_ij is the product of normals i and j."""
    n = len(ndr)
    threshold = total(np.abs(ndr)) / n + margin
    for i in range(n):
        for j in range(n):
            misfit[i, j] = abs(ndr[j] - ndr[i] * dot(normals[i], normals[j])) / threshold


@inner_allocating_kernel
def _best_pair(misfits, root_probability, fits, most):  # type: ignore[no-untyped-def]
    """The rows of the two fits that win: the pair, among those with `most` edges each, with most of them in common.

    Ties by the smaller sum of misfits, then the larger sum of P(root), then the earlier rows.
    """
    n = len(root_probability)
    for kind in range(2):
        edges, most_edges = np.zeros(n, dtype=np.int64), 0
        for i in range(n):
            for j in range(n):
                fits[kind, i, j] = misfits[kind, i, j] <= 1.0 + SLACK
                edges[i] += fits[kind, i, j]
            most_edges = max(most_edges, edges[i])
        for i in range(n):
            most[kind, i] = edges[i] == most_edges
    angle = distance = -1
    best, least, trusted = -1, np.inf, 0.0
    off, trust = np.empty(n), np.empty(n)
    for a in range(n):
        for d in range(n):
            if not (most[0, a] and most[1, d]):
                continue
            k = 0
            for j in range(n):
                if fits[0, a, j] and fits[1, d, j]:
                    off[k], trust[k] = misfits[0, a, j] + misfits[1, d, j], root_probability[j]
                    k += 1
            if k < best:
                continue
            cost, sure = np.rint(total(off[:k]) * TIE), np.rint(total(trust[:k]) * TIE)
            if k > best or cost < least or (cost == least and sure > trusted):
                angle, distance, best, least, trusted = a, d, k, cost, sure
    return angle, distance
