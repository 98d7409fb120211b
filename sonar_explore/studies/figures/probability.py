"""Figure 10: what an association's probability is made of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sonar_explore.slam.probability import (
    CLUSTER_HALF_WIDTH_RAD,
    DISTANCE_ZERO_M,
    DOOR_WIDTH_M,
    ProbabilityConfig,
    clusters,
    p_angle,
    p_distance,
)
from sonar_explore.studies.figures.drawing import ACCENT, KEPT, LINK, SOFT, labels, spots
from sonar_explore.studies.figures.moments import Moment


def figure_10(moment: Moment) -> Figure:
    """Clusters of the kept associations, and the curves of P(dist) and P(ang) with these associations on them."""
    kept = [i for i, a in enumerate(moment.update.associations) if a.kept]
    adr = moment.adr_rad[kept]
    groups = clusters(adr, CLUSTER_HALF_WIDTH_RAD)
    config = ProbabilityConfig()
    figure = Figure(figsize=(9.5, 2.9))
    first, second, third = figure.subplots(1, 3)
    _draw_clusters(first, moment, kept, groups)
    reach = np.linspace(0.0, 0.6, 200)
    second.plot(100 * reach, [p_distance(x, config) for x in reach], color=ACCENT)
    gaps = [moment.update.associations[i].association.end_gap_m for i in kept]
    spots(
        second,
        [(100 * g, float(p_distance(g, config)), labels(moment)[i]) for g, i in zip(gaps, kept, strict=True)],
    )
    second.set(
        xlabel="distance to the nearest end [cm]",
        ylabel="P(dist)",
        title="(a) P(dist)",
        ylim=(0, 1.18),
        xlim=(-12, 60),
    )
    second.set_xticks([0, 50 * DOOR_WIDTH_M, 100 * DISTANCE_ZERO_M], ["0", "d_w/2", "50"])
    angles = np.linspace(-7.0, 7.0, 200)
    third.plot(angles, [p_angle(math.radians(x), config) for x in angles], color=ACCENT)
    off = {j: float(adr[j] - adr[list(group)].mean()) for group in groups for j in group}
    spots(third, [(math.degrees(o), p_angle(o, config), labels(moment)[kept[j]]) for j, o in off.items()])
    third.set(
        xlabel="angle from the cluster's mean [deg]", ylabel="P(ang)", title="(b) P(ang)", ylim=(0, 1.18)
    )
    figure.tight_layout()
    return figure


def _draw_clusters(axes: Any, moment: Moment, kept: list[int], groups: tuple[tuple[int, ...], ...]) -> None:
    """The angle differences, cluster by cluster, with the mean of each."""
    for level, group in enumerate(groups):
        values = np.degrees(moment.adr_rad[kept])[list(group)]
        y = len(groups) - level
        axes.plot([values.mean() - 5, values.mean() + 5], [y, y], color=KEPT, linewidth=16, zorder=0)
        axes.plot([values.mean()] * 2, [y - 0.22, y + 0.22], color=LINK, linewidth=1.5)
        spots(axes, [(float(v), y, labels(moment)[kept[j]]) for v, j in zip(values, group, strict=True)])
        share = f"P(cluster) = {len(group)}/{len(kept)}"
        axes.annotate(share, (values.mean(), y), (0, 26), textcoords="offset points", ha="center", color=SOFT)
    axes.set(ylim=(0.4, len(groups) + 0.8), yticks=[], xlabel="angle to the root [deg]", title="clusters")
    axes.spines["left"].set_visible(False)
