"""`ablation`: every departure from the paper off alone."""

from __future__ import annotations

from sonar_explore.episodes.files import write_atomically
from sonar_explore.studies import progress
from sonar_explore.studies.departures import ablation_variants
from sonar_explore.studies.results import Study
from sonar_explore.studies.study import Choices, run_variants
from sonar_explore.studies.tables import pooled_table


def run_ablation(choices: Choices) -> Study:
    """Every departure from the paper off alone, and all of them."""
    from sonar_explore.reports.study import write_ablation

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
