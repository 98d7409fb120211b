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
from sonar_explore.studies.compare.accuracy import Accuracy
from sonar_explore.studies.compare.jobs import ARMS, DriveOutcome
from sonar_explore.studies.jobs import code_fingerprint
from sonar_explore.studies.results import Row
from sonar_explore.studies.statistics import Median, median

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
        """The spread of a value over the drives."""
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


def load_comparison(path: Path) -> Comparison:
    """Read `results.json`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Comparison)
    except (OSError, msgspec.DecodeError) as error:
        raise SonarExploreError(f"{path} is no comparison: {error}") from error
