"""The page of `explore-plans`: its tables, and a picture of every failure with its cause."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from sonar_explore.envs.load import load_world
from sonar_explore.envs.plan_picture import draw_plan, save
from sonar_explore.episodes.record import EpisodeRecord
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.mapping.grid import OCCUPIED
from sonar_explore.reports.page import write_page
from sonar_explore.reports.raster import grid_states
from sonar_explore.studies.plans.results import PlansStudy, Run, unseen
from sonar_explore.studies.plans.tables import goal_lines, group_table, growth_table, plan_table
from sonar_explore.studies.store import load_record_packed, record_path

PICTURES = "failures"
_LEFT, _DRAWN, _TRUE, _BELIEVED = "#d62728", "#7a4fb5", "#1f77b4", "#e69f00"
_SHOWN_PARTS = 3


def picture_name(run: Run) -> str:
    """File name of the picture of a run."""
    return f"{run.building.replace('?', '-').replace('=', '-')}-{run.seed}.png"


def write_pages(study: PlansStudy, out: Path, record_of: dict[tuple[str, int], Path]) -> None:
    """`index.html` and the pictures beside it; pictures of earlier failures are removed."""
    folder = out / PICTURES
    folder.mkdir(exist_ok=True)
    failures = [run for run in study.failures() if run.summary]
    for old in set(folder.glob("*.png")) - {folder / picture_name(run) for run in failures}:
        old.unlink()
    shown = []
    for run in failures:
        path = record_of[run.world, run.seed]
        save_failure(run, load_record_packed(record_path(path)), folder / picture_name(run))
        page = path.with_suffix(".html").relative_to(out).as_posix()
        picture = base64.b64encode((folder / picture_name(run)).read_bytes()).decode()
        shown.append({"run": run, "picture": f"data:image/png;base64,{picture}", "page": page})
    write_page(
        out / "index.html",
        "study_plans.html",
        study=study,
        config=msgspec.json.format(msgspec.json.encode(study.config)).decode(),
        goal=[line.removeprefix("- ") for line in goal_lines(study)],
        tables=[group_table(study), plan_table(study), growth_table(study)],
        failures=shown,
        raised=[run for run in study.failures() if not run.summary],
    )


def is_ours(run: Run) -> bool:
    """Whether its building may be shown in the documents: plans of others stay with their owners."""
    return run.group == "generated"


def failure_lines(study: PlansStudy, pictures: str) -> list[str]:
    """The failures with their causes, and pictures of those `is_ours`, in Markdown; `pictures` is their folder."""
    lines = []
    for run in study.failures():
        lines += [f"### {run.building}, seed {run.seed}", "", f"{run.says}.", ""]
        lines += [f"- {part.says}" for part in run.parts[:_SHOWN_PARTS]]
        if not is_ours(run):
            lines += ["", "(of a plan of others, whose outline is not shown here)", ""]
        elif run.summary:
            lines += ["", f"![{run.building}]({pictures}/{picture_name(run)})", ""]
    return lines or ["None."]


def save_failure(run: Run, record: EpisodeRecord, path: Path) -> None:
    """Plan, the robot's walls, both paths, and what was left out."""
    world = load_world(run.world)
    x0, y0, x1, y1 = world.bounds
    scale = 6.5 / max(x1 - x0, y1 - y0)
    size = max(4.0, (x1 - x0) * scale + 0.7), max(2.5, (y1 - y0) * scale + 1.2)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.add_subplot()
    draw_plan(axes, world)
    _draw_walls(axes, record)
    scorer = Scorer(world)
    _fill(axes, unseen(scorer, record), scorer.origin, scorer.resolution_m, _LEFT, 3)
    axes.plot([], [], "s", color=_LEFT, label="left out")
    for name, colour, label in (("true_pose", _TRUE, "true scans"), ("pose", _BELIEVED, "believed scans")):
        places = np.array([getattr(step, name) for step in record.steps])
        axes.plot(
            places[:, 0],
            places[:, 1],
            "-o",
            color=colour,
            markersize=1.8,
            linewidth=0.6,
            label=label,
            zorder=5,
        )
    for part in run.parts[:_SHOWN_PARTS]:
        axes.annotate(f"{part.area_m2:.1f} m²", (part.x, part.y), ha="center", fontsize=8, zorder=6)
    figure.suptitle(f"{run.building}: {', '.join(run.misses)}", fontsize=9)
    axes.tick_params(labelsize=7)
    handles, _ = axes.get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=7, frameon=False)
    save(figure, path, dpi=80)


def _draw_walls(axes: Axes, record: EpisodeRecord) -> None:
    grid = record.grid
    _fill(axes, grid_states(grid) == OCCUPIED, grid.origin, grid.resolution_m, _DRAWN, 2.5)
    axes.plot([], [], "s", color=_DRAWN, label="the robot's walls")


def _fill(
    axes: Axes, mask: np.ndarray, origin: Sequence[float], cell_m: float, colour: str, order: float
) -> None:
    rows, cols = mask.shape
    x, y = origin
    axes.imshow(
        np.ma.masked_equal(mask.astype(np.uint8), 0),
        cmap=ListedColormap([colour]),
        origin="lower",
        extent=(x, x + cols * cell_m, y, y + rows * cell_m),
        interpolation="nearest",
        alpha=0.6,
        zorder=order,
    )
