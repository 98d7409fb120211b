"""What a study found: `results.json`, and one row for each world and arm."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import msgspec

from sonar_explore import __version__
from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.files import write_atomically
from sonar_explore.episodes.record import Summary
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.jobs import Outcome, Variant, code_fingerprint
from sonar_explore.studies.statistics import Median, Rate, median, rate
from sonar_explore.studies.success import GOAL, LARGEST_WALL_ERROR_M, LEAST_EXPLORED, Cause, causes_of_failure


class Row(msgspec.Struct, frozen=True):
    """One world in one arm, over the seeds."""

    world: str
    variant: str
    success: Rate
    wall_error_m: Median | None
    """Of the episodes that ended without an exception, as are the rest."""
    position_error_m: Median | None
    """At the end of the episode."""
    worst_position_error_m: float | None
    explored: Median | None
    loops: Rate | None
    """Closed; None where the world has none."""
    scans: float | None
    """Median."""
    causes: dict[str, int]
    """Failures by cause; one episode can have several."""
    errors: list[str]
    """What was raised, each once."""

    @property
    def misses_goal(self) -> bool:
        """Fewer successes than the goal asks for."""
        return self.success.value < GOAL


class Study(msgspec.Struct, frozen=True):
    """Everything that a study found, and what it was run with."""

    kind: str
    """`reproduce`, `ablation` or `sensitivity`."""
    version: str
    code: str
    """Fingerprint of the source that ran."""
    noise: str
    seeds: int
    worlds: list[str]
    variants: list[dict[str, Any]]
    """Name, slam and changed options of each arm, in order."""
    criteria: dict[str, float]
    config: dict[str, Any]
    """Of every arm, before its changes."""
    rows: list[Row]
    outcomes: list[Outcome]

    def row(self, world: str, variant: str) -> Row:
        """The row of a world and an arm."""
        return next(r for r in self.rows if (r.world, r.variant) == (world, variant))

    def of(self, world: str, variant: str) -> list[Outcome]:
        """By seed."""
        return [o for o in self.outcomes if (o.world, o.variant) == (world, variant)]


def study_of(
    kind: str,
    outcomes: Sequence[Outcome],
    *,
    worlds: Sequence[str],
    variants: Sequence[Variant],
    seeds: int,
    noise: str,
    base: ExplorationConfig,
) -> Study:
    """Put the outcomes in order and sum them up."""
    places = {(w, v.name): (i, j) for i, w in enumerate(worlds) for j, v in enumerate(variants)}
    ordered = sorted(outcomes, key=lambda o: (places[o.world, o.variant], o.seed))
    groups = groupby(ordered, key=lambda o: (o.world, o.variant))
    return Study(
        kind=kind,
        version=__version__,
        code=code_fingerprint(),
        noise=noise,
        seeds=seeds,
        worlds=list(worlds),
        variants=[{"name": v.name, "slam": v.slam, "changes": dict(v.changes)} for v in variants],
        criteria={
            "least_explored": LEAST_EXPLORED,
            "largest_wall_error_m": LARGEST_WALL_ERROR_M,
            "goal": GOAL,
        },
        config=msgspec.to_builtins(base.with_noise(noise)),
        rows=[row_of(list(group)) for _, group in groups],
        outcomes=ordered,
    )


def row_of(outcomes: Sequence[Outcome]) -> Row:
    """Sum up one arm in one world."""
    summaries = [o.summary for o in outcomes if o.summary]
    causes = [causes_of_failure(o.summary) for o in outcomes]
    counts = Counter(cause for found in causes for cause in found)
    return Row(
        world=outcomes[0].world,
        variant=outcomes[0].variant,
        success=rate(sum(not found for found in causes), len(outcomes)),
        wall_error_m=median([s.wall_error_m for s in summaries if s.wall_error_m is not None]),
        position_error_m=median([s.position_error_m.final for s in summaries]),
        worst_position_error_m=max((s.position_error_m.final for s in summaries), default=None),
        explored=median([s.explored_fraction for s in summaries]),
        loops=_loops(summaries),
        scans=_middle([s.scans for s in summaries]),
        causes={cause.value: counts[cause] for cause in Cause if counts[cause]},
        errors=sorted({o.error for o in outcomes if o.error}),
    )


def _loops(summaries: Sequence[Summary]) -> Rate | None:
    closed = [s.loop_closed for s in summaries if s.loop_closed is not None]
    return rate(sum(closed), len(closed)) if closed else None


def _middle(values: Sequence[int]) -> float | None:
    found = median([float(v) for v in values])
    return found.value if found else None


def save_study(study: Study, path: Path) -> None:
    """Write `results.json`."""
    write_atomically(path, msgspec.json.format(msgspec.json.encode(study), indent=1))


def load_study(path: Path) -> Study:
    """Read `results.json`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Study)
    except (OSError, msgspec.DecodeError) as error:
        raise SonarExploreError(f"{path} is no study: {error}") from error
