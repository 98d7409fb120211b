"""What the comparison found: one row for each odometry, world and SLAM, and what it says of the goals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sonar_explore import __version__
from sonar_explore.config import ExplorationConfig
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.accuracy import Accuracy
from sonar_explore.studies.compare import ARMS, ORACLE, DriveOutcome
from sonar_explore.studies.jobs import code_fingerprint
from sonar_explore.studies.results import Row
from sonar_explore.studies.statistics import Median, median
from sonar_explore.studies.tables import Table, median_text, rate_text

COMPARISON = "compare"
ALL = "all worlds"
BASELINES = ("off", "literal", "grid-pf", "scan-match")
LOOPS = ("paper/loop", "paper/open-loop")


class Spread(msgspec.Struct, frozen=True):
    """Over the drives."""

    median: Median
    p95: float
    """95th percentile."""


class ArmRow(msgspec.Struct, frozen=True):
    """One SLAM in one world with one odometry; None where no drive has the value."""

    noise: str
    world: str
    slam: str
    position_mean_m: Spread
    position_final_m: Spread
    heading_mean_deg: Spread
    aligned_m: Spread
    gap_m: Spread | None
    wall_error_m: Spread | None
    associations: int
    """That corrected something, over all drives."""
    false_associations: int
    update_ms: float
    """Median."""


class Comparison(msgspec.Struct, frozen=True):
    """Everything but the single drives, which are files of their own."""

    kind: str
    version: str
    code: str
    noises: list[str]
    seeds: int
    worlds: list[str]
    config: dict[str, Any]
    """Before the odometry's errors are chosen."""
    rows: list[ArmRow]
    errors: list[str]
    """What drives raised, each once."""
    closed_loop_seeds: int
    closed_loop: dict[str, list[Row]]
    """By odometry: exploration with each SLAM in the loop."""

    @property
    def noise(self) -> str:
        """For the foot of a page."""
        return ", ".join(self.noises)

    def row(self, noise: str, world: str, slam: str) -> ArmRow | None:
        """None where no drive finished."""
        return next((r for r in self.rows if (r.noise, r.world, r.slam) == (noise, world, slam)), None)


def comparison_of(
    outcomes: Sequence[DriveOutcome],
    *,
    worlds: Sequence[str],
    noises: Sequence[str],
    seeds: int,
    base: ExplorationConfig,
    closed_loop_seeds: int = 0,
    closed_loop: dict[str, list[Row]] | None = None,
) -> Comparison:
    """Sum up."""
    rows = []
    for noise in noises:
        for world in (*worlds, ALL):
            drives = [o for o in outcomes if o.noise == noise and world in (o.world, ALL) and not o.error]
            rows += [_row(noise, world, slam, [o.arms[slam] for o in drives]) for slam in ARMS if drives]
    return Comparison(
        kind=COMPARISON,
        version=__version__,
        code=code_fingerprint(),
        noises=list(noises),
        seeds=seeds,
        worlds=list(worlds),
        config=msgspec.to_builtins(base),
        rows=rows,
        errors=sorted({o.error for o in outcomes if o.error}),
        closed_loop_seeds=closed_loop_seeds,
        closed_loop=closed_loop or {},
    )


def _row(noise: str, world: str, slam: str, found: Sequence[Accuracy]) -> ArmRow:
    def over(value: Callable[[Accuracy], float]) -> Spread:
        spread = _spread([value(a) for a in found])
        assert spread is not None
        return spread

    return ArmRow(
        noise=noise,
        world=world,
        slam=slam,
        position_mean_m=over(lambda a: a.position_error_m.mean),
        position_final_m=over(lambda a: a.position_error_m.final),
        heading_mean_deg=over(lambda a: a.heading_error_deg.mean),
        aligned_m=over(lambda a: a.aligned_error_m),
        gap_m=_spread([a.gap_m for a in found if a.gap_m is not None]),
        wall_error_m=_spread([a.wall_error_m for a in found if a.wall_error_m is not None]),
        associations=sum(a.associations for a in found),
        false_associations=sum(a.false_associations for a in found),
        update_ms=round(float(np.median([a.update_ms for a in found])), 3),
    )


def _spread(values: Sequence[float]) -> Spread | None:
    middle = median(values)
    return Spread(middle, round(float(np.percentile(values, 95.0)), 6)) if middle else None


COLUMNS = (
    "world",
    "SLAM",
    "mean error [m]",
    "95th pct.",
    "final error [m]",
    "95th pct.",
    "heading [deg]",
    "aligned [m]",
    "gap [m]",
    "wall error [m]",
    "false assoc.",
    "update [ms]",
)


def accuracy_table(found: Comparison, noise: str) -> Table:
    """One row for each world and SLAM."""
    return Table(COLUMNS, tuple(_cells(row) for row in found.rows if row.noise == noise))


def brief_table(found: Comparison, noise: str) -> Table:
    """What fits a terminal."""
    table = accuracy_table(found, noise)
    chosen = [COLUMNS.index(name) for name in ("world", "SLAM", "mean error [m]", "gap [m]", "update [ms]")]
    return Table(
        tuple(COLUMNS[i] for i in chosen), tuple(tuple(row[i] for i in chosen) for row in table.rows)
    )


def _cells(row: ArmRow) -> tuple[str, ...]:
    return (
        row.world.removeprefix("paper/"),
        row.slam,
        median_text(row.position_mean_m.median),
        f"{row.position_mean_m.p95:.3f}",
        median_text(row.position_final_m.median),
        f"{row.position_final_m.p95:.3f}",
        f"{row.heading_mean_deg.median.value:.2f}",
        _short(row.aligned_m),
        _short(row.gap_m),
        _short(row.wall_error_m),
        f"{100 * row.false_associations / row.associations:.1f} %" if row.associations else "-",
        "-" if row.slam == ORACLE else f"{row.update_ms:.1f}",
    )


def _short(spread: Spread | None) -> str:
    return "-" if spread is None else f"{spread.median.value:.3f}"


def closed_loop_table(found: Comparison, noise: str) -> Table:
    """Success of explorations with each SLAM in the loop: a row for each SLAM, a column for each world."""
    rows = found.closed_loop.get(noise, [])
    slams = list(dict.fromkeys(row.variant for row in rows))
    columns = ("SLAM", *(world.removeprefix("paper/") for world in found.worlds), "all")
    return Table(
        columns, tuple(_closed_cells(slam, [r for r in rows if r.variant == slam]) for slam in slams)
    )


def _closed_cells(slam: str, rows: Sequence[Row]) -> tuple[str, ...]:
    won, n = sum(r.success.successes for r in rows), sum(r.success.n for r in rows)
    return (slam, *(rate_text(r.success) for r in rows), f"{won} of {n}")


def goal_lines(found: Comparison, noise: str = "paper") -> list[str]:
    """Each goal of accuracy, and whether it is reached; one a line."""
    lines = []
    for slam, limit in (("smoothed", 1.25), ("chain", 2.0)):
        ratios = {world: _ratios(found, noise, world, slam) for world in found.worlds}
        known = {world: pair for world, pair in ratios.items() if pair}
        words = ", ".join(f"{w.removeprefix('paper/')} {m:.2f} and {p:.2f}" for w, (m, p) in known.items())
        met = sum(max(pair) <= limit for pair in known.values())
        lines.append(
            f"`{slam}` within {limit:g} of the oracle's mean error, by median and 95th percentile: "
            f"{_verdict(met, len(known))} ({words})."
        )
    lines += _loop_lines(found, noise) + _rival_lines(found, noise)
    return [line for line in lines if line]


def _ratios(found: Comparison, noise: str, world: str, slam: str) -> tuple[float, float] | None:
    row, bound = found.row(noise, world, slam), found.row(noise, world, ORACLE)
    if row is None or bound is None:
        return None
    mine, best = row.position_mean_m, bound.position_mean_m
    return mine.median.value / best.median.value, mine.p95 / best.p95


def _verdict(met: int, n: int) -> str:
    return "reached in all worlds" if met == n else f"reached in {met} of {n} worlds"


def _loop_lines(found: Comparison, noise: str) -> list[str]:
    rows = [row for w in LOOPS if w in found.worlds and (row := found.row(noise, w, "smoothed"))]
    if not rows:
        return []
    words = ", ".join(
        f"{row.world.removeprefix('paper/')} {row.position_final_m.median.value:.3f} m and {_short(row.gap_m)} m"
        for row in rows
    )
    met = sum(
        row.position_final_m.median.value <= 0.03 and row.gap_m is not None and row.gap_m.median.value <= 0.05
        for row in rows
    )
    return [
        "`smoothed` ends loops within 0.03 m, with a gap of 0.05 m at most, by median: "
        f"{_verdict(met, len(rows))} ({words})."
    ]


def _rival_lines(found: Comparison, noise: str) -> list[str]:
    mine = found.row(noise, ALL, "smoothed")
    if mine is None:
        return []
    others = {slam: row for slam in BASELINES if (row := found.row(noise, ALL, slam))}
    beaten = [s for s, r in others.items() if r.position_mean_m.median.low > mine.position_mean_m.median.high]
    words = ", ".join(f"`{s}` {r.position_mean_m.median.value:.3f} m" for s, r in others.items())
    lines = [
        f"`smoothed` is ahead of {len(beaten)} of {len(others)} baselines in mean error over all worlds, "
        f"intervals apart: {mine.position_mean_m.median.value:.3f} m against {words}."
    ]
    if "grid-pf" in others:
        times = others["grid-pf"].update_ms / mine.update_ms
        lines.append(
            f"An update of `smoothed` takes {mine.update_ms:.1f} ms, one of `grid-pf` {others['grid-pf'].update_ms:.1f}"
            f" ms: {times:.1f} times as long (goal: 10)."
        )
    worn, chain = found.row("worn", ALL, "smoothed"), found.row("paper", ALL, "chain")
    if worn and chain:
        verdict = (
            "reached" if worn.position_mean_m.median.value <= chain.position_mean_m.median.value else "missed"
        )
        lines.append(
            f"`smoothed` with `worn` wheels no worse than `chain` with the `paper`'s: {verdict} "
            f"({worn.position_mean_m.median.value:.3f} m against {chain.position_mean_m.median.value:.3f} m)."
        )
    return lines


def comparison_lines(found: Comparison) -> list[str]:
    """Goals and tables in Markdown, odometry by odometry."""
    lines: list[str] = []
    for noise in found.noises:
        lines += [f"### Odometry `{noise}`", ""]
        lines += [f"- {line}" for line in goal_lines(found, noise)] if noise == "paper" else []
        lines += ["", accuracy_table(found, noise).markdown(), ""]
        if found.closed_loop.get(noise):
            lines += [
                f"In the loop, success of {found.closed_loop_seeds} seeds [95 %]:",
                "",
                closed_loop_table(found, noise).markdown(),
                "",
            ]
    return lines + [f"- raised: `{error}`" for error in found.errors]


def load_comparison(path: Path) -> Comparison:
    """Read `results.json`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Comparison)
    except (OSError, msgspec.DecodeError) as error:
        raise SonarExploreError(f"{path} is no comparison: {error}") from error
