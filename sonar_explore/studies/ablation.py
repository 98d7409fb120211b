"""`ablation`: every departure from the paper off alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sonar_explore.episodes.files import write_atomically
from sonar_explore.reports.page import write_page
from sonar_explore.studies import progress
from sonar_explore.studies.departures import DEPARTURES, ablation_variants
from sonar_explore.studies.pages import study_values
from sonar_explore.studies.results import Study, row_of
from sonar_explore.studies.study import Choices, run_variants
from sonar_explore.studies.tables import pooled_table


def run_ablation(choices: Choices) -> Study:
    """Every departure from the paper off alone, and all of them."""
    variants = ablation_variants()
    study = run_variants("ablation", choices, variants, keep_record=False)
    table = pooled_table(study, [v.name for v in variants])
    write_atomically(choices.out / "table.md", f"# Ablation\n\n{table.markdown()}\n".encode())
    write_ablation(study, choices.out)
    progress.show_table(
        table.only({"arm": "arm", "all worlds": "all worlds [95 %]", "wall error [m]": "wall [m]"})
    )
    progress.say(f"page: {choices.out / 'index.html'}")
    return study


def write_ablation(study: Study, folder: Path) -> None:
    """`index.html` of the ablation."""
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


def _success_spot(study: Study, name: str) -> dict[str, Any]:
    row = row_of([o for o in study.outcomes if o.variant == name])
    return {"name": name, "value": row.success.value, "low": row.success.low, "high": row.success.high}
