"""What became of each edge of the initial link graph: for records and pictures, and for the paper's correction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonar_explore.geometry import Array
from sonar_explore.slam.association import Association
from sonar_explore.slam.link_graph import LinkGraphs
from sonar_explore.slam.localization import Weights, association_weights
from sonar_explore.slam.probability import ProbabilityConfig, association_probabilities
from sonar_explore.slam.residuals import Residuals


@dataclass(frozen=True)
class ScoredAssociation:
    """One edge of the initial link graph and what became of it."""

    association: Association
    kept: bool
    """In the final winner (section III.C)."""
    adr_rad: float
    """Signed angle from the feature to the root of the chain, before the correction, [rad]."""
    ndr_m: float
    """Signed normal distance to the root's line, before the correction, [m]."""
    probability: float
    """P(association), equation (2); 0 where not kept."""
    w1: float
    """P(root) of the chain."""
    w2: float
    """Half of P(association)."""
    w3: float
    """By distance from the robot (figure 11)."""


def weighed(graphs: LinkGraphs, residuals: Residuals, config: ProbabilityConfig) -> tuple[Array, Weights]:
    """P(association) of every edge, 0 where it was not kept, shape (n,), and the weights that come of it."""
    probability = np.zeros(len(graphs.associations))
    kept_rad = residuals.adr_rad[graphs.final]
    probability[graphs.final] = association_probabilities(graphs.kept, kept_rad, config)
    return probability, association_weights(residuals, probability)


def scored(
    graphs: LinkGraphs, residuals: Residuals, config: ProbabilityConfig
) -> tuple[ScoredAssociation, ...]:
    """Every edge of the initial link graph."""
    if not graphs.associations:
        return ()
    probability, weights = weighed(graphs, residuals, config)
    columns = residuals.adr_rad, residuals.ndr_m, probability, weights.w1, weights.w2, weights.w3
    rows = zip(graphs.associations, graphs.final.tolist(), *(c.tolist() for c in columns), strict=True)
    return tuple(ScoredAssociation(*row) for row in rows)
