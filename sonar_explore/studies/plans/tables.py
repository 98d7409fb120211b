"""What `explore-plans` found, as sentences and tables."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from sonar_explore.studies.plans.results import PlansStudy, Run
from sonar_explore.studies.statistics import median, rate
from sonar_explore.studies.success import LEAST_EXPLORED
from sonar_explore.studies.tables import Table, median_text, rate_text

GOAL = 0.95  # of the runs explore enough
MOST_RATIO = 1.5
AREAS_M2 = (0.0, 50.0, 75.0, 125.0, 200.0, 400.5, np.inf)


def goal_lines(study: PlansStudy) -> list[str]:
    """Each part of the goal, and whether it is reached."""
    runs = [run for run in study.runs if run.group != "whole plans"]
    done = [run.summary for run in runs if run.summary]
    explored = rate(sum(s.explored_fraction >= LEAST_EXPLORED for s in done), len(runs))
    contacts = sum(s.contacts > 0 for s in done)
    limit = sum(s.end_reason == "scan_limit" for s in done)
    ratios = [run.ratio for run in runs if run.ratio is not None]
    within = rate(sum(r <= MOST_RATIO for r in ratios), len(ratios))

    def verdict(reached: bool) -> str:
        """In a word."""
        return "reached" if reached else "missed"

    return [
        f"- {100 * LEAST_EXPLORED:.0f} % explored in {100 * GOAL:.0f} % of the runs: "
        f"{verdict(explored.value >= GOAL)}, {rate_text(explored)} %.",
        f"- No contact: {verdict(contacts == 0)}, {contacts} of {len(runs)} runs touched something.",
        f"- No end by the limit of {study.max_scans} scans: {verdict(limit == 0)}, {limit} of {len(runs)} did.",
        f"- At most {MOST_RATIO} times the tour with the map known: {verdict(within.value == 1.0)}; "
        f"the median is {median_text(median(ratios))}, and {rate_text(within)} % of the runs that explored enough "
        "cost no more.",
        f"- {len(runs) - len(done)} runs ended with an exception.",
        *(f"- Left out: {line}" for line in study.unread),
    ]


GROUP_COLUMNS = (
    "buildings",
    "runs",
    ">= 97 % explored [95 %]",
    "no contact",
    "ended by itself",
    "explored",
    "scans",
    "driven / tour",
)
BRIEFLY = {
    "buildings": "buildings",
    "runs": "runs",
    ">= 97 % explored [95 %]": ">= 97 % explored",
    "driven / tour": "driven / tour",
}
"""What the terminal shows of the columns."""


def group_table(study: PlansStudy) -> Table:
    """One row for each kind of building, and one for all but the whole plans."""
    groups = list(dict.fromkeys(run.group for run in study.runs))
    rows = [_group_cells(name, [r for r in study.runs if r.group == name]) for name in groups]
    together = [r for r in study.runs if r.group != "whole plans"]
    return Table(GROUP_COLUMNS, (*rows, _group_cells("all up to 400 m2", together)))


def _group_cells(name: str, runs: Sequence[Run]) -> tuple[str, ...]:
    done = [run.summary for run in runs if run.summary]
    n = len(runs)
    return (
        name,
        str(n),
        rate_text(rate(sum(s.explored_fraction >= LEAST_EXPLORED for s in done), n)),
        rate_text(rate(sum(s.contacts == 0 for s in done), n)),
        rate_text(rate(sum(s.end_reason != "scan_limit" for s in done), n)),
        median_text(median([s.explored_fraction for s in done])),
        "-" if not done else f"{np.median([s.scans for s in done]):.0f}",
        median_text(median([run.ratio for run in runs if run.ratio is not None])),
    )


PLAN_COLUMNS = (
    "building",
    "m2",
    "good runs",
    "explored",
    "ends",
    "contacts",
    "scans",
    "driven [m]",
    "/ tour",
)


def plan_table(study: PlansStudy) -> Table:
    """One row for each building; the generated ones by kind. Medians, but for the worst explored and all contacts."""
    kinds: dict[str, list[Run]] = {}
    for run in study.runs:
        name = run.building if run.group != "generated" else f"generated {run.building.split('-')[0]}"
        kinds.setdefault(name, []).append(run)
    return Table(PLAN_COLUMNS, tuple(_plan_cells(name, runs) for name, runs in kinds.items()))


def _plan_cells(name: str, runs: Sequence[Run]) -> tuple[str, ...]:
    done = [run.summary for run in runs if run.summary]
    ends = sorted({s.end_reason for s in done})
    if not done:
        return (name, f"{runs[0].area_m2:.0f}", f"0 of {len(runs)}", "-", "exception", "-", "-", "-", "-")
    ratios = [run.ratio for run in runs if run.ratio is not None]
    return (
        name,
        f"{np.median([run.area_m2 for run in runs]):.0f}",
        f"{sum(not run.misses for run in runs)} of {len(runs)}",
        f"{100 * min(s.explored_fraction for s in done):.1f} %",
        ", ".join(f"{end} {sum(s.end_reason == end for s in done)}" for end in ends),
        str(sum(s.contacts for s in done)),
        f"{np.median([s.scans for s in done]):.0f}",
        f"{np.median([s.path_length_m for s in done]):.0f}",
        f"{np.median(ratios):.2f}" if ratios else "-",
    )


def growth_table(study: PlansStudy) -> Table:
    """Processor time of a decision by the area of the building."""
    rows = []
    for low, high in itertools.pairwise(AREAS_M2):
        runs = [r for r in study.runs if low <= r.area_m2 < high and r.decision_s is not None]
        if runs:
            areas = [run.area_m2 for run in runs]
            times = median([run.decision_s for run in runs if run.decision_s is not None])
            rows.append((f"{min(areas):.0f} to {max(areas):.0f}", str(len(runs)), median_text(times)))
    return Table(("reachable area [m2]", "runs", "time of a decision near the end [s]"), tuple(rows))
