"""The ring scan beside the paper's: the same worlds, robots and luck; success, accuracy and time."""

from __future__ import annotations

from statistics import median
from typing import Any

from sonar_explore.episodes.files import write_atomically
from sonar_explore.studies import progress
from sonar_explore.studies.jobs import Variant
from sonar_explore.studies.results import Study
from sonar_explore.studies.study import Choices, run_variants
from sonar_explore.studies.tables import Table, causes_text, rate_text

SLAMS = ("chain", "smoothed")
SCANS: dict[str, tuple[tuple[str, Any], ...]] = {
    "turn": (),
    "turn, one sonar": (("simulator.scan_all_discs", False),),
    "ring": (("scan", "ring"),),
}
"""What differs: a full turn with all sonars recorded, one with the paper's one sonar, and the ring scan."""
VARIANTS = tuple(
    Variant(f"{slam}, {scan}", slam=slam, changes=changes)
    for slam in SLAMS
    for scan, changes in SCANS.items()
)
BRIEFLY = {
    "world": "world",
    "SLAM, scan": "SLAM, scan",
    "success [95 %]": "success [95 %]",
    "mean position error [m]": "mean [m]",
    "time [min]": "min",
}
"""What the terminal shows of the columns."""
COLUMNS = (
    "world",
    "SLAM, scan",
    "success [95 %]",
    "wall error [m]",
    "mean position error [m]",
    "final position error [m]",
    "scans",
    "driven [m]",
    "time [min]",
    "failures by cause",
)


def run_ring_scan(choices: Choices) -> Study:
    """Run what is missing; leave `table.md` in the folder."""
    study = run_variants("ring-scan", choices, VARIANTS, keep_record=False)
    table = ring_table(study)
    write_atomically(choices.out / "table.md", f"# Ring scan\n\n{table.markdown()}\n".encode())
    progress.show_table(table.only(BRIEFLY))
    progress.say(f"table: {choices.out / 'table.md'}")
    return study


def ring_table(study: Study) -> Table:
    """One row for each world and arm: medians over the seeds."""
    return Table(COLUMNS, tuple(_cells(study, w, v.name) for w in study.worlds for v in VARIANTS))


def _cells(study: Study, world: str, name: str) -> tuple[str, ...]:
    row = study.row(world, name)
    found = [o.summary for o in study.outcomes if (o.world, o.variant) == (world, name) and o.summary]
    if not found:
        return (world.removeprefix("paper/"), name, rate_text(row.success), *["-"] * 6, causes_text(row))
    return (
        world.removeprefix("paper/"),
        name,
        rate_text(row.success),
        f"{median(s.wall_error_m or 0.0 for s in found):.3f}",
        f"{median(s.position_error_m.mean for s in found):.3f}",
        f"{median(s.position_error_m.final for s in found):.3f}",
        f"{median(s.scans for s in found):.0f}",
        f"{median(s.path_length_m for s in found):.0f}",
        f"{median(s.sim_time_s for s in found) / 60:.1f}",
        causes_text(row),
    )
