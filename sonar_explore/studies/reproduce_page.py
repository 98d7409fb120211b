"""The pages of the paper's runs: an overview, and one for each figure that the paper prints of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from sonar_explore.episodes.record import EpisodeRecord, Point
from sonar_explore.reports.frame import Frame, frame_around, scale_bar
from sonar_explore.reports.page import write_page
from sonar_explore.reports.raster import grid_png, grid_states
from sonar_explore.reports.scene import drive, true_drive
from sonar_explore.reports.study_charts import Interval, Lane, Mark, seed_squares, strip
from sonar_explore.studies.jobs import Outcome
from sonar_explore.studies.pages import study_values
from sonar_explore.studies.results import Study
from sonar_explore.studies.statistics import Median
from sonar_explore.studies.store import load_record_packed, record_path
from sonar_explore.studies.success import causes_of_failure
from sonar_explore.studies.tables import goal_lines, table_of

MAP_OPACITY = bytes((0, 60, 255))  # unknown, free, occupied: the walls are what is compared here
STYLES = {"chain": "believed", "smoothed": "c3", "off": "predicted", "literal": "c7", "truth": "true"}


@dataclass(frozen=True)
class PaperFigure:
    """One of the paper's pictures of a run."""

    number: str
    with_slam: str
    """What the paper calls its own picture."""
    without_slam: str
    """Empty where it prints none."""
    world: str
    says: str
    """What the paper reports."""

    @property
    def page(self) -> str:
        """File name."""
        return f"figure-{self.number.replace('(', '').replace(')', '')}.html"


PAPER_FIGURES = (
    PaperFigure(
        "14",
        "14(a)",
        "14(b)",
        "paper/corridor",
        "With SLAM the walls are negligibly off the true outline; without it they have shifted away from it.",
    ),
    PaperFigure(
        "16",
        "16(a)",
        "16(b)",
        "paper/bend",
        "With SLAM the map is close to the truth; without it pose and heading go wrong after some scans, and the "
        "map is shifted and tilted.",
    ),
    PaperFigure(
        "18(a)",
        "18(a)",
        "",
        "paper/loop",
        "With SLAM the loop is completed autonomously; without it the robot could not explore it to the end.",
    ),
    PaperFigure(
        "18(b)",
        "18(b)",
        "",
        "paper/open-loop",
        "With SLAM the loop is completed and the open side explored; without it the robot could not explore it to "
        "the end.",
    ),
    PaperFigure(
        "20",
        "20",
        "",
        "paper/rooms",
        "With SLAM rooms and corridor are explored; without it the robot could not even leave the room.",
    ),
)


def write_reproduction(study: Study, folder: Path) -> None:
    """`index.html` and one page for each of the paper's figures."""
    shown = [_figure(study, folder, world) for world in study.worlds]
    for page in shown:
        write_page(
            folder / page["page"],
            "study_figure.html",
            figure=page,
            pages=shown,
            **study_values(study),
        )
    goal = goal_lines(study) if any(v["name"] == "chain" for v in study.variants) else []
    write_page(
        folder / "index.html",
        "study_index.html",
        goal=goal,
        table=table_of(study),
        pages=shown,
        **study_values(study),
    )


def _figure(study: Study, folder: Path, world: str) -> dict[str, Any]:
    """All that the page of one world shows."""
    arms = [v["name"] for v in study.variants]
    known = {f.world: f for f in PAPER_FIGURES}
    figure = known.get(world) or PaperFigure(world.strip("/.").replace("/", "-"), "", "", world, "")
    seed = _typical_seed(study, world, arms)
    records = _records(study, folder, world, arms, seed)
    return {
        "figure": figure,
        "page": figure.page,
        "world": world,
        "title": next(iter(records.values())).world.title if records else world,
        "seed": seed,
        "maps": _maps(study, records, world, seed),
        "rows": [study.row(world, arm) for arm in arms],
        "squares": seed_squares([_lane(study, world, arm, "success") for arm in arms]),
        "strips": [
            _strip(study, world, arms, "wall_error_m", "mean wall error [m]"),
            _strip(study, world, arms, "position_error_m", "final position error [m]"),
        ],
    }


def _typical_seed(study: Study, world: str, arms: Sequence[str]) -> int | None:
    """The seed whose wall error in the first arm is the median's: chosen by rule, not by eye."""
    known = [
        (o.summary.wall_error_m, o.seed)
        for o in study.of(world, arms[0])
        if o.summary and o.summary.wall_error_m is not None
    ]
    return sorted(known)[(len(known) - 1) // 2][1] if known else None


def _records(
    study: Study, folder: Path, world: str, arms: Sequence[str], seed: int | None
) -> dict[str, EpisodeRecord]:
    paths = {arm: record_path(folder / _outcome_path(world, arm, seed)) for arm in arms if seed is not None}
    return {arm: load_record_packed(path) for arm, path in paths.items() if path.exists()}


def _outcome_path(world: str, arm: str, seed: int | None) -> Path:
    return Path("episodes") / arm / world.strip("/.").replace("/", "-") / f"{seed:04d}.json"


def _maps(
    study: Study, records: dict[str, EpisodeRecord], world: str, seed: int | None
) -> list[dict[str, Any]]:
    """Every arm's map in one and the same frame."""
    if not records:
        return []
    frame = frame_around(point for record in records.values() for point in _extent(record))
    return [_map(arm, record, frame, _report_href(world, arm, seed)) for arm, record in records.items()]


def _map(arm: str, record: EpisodeRecord, frame: Frame, href: str) -> dict[str, Any]:
    steps = list(zip([None, *record.steps], record.steps, strict=False))
    return {
        "arm": arm,
        "href": href,
        "record": record,
        "frame": frame,
        "bar_m": scale_bar(frame),
        "grid": grid_png(record.grid, MAP_OPACITY),
        "path": [point for before, step in steps for point in drive(step, before)],
        "true_path": [point for before, step in steps for point in true_drive(step, before)],
        "causes": causes_of_failure(record.summary),
    }


def _extent(record: EpisodeRecord) -> Iterable[Point]:
    """The true walls, what is drawn of the map, and the ways."""
    for x1, y1, x2, y2 in record.world.walls:
        yield from ((x1, y1), (x2, y2))
    grid, size = record.grid, record.grid.resolution_m
    rows, columns = grid_states(grid).nonzero()
    if len(rows):
        yield grid.origin[0] + size * float(columns.min()), grid.origin[1] + size * float(rows.min())
        yield grid.origin[0] + size * float(columns.max() + 1), grid.origin[1] + size * float(rows.max() + 1)
    for step in record.steps:
        yield from (step.pose[:2], step.true_pose[:2])


def _strip(study: Study, world: str, arms: Sequence[str], field: str, title: str) -> Markup:
    limit = study.criteria["largest_wall_error_m"] if field == "wall_error_m" else None
    intervals = [_interval(getattr(study.row(world, arm), field)) for arm in arms]
    return strip(title, [_lane(study, world, arm, field) for arm in arms], intervals, limit)


def _interval(median: Median | None) -> Interval | None:
    return Interval(median.value, median.low, median.high) if median else None


def _lane(study: Study, world: str, arm: str, field: str) -> Lane:
    return Lane(arm, STYLES.get(arm, "c3"), [_mark(outcome, field) for outcome in study.of(world, arm)])


def _mark(outcome: Outcome, field: str) -> Mark:
    causes = causes_of_failure(outcome.summary)
    value, words = _value(outcome, field), ", ".join(causes) or "success"
    note = f"{value:.3f} m, {words}" if value is not None else words
    href = _report_href(outcome.world, outcome.variant, outcome.seed) if outcome.summary else None
    return Mark(outcome.seed, value, not causes, outcome.error or note, href)


def _value(outcome: Outcome, field: str) -> float | None:
    if outcome.summary is None or field == "success":
        return None
    value = getattr(outcome.summary, field)
    return value.final if field == "position_error_m" else value


def _report_href(world: str, arm: str, seed: int | None) -> str:
    return _outcome_path(world, arm, seed).with_suffix(".html").as_posix()
