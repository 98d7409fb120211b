"""The page of the comparison: distributions, trajectories and tables, in one file that opens with no network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from sonar_explore.envs.load import load_world
from sonar_explore.envs.world import World
from sonar_explore.reports.frame import Frame, frame_around, scale_bar
from sonar_explore.reports.page import write_page
from sonar_explore.reports.study_charts import Interval, Lane, Mark, strip
from sonar_explore.studies.compare.jobs import DriveOutcome
from sonar_explore.studies.compare.results import Comparison
from sonar_explore.studies.compare.tables import accuracy_table, closed_loop_table, goal_lines
from sonar_explore.studies.pages import study_values

STYLES = {
    "off": "loose",
    "literal": "c7",
    "chain": "believed",
    "smoothed": "c3",
    "grid-pf": "c8",
    "scan-match": "c5",
    "oracle": "true",
}
DRAWN = ("chain", "smoothed", "grid-pf", "scan-match", "oracle")
"""Whose ways are drawn: those of the rest leave the picture."""


def write_comparison(found: Comparison, outcomes: Sequence[DriveOutcome], folder: Path) -> None:
    """`index.html`"""
    parts = []
    for noise in found.noises:
        drives = [o for o in outcomes if o.noise == noise and not o.error]
        parts.append(
            {
                "noise": noise,
                "goals": goal_lines(found, noise) if noise == "paper" else [],
                "worlds": [_world(found, noise, world, drives) for world in found.worlds],
                "table": accuracy_table(found, noise),
                "closed": closed_loop_table(found, noise) if found.closed_loop.get(noise) else None,
            }
        )
    write_page(folder / "index.html", "compare.html", parts=parts, styles=STYLES, **study_values(found))


def _world(found: Comparison, noise: str, name: str, drives: Sequence[DriveOutcome]) -> dict[str, Any]:
    here = [o for o in drives if o.world == name]
    world = load_world(name)
    lanes, intervals = [], []
    for slam, style in STYLES.items():
        lanes.append(Lane(slam, style, [_mark(o, slam) for o in here]))
        row = found.row(noise, name, slam)
        middle = row.position_mean_m.median if row else None
        intervals.append(Interval(middle.value, middle.low, middle.high) if middle else None)
    typical = sorted(here, key=lambda o: o.arms["oracle"].position_error_m.mean)
    shown = typical[(len(typical) - 1) // 2] if typical else None
    return {
        "title": world.title,
        "strip": strip(f"mean position error [m], {name}", lanes, intervals, None),
        "paths": _paths(world, shown) if shown else None,
        "seed": shown.seed if shown else None,
    }


def _mark(outcome: DriveOutcome, slam: str) -> Mark:
    error = outcome.arms[slam].position_error_m
    return Mark(outcome.seed, error.mean, True, f"{error.mean:.3f} m, final {error.final:.3f} m", None)


def _paths(world: World, outcome: DriveOutcome) -> Markup:
    """The ways that each SLAM believes in, over the true walls."""
    walls = [tuple(map(float, wall)) for wall in world.walls]
    corners = [point for x1, y1, x2, y2 in walls for point in ((x1, y1), (x2, y2))]
    frame = frame_around([*corners, *outcome.true_poses])
    size = f"0 0 {frame.width:g} {frame.height:g}"
    parts = [
        f'<svg class="map" viewBox="{size}" role="img" aria-label="{escape(world.title)}, trajectories">'
    ]
    parts += [
        f'<line class="outline" x1="{frame.x(x1):g}" y1="{frame.y(y1):g}" x2="{frame.x(x2):g}" y2="{frame.y(y2):g}"/>'
        for x1, y1, x2, y2 in walls
    ]
    for slam in DRAWN:
        points = frame.points((x, y) for x, y, _ in outcome.arms[slam].poses)
        parts.append(f'<g class="{STYLES[slam]}"><polyline class="way" points="{points}"/></g>')
    parts.append(f'<polyline class="outline" points="{frame.points(outcome.true_poses)}"/>')
    return Markup("".join([*parts, _bar(frame), "</svg>"]))


def _bar(frame: Frame) -> str:
    metres = scale_bar(frame)
    length = frame.length(metres)
    return (
        f'<g class="scale" transform="translate({frame.width - length - 16:g} {frame.height - 12:g})">'
        f'<path d="M0 -6V0H{length:g}V-6"/><text x="{length / 2:g}" y="-8">{metres} m</text></g>'
    )
