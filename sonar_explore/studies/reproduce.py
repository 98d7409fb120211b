"""`reproduce`: the paper's runs, with and without SLAM."""

from __future__ import annotations

from collections.abc import Sequence

from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import unknown_name
from sonar_explore.slam import SLAMS
from sonar_explore.studies import progress
from sonar_explore.studies.jobs import Variant
from sonar_explore.studies.reproduce_page import write_reproduction
from sonar_explore.studies.results import Study
from sonar_explore.studies.study import Choices, run_variants
from sonar_explore.studies.tables import brief_table, goal_lines, table_of


def run_reproduction(choices: Choices, arms: Sequence[str]) -> Study:
    """The paper's runs, with and without SLAM."""
    for arm in arms:
        if arm not in SLAMS:
            raise unknown_name("arm", arm, SLAMS)
    study = run_variants("reproduce", choices, [Variant(arm, slam=arm) for arm in arms], keep_record=True)
    goal = goal_lines(study) if "chain" in arms else []
    text = "\n".join(["# The paper's runs", "", *goal, "", table_of(study).markdown(), ""])
    write_atomically(choices.out / "table.md", text.encode())
    write_reproduction(study, choices.out)
    progress.show_table(brief_table(study))
    progress.say(*goal, f"pages: {choices.out / 'index.html'}")
    return study
