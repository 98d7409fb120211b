"""Draw an episode as one picture: the one in the README.

sonar-explore run paper/rooms --out runs/readme
python docs/picture.py runs/readme/episode.json docs/episode.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap

from sonar_explore.episodes.files import load_record
from sonar_explore.episodes.record import EpisodeRecord
from sonar_explore.reports.raster import grid_states


def draw(record: EpisodeRecord) -> plt.Figure:
    """The robot's map and chains, and the truth under them."""
    figure, axes = plt.subplots(figsize=(7.5, 5.6), layout="constrained")
    axes.set_facecolor("#d9d9d9")
    grid = record.grid
    (x0, y0), (rows, columns), res = grid.origin, grid.shape, grid.resolution_m
    axes.imshow(
        grid_states(grid),
        cmap=ListedColormap(["#d9d9d9", "#ffffff", "#8a8a8a"]),
        vmin=0,
        vmax=2,
        origin="lower",
        extent=(x0, x0 + columns * res, y0, y0 + rows * res),
        interpolation="nearest",
    )
    axes.add_collection(_lines(record.world.walls, "#d55e00", 1.0, "true walls"))
    links = [link for chain in record.chains for link in chain.links]
    axes.add_collection(_lines(links, "#0072b2", 2.0, "feature chains"))
    believed = np.array([p for s in record.steps for p in [*s.trail, s.pose]])
    true = np.array([p for s in record.steps for p in [*s.true_trail, s.true_pose]])
    axes.plot(true[:, 0], true[:, 1], color="#d55e00", linewidth=1.0, linestyle=":", label="true path")
    axes.plot(believed[:, 0], believed[:, 1], color="#009e73", linewidth=1.0, label="believed path")
    scans = np.array([s.pose for s in record.steps])
    axes.plot(scans[:, 0], scans[:, 1], "o", color="#009e73", markersize=3, label="scans")
    summary = record.summary
    axes.set_title(
        f"{summary.world}, policy {summary.agent}, seed {summary.seed}: {summary.scans} scans, "
        f"{100 * summary.explored_fraction:.0f} % explored",
        fontsize=10,
    )
    drawn = np.array([*record.world.walls, *links]).reshape(-1, 2)
    axes.set_xlim(drawn[:, 0].min() - 0.4, drawn[:, 0].max() + 0.4)
    axes.set_ylim(drawn[:, 1].min() - 0.4, drawn[:, 1].max() + 0.4)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(loc="lower left", fontsize=8)
    return figure


def _lines(segments: list, colour: str, width: float, label: str) -> LineCollection:
    ends = np.array(segments).reshape(-1, 2, 2)
    return LineCollection(list(ends), colors=colour, linewidths=width, label=label)


if __name__ == "__main__":
    draw(load_record(Path(sys.argv[1]))).savefig(sys.argv[2], dpi=110)
