"""Figures 5 to 12 of the paper, redrawn from an episode of ours.

`python -m sonar_explore.studies.figures` writes docs/figures/; the same code gives the same files.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from sonar_explore.geometry import Array, Pose, Segment, wrap_undirected
from sonar_explore.slam.link_graph import ANGLE_MARGIN_RAD, DISTANCE_MARGIN_M, Edges
from sonar_explore.slam.localization import FAR_M, FAR_WEIGHT, NEAR_M, NEAR_WEIGHT
from sonar_explore.slam.probability import (
    CLUSTER_HALF_WIDTH_RAD,
    DISTANCE_ZERO_M,
    DOOR_WIDTH_M,
    ProbabilityConfig,
    clusters,
    p_angle,
    p_distance,
)
from sonar_explore.studies.moments import Moment, telling_moment

FOLDER = Path("docs/figures")
INK, SOFT, RULE = "#1c2430", "#5d6775", "#b4bcc6"
NEW, LINK, OLD, ACCENT, KEPT = "#c8341a", "#00805f", "#4a4f57", "#0072b2", "#dff0ea"
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "svg.fonttype": "path",
    "svg.hashsalt": "sonar_explore",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "legend.frameon": False,
}


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
    _draw_graph(axes, moment, np.ones(len(moment.names), dtype=bool))
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
        f"(a) angle winner, {_labels(moment)[angle]} fitted",
        f"(b) distance winner, {_labels(moment)[distance]} fitted",
        "(c) final: common edges",
    )
    for axes, edges, title in zip(figure.subplots(1, 3), rows, titles, strict=True):
        _draw_graph(axes, moment, edges)
        axes.set_title(title)
    figure.tight_layout()
    return figure


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
    _spots(
        second,
        [(100 * g, p_distance(g, config), _labels(moment)[i]) for g, i in zip(gaps, kept, strict=True)],
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
    _spots(third, [(math.degrees(o), p_angle(o, config), _labels(moment)[kept[j]]) for j, o in off.items()])
    third.set(
        xlabel="angle from the cluster's mean [deg]", ylabel="P(ang)", title="(b) P(ang)", ylim=(0, 1.18)
    )
    figure.tight_layout()
    return figure


def figure_11(moment: Moment) -> Figure:
    """w3 over the distance of the feature, with the associations of this scan."""
    figure = Figure(figsize=(4.2, 2.7))
    axes = figure.subplots()
    axes.plot([0.0, 100 * NEAR_M, 100 * FAR_M, 230.0], [NEAR_WEIGHT] * 2 + [FAR_WEIGHT] * 2, color=ACCENT)
    kept = {n for n, a in zip(moment.names, moment.update.associations, strict=True) if a.kept}
    seen = dict(zip(moment.names, moment.update.associations, strict=True))
    ranges = {name: moment.update.features[a.association.feature].range_m for name, a in seen.items()}
    for place, name in enumerate(sorted(seen, key=ranges.__getitem__)):
        spot = (100 * ranges[name], seen[name].w3, name)
        _spots(axes, [spot], filled=name in kept, lift=6.0 if place % 2 == 0 else -14.0)
    axes.set(xlabel="distance from the robot [cm]", ylabel="w3", ylim=(0, 1.05), xticks=[0, 20, 100, 200])
    axes.set_title("w3; filled: kept by the link graph")
    figure.tight_layout()
    return figure


def figure_12(moment: Moment) -> Figure:
    """The normal distance of the kept feature that lies farthest off, split into (dx, dy)."""
    kept = [i for i, a in enumerate(moment.update.associations) if a.kept]
    worst = max(kept, key=lambda i: float(np.abs(moment.ndr_m[i] * moment.normals[i]).min()))
    scored = moment.update.associations[worst]
    root = moment.chain(scored.association.chain).root.segment
    segment = _parallel(moment, worst)
    x, y = segment.midpoint
    dx, dy = (float(v) for v in -moment.ndr_m[worst] * moment.normals[worst])
    figure = Figure(figsize=(4.8, 3.6))
    axes = figure.subplots()
    axes.axline((root.x1, root.y1), (root.x2, root.y2), color=OLD, linewidth=1.6, label="line of the root")
    _line(axes, segment, NEW, 3.0, f"feature {moment.names[worst]}, turned parallel")
    axes.annotate("", (x + dx, y + dy), (x, y), arrowprops={"arrowstyle": "->", "color": INK})
    axes.plot([x, x + dx, x + dx], [y, y, y + dy], color=ACCENT, linestyle=(0, (3, 2)), linewidth=1.2)
    reach = max(3.0 * math.hypot(dx, dy), 0.06)
    axes.set(xlim=(x + dx / 2 - reach, x + dx / 2 + reach), ylim=(y + dy / 2 - reach, y + dy / 2 + reach))
    axes.set_aspect("equal")
    plate = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    axes.text(
        x + dx / 2,
        y - math.copysign(0.08 * reach, dy),
        f"dx = {100 * dx:.1f} cm",
        ha="center",
        va="center",
        bbox=plate,
    )
    side = math.copysign(0.06 * reach, dx or 1.0)
    axes.text(
        x + dx + side,
        y + dy / 2,
        f"dy = {100 * dy:.1f} cm",
        ha="left" if side > 0 else "right",
        va="center",
        bbox=plate,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.14), ncols=2)
    axes.set(xlabel="x [m]", ylabel="y [m]")
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
            _line(axes, link.segment, OLD, 1.6, "link")
        _line(axes, chain.root.segment, OLD, 4.5, "root")
        _tag(axes, chain.root.segment, pose, f"{_number(moment, chain_id)}", OLD, -1)
    for name, scored in shown:
        link = moment.chain(scored.association.chain).links[scored.association.link]
        _line(axes, link.segment, LINK, 3.0, "associated link")
        segment = moment.placed(scored.association.feature, corrected=corrected)
        _line(axes, segment, NEW, 2.4, "feature of this scan")
        _tag(axes, segment, pose, name, NEW, 1)
    axes.plot(pose.x, pose.y, "o", color=ACCENT, markersize=7, label="robot")
    nose = pose @ Pose(0.22, 0.0, 0.0)
    axes.plot([pose.x, nose.x], [pose.y, nose.y], color=ACCENT, linewidth=1.6)
    axes.margins(0.09)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _number(moment: Moment, chain_id: int) -> int:
    """Chains of the picture, counted from 1."""
    return sorted({a.association.chain for a in moment.update.associations}).index(chain_id) + 1


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


def _line(axes: Any, segment: Segment, colour: str, width: float, label: str) -> None:
    known = axes.get_legend_handles_labels()[1]
    axes.plot(
        [segment.x1, segment.x2],
        [segment.y1, segment.y2],
        color=colour,
        linewidth=width,
        solid_capstyle="round",
        label=None if label in known else label,
    )


def _draw_graph(axes: Any, moment: Moment, edges: Edges, *, small: bool = False) -> None:
    """Chains above, features below; an edge that was cut is dotted."""
    associations = [a.association for a in moment.update.associations]
    chains = sorted({a.chain for a in associations})
    features = list(dict.fromkeys(moment.names))
    top = {c: (i + 0.5) / len(chains) for i, c in enumerate(chains)}
    bottom = {f: (i + 0.5) / len(features) for i, f in enumerate(features)}
    for association, name, edge in zip(associations, moment.names, edges, strict=True):
        style = (
            {"color": INK, "linewidth": 1.5} if edge else {"color": RULE, "linewidth": 1.0, "linestyle": ":"}
        )
        axes.plot([top[association.chain], bottom[name]], [1.0, 0.0], zorder=1, **style)
    size = 70 if small else 190
    axes.scatter(list(top.values()), [1.0] * len(top), s=size, color=OLD, zorder=2)
    axes.scatter(list(bottom.values()), [0.0] * len(bottom), s=size, color=NEW, zorder=2)
    for x, y, text in [
        *((x, 1.0, str(_number(moment, c))) for c, x in top.items()),
        *((x, 0.0, f) for f, x in bottom.items()),
    ]:
        axes.text(x, y, text, color="white", ha="center", va="center_baseline", fontsize=6.5 if small else 9)
    axes.set(xlim=(0, 1), ylim=(-0.3, 1.3))
    axes.axis("off")


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
        above.set_xticks(range(n), _labels(moment))
        above.tick_params(length=0, labelleft=i == 0)
        won = "wins" if i in winners else f"{int(fits[i].sum())} of {n}"
        above.set_title(f"fit {_labels(moment)[i]}: {won}", color=LINK if i in winners else INK)
        _draw_graph(below, moment, fits[i], small=True)
    grid[0, 0].set_ylabel(label)
    figure.tight_layout(w_pad=0.4)
    return figure


def _labels(moment: Moment) -> list[str]:
    """A feature's letter, with the chain where it has several associations."""
    names = moment.names
    return [
        f"{name}{_number(moment, scored.association.chain)}" if names.count(name) > 1 else name
        for name, scored in zip(names, moment.update.associations, strict=True)
    ]


def _draw_clusters(axes: Any, moment: Moment, kept: list[int], groups: tuple[tuple[int, ...], ...]) -> None:
    """The angle differences, cluster by cluster, with the mean of each."""
    for level, group in enumerate(groups):
        values = np.degrees(moment.adr_rad[kept])[list(group)]
        y = len(groups) - level
        axes.plot([values.mean() - 5, values.mean() + 5], [y, y], color=KEPT, linewidth=16, zorder=0)
        axes.plot([values.mean()] * 2, [y - 0.22, y + 0.22], color=LINK, linewidth=1.5)
        _spots(axes, [(float(v), y, _labels(moment)[kept[j]]) for v, j in zip(values, group, strict=True)])
        share = f"P(cluster) = {len(group)}/{len(kept)}"
        axes.annotate(share, (values.mean(), y), (0, 26), textcoords="offset points", ha="center", color=SOFT)
    axes.set(ylim=(0.4, len(groups) + 0.8), yticks=[], xlabel="angle to the root [deg]", title="clusters")
    axes.spines["left"].set_visible(False)


def _spots(
    axes: Any, points: list[tuple[float, float, str]], *, filled: bool = True, lift: float = 6.0
) -> None:
    """Dots with their letters, above and below in turn; those at one place share a label."""
    places: dict[tuple[float, float], list[str]] = {}
    for x, y, name in points:
        places.setdefault((round(x, 1), round(y, 2)), []).append(name)
    for place, ((x, y), names) in enumerate(sorted(places.items())):
        axes.plot(x, y, "o", color=NEW, markersize=5, markerfacecolor=NEW if filled else "white", zorder=3)
        axes.annotate(
            ", ".join(sorted(names)),
            (x, y),
            (0, lift if place % 2 == 0 else -14.0),
            textcoords="offset points",
            ha="center",
        )


def _parallel(moment: Moment, index: int) -> Segment:
    """The feature, turned about the robot until it is parallel to its root."""
    pose = moment.update.predicted_pose
    turned = Pose(pose.x, pose.y, pose.heading + float(moment.adr_rad[index]))
    return moment.update.features[moment.update.associations[index].association.feature].segment.transformed(
        turned
    )


FIGURES: dict[int, Callable[[Moment], Figure]] = {
    5: figure_5,
    6: figure_6,
    7: figure_7,
    8: figure_8,
    9: figure_9,
    10: figure_10,
    11: figure_11,
    12: figure_12,
}


def write_figures(folder: Path = FOLDER, moment: Moment | None = None) -> list[Path]:
    """All of them as SVG, and a page that shows them."""
    moment = moment or telling_moment()
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        for number, draw in FIGURES.items():
            path = folder / f"figure-{number:02d}.svg"
            draw(moment).savefig(path, metadata={"Date": None})
            paths.append(path)
    (folder / "README.md").write_text(_page(moment), encoding="utf-8")
    return paths


def _page(moment: Moment) -> str:
    head = (
        "# Figures 5 to 12, redrawn\n\nMade by `python -m sonar_explore.studies.figures` from scan "
        f"{moment.update.index} of `{moment.world}`, `--slam literal`, seed {moment.seed}: of all scans the "
        "one at which both fits had most to do (`studies/moments.py`).\n"
    )
    parts = [
        f"## Figure {n}\n\n{(draw.__doc__ or '').strip()}\n\n![Figure {n}](figure-{n:02d}.svg)\n"
        for n, draw in FIGURES.items()
    ]
    return "\n".join([head, *parts])


if __name__ == "__main__":
    for written in write_figures():
        print(written)
