"""The pages of the ablation and of the sensitivity study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from sonar_explore.reports.page import write_page
from sonar_explore.reports.study_charts import Spot, small_multiple

if TYPE_CHECKING:
    from sonar_explore.studies.compare.results import Comparison
    from sonar_explore.studies.results import Study
    from sonar_explore.studies.sensitivity import Swept


def write_ablation(study: Study, folder: Path) -> None:
    """`index.html` of the ablation."""
    from sonar_explore.studies.departures import DEPARTURES
    from sonar_explore.studies.tables import pooled_table

    said = {d.off.name: d for d in DEPARTURES}
    names = [v["name"] for v in study.variants]
    table = pooled_table(study, names)
    lanes = [_success_spot(study, name) for name in names]
    write_page(
        folder / "index.html",
        "study_ablation.html",
        table=table,
        departures=said,
        bars=lanes,
        **study_values(study),
    )


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


def _success_spot(study: Study, name: str) -> dict[str, Any]:
    from sonar_explore.studies.results import row_of

    row = row_of([o for o in study.outcomes if o.variant == name])
    return {"name": name, "value": row.success.value, "low": row.success.low, "high": row.success.high}


def study_values(study: Study | Comparison) -> dict[str, Any]:
    """What the frame of every study's page shows: what was run, with which configuration."""
    return {
        "study": study,
        "config": msgspec.json.format(msgspec.json.encode(study.config)).decode(),
        "percent": lambda value: f"{100 * value:.0f} %",
    }
