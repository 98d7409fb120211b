"""What the comparison found, as sentences and tables."""

from __future__ import annotations

from collections.abc import Sequence

from sonar_explore.studies.compare.jobs import ORACLE
from sonar_explore.studies.compare.results import ALL, BASELINES, LOOPS, ArmRow, Comparison, Spread
from sonar_explore.studies.results import Row
from sonar_explore.studies.tables import Table, median_text, rate_text

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
    names = ("world", "SLAM", "mean error [m]", "gap [m]", "update [ms]")
    return accuracy_table(found, noise).only({name: name for name in names})


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
