"""Marks that several of the figures share, their colours and style."""

from __future__ import annotations

from typing import Any

from sonar_explore.geometry import Segment
from sonar_explore.slam.link_graph import Edges
from sonar_explore.studies.figures.moments import Moment

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


def line(axes: Any, segment: Segment, colour: str, width: float, label: str) -> None:
    """A segment [m]; the legend names each label once."""
    known = axes.get_legend_handles_labels()[1]
    axes.plot(
        [segment.x1, segment.x2],
        [segment.y1, segment.y2],
        color=colour,
        linewidth=width,
        solid_capstyle="round",
        label=None if label in known else label,
    )


def draw_graph(axes: Any, moment: Moment, edges: Edges, *, small: bool = False) -> None:
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
        *((x, 1.0, str(number(moment, c))) for c, x in top.items()),
        *((x, 0.0, f) for f, x in bottom.items()),
    ]:
        axes.text(x, y, text, color="white", ha="center", va="center_baseline", fontsize=6.5 if small else 9)
    axes.set(xlim=(0, 1), ylim=(-0.3, 1.3))
    axes.axis("off")


def number(moment: Moment, chain_id: int) -> int:
    """Chains of the picture, counted from 1."""
    return sorted({a.association.chain for a in moment.update.associations}).index(chain_id) + 1


def labels(moment: Moment) -> list[str]:
    """A feature's letter, with the chain where it has several associations."""
    names = moment.names
    return [
        f"{name}{number(moment, scored.association.chain)}" if names.count(name) > 1 else name
        for name, scored in zip(names, moment.update.associations, strict=True)
    ]


def spots(
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
