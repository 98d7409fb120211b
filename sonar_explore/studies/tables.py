"""A study as tables: cells of text, for Markdown, the terminal and the pages alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sonar_explore.studies.results import Row, Study
from sonar_explore.studies.statistics import Median, Rate
from sonar_explore.studies.success import GOAL


@dataclass(frozen=True)
class Table:
    """A heading and rows of text."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def words(self) -> tuple[bool, ...]:
        """Which columns hold words, to be set to the left; the others hold numbers."""
        return tuple(any(row[i][:1].isalpha() for row in self.rows) for i in range(len(self.columns)))

    def only(self, names: Mapping[str, str]) -> Table:
        """Some columns, by their names, under other names: what fits a terminal."""
        places = [self.columns.index(name) for name in names]
        return Table(tuple(names.values()), tuple(tuple(row[i] for i in places) for row in self.rows))

    def markdown(self) -> str:
        """As a pipe table."""
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        return "\n".join(
            "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
        )


COLUMNS = (
    "world",
    "arm",
    "success [95 %]",
    "wall error [m]",
    "final position error [m]",
    "explored",
    "loop closed",
    "scans",
    "failures by cause",
)


def table_of(study: Study) -> Table:
    """One row for each world and arm."""
    return Table(COLUMNS, tuple(_cells(row) for row in study.rows))


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.world.removeprefix("paper/"),
        row.variant,
        rate_text(row.success),
        median_text(row.wall_error_m),
        median_text(row.position_error_m),
        "-" if row.explored is None else f"{100 * row.explored.value:.1f} %",
        "-" if row.loops is None else f"{row.loops.successes} of {row.loops.n}",
        "-" if row.scans is None else f"{row.scans:.0f}",
        causes_text(row),
    )


def rate_text(rate: Rate) -> str:
    """`98 of 100 [93, 99] %`"""
    return f"{rate.successes} of {rate.n} [{100 * rate.low:.0f}, {100 * rate.high:.0f}]"


def median_text(median: Median | None) -> str:
    """`0.045 [0.041, 0.049]`"""
    return "-" if median is None else f"{median.value:.3f} [{median.low:.3f}, {median.high:.3f}]"


def causes_text(row: Row) -> str:
    """`wall error 5, contact 2`"""
    return ", ".join(f"{cause} {count}" for cause, count in row.causes.items()) or "none"


def goal_lines(study: Study, variant: str = "chain") -> list[str]:
    """Says plainly where the goal is reached and where it is missed, and why."""
    rows = [row for row in study.rows if row.variant == variant]
    missed = [row for row in rows if row.misses_goal]
    goal = f"The goal is {100 * GOAL:.0f} of 100 with `{variant}` in each world"
    seeds = f"seeds 0 to {study.seeds - 1}" if study.seeds > 1 else "seed 0"
    if not missed:
        return [f"{goal}: it is reached in all {len(rows)} of them, {seeds}."]
    lines = [f"{goal}. With {seeds} it is missed in {len(missed)} of {len(rows)}:"]
    lines += [
        f"- **{row.world}**: {row.success.successes} of {row.success.n}; failures by cause: {causes_text(row)}."
        for row in missed
    ]
    errors = sorted({error for row in rows for error in row.errors})
    return lines + [f"- raised: `{error}`" for error in errors]


def brief_table(study: Study) -> Table:
    """What fits a terminal."""
    table = table_of(study)
    chosen = [COLUMNS.index(name) for name in (*COLUMNS[:3], COLUMNS[8])]
    errors = [(_short(row.wall_error_m), _short(row.position_error_m)) for row in study.rows]
    rows = [tuple(row[i] for i in chosen) for row in table.rows]
    rows = [(*row[:3], *pair, *row[3:]) for row, pair in zip(rows, errors, strict=True)]
    return Table((*COLUMNS[:3], "wall [m]", "final [m]", "failures"), tuple(rows))


def pooled_table(study: Study, of: Sequence[str]) -> Table:
    """One row for each arm, one column for each world: success, then the median final position error."""
    columns = ("arm", *(w.removeprefix("paper/") for w in study.worlds), "all worlds", "wall error [m]")
    return Table(columns, tuple(_pooled(study, name) for name in of))


def _pooled(study: Study, name: str) -> tuple[str, ...]:
    from sonar_explore.studies.results import row_of

    rows = [study.row(world, name) for world in study.worlds]
    whole = row_of([o for o in study.outcomes if o.variant == name])
    return (
        name,
        *(f"{r.success.successes} of {r.success.n}, {_short(r.position_error_m)} m" for r in rows),
        f"{rate_text(whole.success)}, {_short(whole.position_error_m)} m",
        median_text(whole.wall_error_m),
    )


def _short(median: Median | None) -> str:
    return "-" if median is None else f"{median.value:.2f}"
