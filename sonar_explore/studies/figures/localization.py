"""Figures 11 and 12: how an association's share in the correction is weighed and split."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from sonar_explore.geometry import Pose, Segment
from sonar_explore.slam.localization import FAR_M, FAR_WEIGHT, NEAR_M, NEAR_WEIGHT
from sonar_explore.studies.figures.drawing import ACCENT, INK, NEW, OLD, line, spots
from sonar_explore.studies.figures.moments import Moment


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
        spots(axes, [spot], filled=name in kept, lift=6.0 if place % 2 == 0 else -14.0)
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
    line(axes, segment, NEW, 3.0, f"feature {moment.names[worst]}, turned parallel")
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


def _parallel(moment: Moment, index: int) -> Segment:
    """The feature, turned about the robot until it is parallel to its root."""
    pose = moment.update.predicted_pose
    turned = Pose(pose.x, pose.y, pose.heading + float(moment.adr_rad[index]))
    return moment.update.features[moment.update.associations[index].association.feature].segment.transformed(
        turned
    )
