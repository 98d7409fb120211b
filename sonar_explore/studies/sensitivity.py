"""`sensitivity`: what each sweep shows, point by point and in a sentence that is made from the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sonar_explore.episodes.files import write_atomically
from sonar_explore.reports.page import write_page
from sonar_explore.reports.study_charts import Spot, small_multiple
from sonar_explore.studies import progress
from sonar_explore.studies.pages import study_values
from sonar_explore.studies.results import Row, Study, row_of
from sonar_explore.studies.statistics import paired_p_value
from sonar_explore.studies.study import Choices, run_variants
from sonar_explore.studies.success import causes_of_failure
from sonar_explore.studies.sweeps import SWEEPS, Sweep, sweep_variants

SIGNIFICANT = 0.05


def run_sensitivity(choices: Choices) -> Study:
    """Each number around its default."""
    study = run_variants("sensitivity", choices, sweep_variants(), keep_record=False)
    lines = sensitivity_lines(study)
    write_atomically(choices.out / "table.md", "\n".join(["# Sensitivity", "", *lines, ""]).encode())
    write_sensitivity(study, swept(study), choices.out)
    progress.say(*lines, f"page: {choices.out / 'index.html'}")
    return study


def sensitivity_lines(study: Study) -> list[str]:
    """One sentence a sweep, as a list in Markdown."""
    return [f"- **{s.sweep.name}** (`{s.sweep.option}`): {s.sentence}" for s in swept(study)]


@dataclass(frozen=True)
class Point:
    """One value of a sweep, over all worlds and seeds."""

    value: Any
    row: Row
    is_default: bool
    differs: bool
    """Whether success differs from the default's on the same worlds and seeds (McNemar, exact)."""


@dataclass(frozen=True)
class Swept:
    """What one sweep shows."""

    sweep: Sweep
    points: tuple[Point, ...]
    sentence: str


def swept(study: Study) -> list[Swept]:
    """Every sweep of the study."""
    found = [(sweep, tuple(points_of(study, sweep))) for sweep in SWEEPS]
    return [Swept(sweep, points, sentence(sweep, points)) for sweep, points in found]


def points_of(study: Study, sweep: Sweep) -> list[Point]:
    """In the order of the values."""
    baseline = _successes(study, sweep.variant(sweep.default).name)
    points = []
    for value in sweep.values:
        name = sweep.variant(value).name
        row = row_of([o for o in study.outcomes if o.variant == name])
        differs = paired_p_value(baseline, _successes(study, name)) < SIGNIFICANT
        points.append(Point(value, row, value == sweep.default, differs))
    return points


def _successes(study: Study, variant: str) -> list[bool]:
    return [not causes_of_failure(o.summary) for o in study.outcomes if o.variant == variant]


def sentence(sweep: Sweep, points: Sequence[Point]) -> str:
    """Where success is as at the default, where it is not, and what becomes of the error."""
    default = next(p for p in points if p.is_default)
    return f"{_success_words(sweep, points, default)} {_error_words(sweep, points)}".strip()


def _success_words(sweep: Sweep, points: Sequence[Point], default: Point) -> str:
    alike = [p for p in points if not p.differs]
    others = [p for p in points if p.differs]
    at = f"{100 * default.row.success.value:.0f} %"
    if not others:
        return (
            f"No value changes success ({at} at the default) by more than chance does, {_span(sweep, alike)}."
        )
    changed = ", ".join(f"{100 * p.row.success.value:.0f} % at {_text(sweep, p.value)}" for p in others)
    return f"Success is {at} at the default and no different {_span(sweep, alike)}; it is {changed}."


def _error_words(sweep: Sweep, points: Sequence[Point]) -> str:
    known = [(p, p.row.position_error_m.value) for p in points if p.row.position_error_m]
    if len(known) < 2:
        return ""
    best, worst = min(known, key=lambda k: k[1]), max(known, key=lambda k: k[1])
    if best[0].row.position_error_m.high >= worst[0].row.position_error_m.low:  # type: ignore[union-attr]
        return f"The median final error stays between {best[1]:.3f} and {worst[1]:.3f} m."
    return (
        f"The median final error is {best[1]:.3f} m at {_text(sweep, best[0].value)} and {worst[1]:.3f} m at "
        f"{_text(sweep, worst[0].value)}."
    )


def _span(sweep: Sweep, points: Sequence[Point]) -> str:
    if len(points) < 2:
        return "at any other value tried"
    values = [p.value for p in points]
    if isinstance(values[0], bool):
        return "either way"
    if values == list(sweep.values[sweep.values.index(values[0]) :][: len(values)]):
        return f"from {values[0]:g} to {_text(sweep, values[-1])}"
    return "at " + ", ".join(f"{v:g}" for v in values) + f" {sweep.unit}"


def _text(sweep: Sweep, value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g} {sweep.unit}".strip()


def write_sensitivity(study: Study, found: Sequence[Swept], folder: Path) -> None:
    """`index.html` of the sensitivity study."""
    sweeps = []
    for shown in found:
        sweep, points = shown.sweep, shown.points
        label = f"{sweep.name} [{sweep.unit}]" if sweep.unit else sweep.name
        rates = [_spot(p.value, p.row.success, p.is_default) for p in points]
        errors = [
            _spot(p.value, p.row.position_error_m, p.is_default) for p in points if p.row.position_error_m
        ]
        sweeps.append(
            {
                "name": sweep.name,
                "option": sweep.option,
                "sentence": shown.sentence,
                "success": small_multiple(f"Success over {label}", label, rates, 1.0, "believed"),
                "error": small_multiple(
                    f"Final position error over {label}", label, errors, None, "predicted"
                ),
            }
        )
    write_page(folder / "index.html", "study_sensitivity.html", sweeps=sweeps, **study_values(study))


def _spot(value: Any, measured: Any, is_default: bool) -> Spot:
    label = ("yes" if value else "no") if isinstance(value, bool) else f"{value:g}"
    return Spot(label, measured.value, measured.low, measured.high, is_default)
