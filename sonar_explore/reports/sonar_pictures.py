"""Pictures of recorded scans and of what was made of them, as PNG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sonar_explore.geometry import Array, Pose, Segment
from sonar_explore.measurement import Scan
from sonar_explore.replay.play import Replay
from sonar_explore.slam.features import Feature, FeatureKind

INK, SOFT, ECHO = "#1c2430", "#9aa3ad", "#8fa9c8"
TRUE, FALSE, PLAIN, REFERENCE = "#0072b2", "#c8341a", "#0072b2", "#4a4f57"
DPI = 110


def echo_points(scan: Scan, pose: Pose) -> Array:
    """Where the beams' middles end that heard something, x y, shape (k, 2), map frame, [m]."""
    heard = scan.ranges_m < scan.range_max_m
    beams = np.column_stack([np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)])
    return pose.transform((scan.origins + scan.ranges_m[:, None] * beams)[heard])


def draw_scan(
    axes: Any,
    scan: Scan,
    pose: Pose,
    features: Sequence[Feature],
    *,
    walls: Sequence[Segment] = (),
    on_wall: Sequence[bool] | None = None,
    title: str = "",
) -> None:
    """Echoes, features, and the true walls where they are known; features off every wall in red."""
    _walls(axes, walls)
    axes.plot(*echo_points(scan, pose).T, ".", color=ECHO, markersize=2.5, zorder=1)
    verdicts = iter(on_wall or [])
    for feature in features:
        segment = feature.segment.transformed(pose)
        if feature.kind is FeatureKind.WALL:
            good = next(verdicts, True)
            x1, y1, x2, y2 = segment.as_row()
            axes.plot([x1, x2], [y1, y2], color=TRUE if good else FALSE, linewidth=2.2, zorder=3)
        else:
            axes.plot(*segment.midpoint, "x", color=INK, markersize=4, markeredgewidth=0.9, zorder=2)
    axes.plot(pose.x, pose.y, "o", color=INK, markersize=4, zorder=4)
    _tidy(axes, title)


def draw_replay(axes: Any, done: Replay, walls: Sequence[Segment] = (), title: str = "") -> None:
    """Chains, the path as believed in the end, and the reference where there is one."""
    _walls(axes, walls)
    for chain in done.mind.chains.chains:
        for link in chain.links:
            x1, y1, x2, y2 = link.segment.as_row()
            axes.plot([x1, x2], [y1, y2], color=PLAIN, linewidth=1.6, alpha=0.8)
    path = np.array([(entry.pose.x, entry.pose.y) for entry in done.mind.scans])
    if done.log.reference is not None:
        known = np.array([(pose.x, pose.y) for pose in done.log.reference])
        axes.plot(*known.T, "s--", color=REFERENCE, markersize=3.5, linewidth=0.9, label="reference")
    axes.plot(*path.T, "o-", color="#d98200", markersize=3.5, linewidth=1.2, label="believed")
    # below: in a map this small a legend would cover what it explains
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2, fontsize=8, frameon=False)
    _tidy(axes, title)


def sheet(count: int, columns: int, side: float = 3.0) -> tuple[Figure, list[Any]]:
    """A figure with this many square pictures."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(side * columns, (side + 0.25) * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel().tolist()
    for spare in axes[count:]:
        spare.axis("off")
    return figure, axes[:count]


def png(figure: Figure) -> bytes:
    """The figure as a file; the same figure gives the same bytes."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, metadata={"Software": None})
    return stream.getvalue()


def _walls(axes: Any, walls: Sequence[Segment]) -> None:
    for wall in walls:
        axes.plot([wall.x1, wall.x2], [wall.y1, wall.y2], color=SOFT, linewidth=1.2, zorder=0)


def _tidy(axes: Any, title: str) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(title, fontsize=8.5, color=INK)
    axes.tick_params(labelsize=7, colors=SOFT, length=2)
    for spine in axes.spines.values():
        spine.set_color("#dfe3e8")
