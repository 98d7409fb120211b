"""Figures 5 to 9: associations and what the link graph keeps of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sonar_explore.geometry import Array, Pose, Segment, wrap_undirected
from sonar_explore.slam.link_graph import ANGLE_MARGIN_RAD, DISTANCE_MARGIN_M, Edges
from sonar_explore.studies.figures.drawing import (
    ACCENT,
    INK,
    KEPT,
    LINK,
    NEW,
    OLD,
    RULE,
    draw_graph,
    labels,
    line,
    number,
)
from sonar_explore.studies.figures.moments import Moment


def figure_5(moment: Moment) -> Figure:
    """Chains, the features of one scan, and the links that they are associated with; before and after."""
    figure = Figure(figsize=(9.5, 4.9))
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _draw_associations(left, moment, corrected=False)
    _draw_associations(right, moment, corrected=True)
    left.set_title("before: every association, features at the predicted pose")
    right.set_title("after: what the link graph kept, at the corrected pose")
    figure.legend(*left.get_legend_handles_labels(), loc="lower center", ncols=5)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    return figure


def figure_6(moment: Moment) -> Figure:
    """The initial link graph."""
    figure = Figure(figsize=(3.6, 2.2))
    axes = figure.subplots()
    draw_graph(axes, moment, np.ones(len(moment.names), dtype=bool))
    axes.set_title("initial link graph")
    figure.tight_layout()
    return figure


def figure_7(moment: Moment) -> Figure:
    """Angle fit: differences left when each is fitted, and the graphs that this leaves."""
    adr = moment.adr_rad
    left = np.degrees(wrap_undirected(adr[None, :] - adr[:, None]))
    window = math.degrees(float(np.abs(adr).mean()) + ANGLE_MARGIN_RAD)
    graphs = moment.update.link_graphs
    return _fits(moment, left, window, graphs.angle_fits, graphs.angle_winners, "angle to the root [deg]")


def figure_8(moment: Moment) -> Figure:
    """Distance fit: normal distances left when each is fitted, and the graphs that this leaves."""
    ndr, normals = moment.ndr_m, moment.normals
    left = 100.0 * (ndr[None, :] - ndr[:, None] * (normals @ normals.T))
    window = 100.0 * (float(np.abs(ndr).mean()) + DISTANCE_MARGIN_M)
    graphs = moment.update.link_graphs
    return _fits(
        moment, left, window, graphs.distance_fits, graphs.distance_winners, "distance to the root [cm]"
    )


def figure_9(moment: Moment) -> Figure:
    """One winner of each fit, and their common edges."""
    graphs = moment.update.link_graphs
    assert graphs.pair is not None
    angle, distance = graphs.pair
    figure = Figure(figsize=(8.4, 2.2))
    rows = (graphs.angle_fits[angle], graphs.distance_fits[distance], graphs.final)
    titles = (
        f"(a) angle winner, {labels(moment)[angle]} fitted",
        f"(b) distance winner, {labels(moment)[distance]} fitted",
        "(c) final: common edges",
    )
    for axes, edges, title in zip(figure.subplots(1, 3), rows, titles, strict=True):
        draw_graph(axes, moment, edges)
        axes.set_title(title)
    figure.tight_layout()
    return figure


def _draw_associations(axes: Any, moment: Moment, *, corrected: bool) -> None:
    pose = moment.update.pose if corrected else moment.update.predicted_pose
    shown = [
        (n, a)
        for n, a in zip(moment.names, moment.update.associations, strict=True)
        if a.kept or not corrected
    ]
    ids = sorted({a.association.chain for _, a in shown})
    for chain_id in ids:
        chain = moment.chain(chain_id)
        for link in chain.links:
            line(axes, link.segment, OLD, 1.6, "link")
        line(axes, chain.root.segment, OLD, 4.5, "root")
        _tag(axes, chain.root.segment, pose, f"{number(moment, chain_id)}", OLD, -1)
    for name, scored in shown:
        link = moment.chain(scored.association.chain).links[scored.association.link]
        line(axes, link.segment, LINK, 3.0, "associated link")
        segment = moment.placed(scored.association.feature, corrected=corrected)
        line(axes, segment, NEW, 2.4, "feature of this scan")
        _tag(axes, segment, pose, name, NEW, 1)
    axes.plot(pose.x, pose.y, "o", color=ACCENT, markersize=7, label="robot")
    nose = pose @ Pose(0.22, 0.0, 0.0)
    axes.plot([pose.x, nose.x], [pose.y, nose.y], color=ACCENT, linewidth=1.6)
    axes.margins(0.09)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _tag(axes: Any, segment: Segment, pose: Pose, text: str, colour: str, side: int) -> None:
    """A letter beside a segment, toward the robot (1) or away from it (-1)."""
    x, y = segment.midpoint
    away = math.hypot(pose.x - x, pose.y - y) or 1.0
    step = 0.13 * side / away
    axes.text(
        x + step * (pose.x - x),
        y + step * (pose.y - y),
        text,
        color=colour,
        ha="center",
        va="center",
        fontweight="bold",
    )


def _fits(
    moment: Moment, left: Array, window: float, fits: Edges, winners: tuple[int, ...], label: str
) -> Figure:
    """One column for each fitted association: what is left of the others, and the graph within the window."""
    n = len(moment.names)
    figure = Figure(figsize=(1.55 * n + 0.6, 4.0))
    grid = figure.subplots(2, n, squeeze=False, height_ratios=(3, 2))
    reach = 1.15 * max(float(np.abs(left).max()), window)
    for i in range(n):
        above, below = grid[0, i], grid[1, i]
        above.axhspan(-window, window, color=KEPT, linewidth=0)
        above.axhline(0.0, color=RULE, linewidth=1)
        for j in range(n):
            inside = bool(fits[i, j])
            above.plot(
                j, left[i, j], "o", color=NEW, markersize=5, markerfacecolor=NEW if inside else "white"
            )
        above.set(ylim=(-reach, reach), xlim=(-0.6, n - 0.4))
        above.set_xticks(range(n), labels(moment))
        above.tick_params(length=0, labelleft=i == 0)
        won = "wins" if i in winners else f"{int(fits[i].sum())} of {n}"
        above.set_title(f"fit {labels(moment)[i]}: {won}", color=LINK if i in winners else INK)
        draw_graph(below, moment, fits[i], small=True)
    grid[0, 0].set_ylabel(label)
    figure.tight_layout(w_pad=0.4)
    return figure
