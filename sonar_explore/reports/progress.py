"""What a terminal shows: a live line while an episode runs, and tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sonar_explore.episodes.record import StepRecord, Summary
from sonar_explore.wording import counted

ENDS = {
    "explored": "explored: nothing is left that it believes worth a scan",
    "stuck": "stuck: the way to a place that it believes worth a scan stayed shut",
    "scan_limit": "at the limit of scans",
}
"""What each end means."""


@contextmanager
def live_line() -> Iterator[Callable[[StepRecord], None]]:
    """A spinner on stderr; call what it gives with each step."""
    console = Console(stderr=True, highlight=False)
    with console.status("starting; the first run of all compiles for half a minute") as status:
        yield lambda step: status.update(Text(step_line(step)))


def step_line(step: StepRecord) -> str:
    """Scans, explored share and position error, in one line."""
    error = math.dist(step.pose[:2], step.true_pose[:2])
    return (
        f"scan {step.index + 1}  explored {100 * step.explored_fraction:.0f} %  position error {error:.2f} m"
    )


def summary_table(summary: Summary) -> Table:
    """The figures of an episode that a reader asks for first."""
    position, heading = summary.position_error_m, summary.heading_error_deg
    rows = [
        ("ended", ENDS.get(summary.end_reason, summary.end_reason)),
        ("explored", f"{100 * summary.explored_fraction:.1f} % in {counted(summary.scans, 'scan')}"),
        ("driven", f"{summary.path_length_m:.1f} m, {counted(summary.contacts, 'contact')}"),
        (
            "position error",
            f"{position.final:.3f} m at the end, mean {position.mean:.3f}, max {position.max:.3f}",
        ),
        (
            "heading error",
            f"{heading.final:.1f} deg at the end, mean {heading.mean:.1f}, max {heading.max:.1f}",
        ),
        ("walls on the map", f"{100 * summary.wall_recall:.0f} %"),
        ("chains", f"{summary.chains}, {summary.dangling_chains} dangling, {summary.merges} merged"),
    ]
    if summary.loop_closed is not None:
        rows.append(("loop", "closed" if summary.loop_closed else "open"))
    title = (
        f"{summary.world}, {summary.agent}, slam {summary.slam}, noise {summary.noise}, "
        f"{summary.sensor}, {summary.scan} scan, seed {summary.seed}"
    )
    table = Table(title=Text(title), title_justify="left", show_header=False, box=box.SIMPLE)
    for label, value in rows:
        table.add_row(Text(label, style="dim"), Text(value))
    return table


def list_table(rows: list[dict[str, Any]]) -> Table:
    """Rows of like dicts; yes and no for truth."""
    table = Table(box=box.SIMPLE)
    for name in rows[0] if rows else []:
        table.add_column(name, justify="right" if type(rows[0][name]) is int else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(_cell(value)) for value in row.values()))
    return table


def print_table(table: Table) -> None:
    """To stdout, as it is: no colours for numbers, no markup in names."""
    Console(highlight=False, markup=False).print(table)


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)
