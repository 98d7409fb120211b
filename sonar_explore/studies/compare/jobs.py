"""One drive of the comparison: recorded once, fed to every SLAM; what is finished is kept, as it can be stopped."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import msgspec

from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.files import write_atomically
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.slam import SlamConfig
from sonar_explore.studies.compare import accuracy as accuracies
from sonar_explore.studies.compare import drives, oracle
from sonar_explore.studies.compare.accuracy import Accuracy, accuracy, replay
from sonar_explore.studies.compare.drives import record_drive
from sonar_explore.studies.episode import one_line
from sonar_explore.studies.jobs import Job, Variant

ORACLE = "oracle"
REPLAYED = ("off", "literal", "chain", "smoothed", "grid-pf", "scan-match")
ARMS = (*REPLAYED, ORACLE)


class DriveOutcome(msgspec.Struct, frozen=True):
    """What every SLAM made of one drive."""

    world: str
    noise: str
    seed: int
    fingerprint: str
    true_poses: list[tuple[float, float]]
    """x y of every scan, [m]."""
    driven_m: float
    arms: dict[str, Accuracy]
    error: str | None
    """What was raised, in one line; the arms are none then."""


@dataclass(frozen=True)
class DriveJob:
    """One drive to be recorded and replayed."""

    world: str
    noise: str
    seed: int
    base: ExplorationConfig

    @property
    def config(self) -> ExplorationConfig:
        """What the drive is recorded and replayed with."""
        return self.base.with_noise(self.noise)

    @property
    def path(self) -> Path:
        """Of its outcome, within the study's folder."""
        world = self.world.strip("/.").replace("/", "-")
        return Path("drives") / self.noise / world / f"{self.seed:04d}.json"

    @property
    def fingerprint(self) -> str:
        """The same for the same drive, SLAMs and scores."""
        episode = Job(
            self.world, Variant("truth", slam="truth"), self.seed, self.noise, self.base
        ).fingerprint
        return hashlib.sha256((episode + _scoring_code() + ",".join(ARMS)).encode()).hexdigest()[:16]


@cache
def _scoring_code() -> str:
    """Of what records, scores and solves here: the studies are not part of an episode's fingerprint."""
    digest = hashlib.sha256()
    for module in (drives, oracle, accuracies):
        digest.update(Path(str(module.__file__)).read_bytes())
    return digest.hexdigest()


def drive_jobs(
    worlds: Sequence[str], noises: Sequence[str], seeds: int, base: ExplorationConfig
) -> list[DriveJob]:
    """Seed by seed, so that a study that was cut short has all worlds."""
    return [DriveJob(w, n, s, base) for s in range(seeds) for n in noises for w in worlds]


def finished_drive(job: DriveJob, folder: Path) -> tuple[DriveOutcome | None, bool]:
    """(the outcome if it is there, whether this code and configuration made it)"""
    try:
        outcome = msgspec.json.decode((folder / job.path).read_bytes(), type=DriveOutcome)
    except (OSError, msgspec.DecodeError):
        return None, False
    return outcome, outcome.fingerprint == job.fingerprint


def run_drive(job: DriveJob, folder: Path, fingerprint: str) -> DriveOutcome:
    """Record, replay, score and keep; an exception is an outcome too."""
    path = folder / job.path
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        outcome = compared(job, fingerprint)
    except Exception as raised:
        outcome = DriveOutcome(job.world, job.noise, job.seed, fingerprint, [], 0.0, {}, one_line(raised))
    write_atomically(path, msgspec.json.encode(outcome))
    return outcome


def compared(job: DriveJob, fingerprint: str = "") -> DriveOutcome:
    """One drive through every SLAM."""
    config = job.config
    drive = record_drive(job.world, job.noise, job.seed, config)
    scorer = Scorer(drive.world)
    robust = SlamConfig.robust()
    truth = oracle.oracle(drive, config.simulator.noise, robust.features, robust.agreement)
    arms = {name: replay(drive, name, truth, scorer, config) for name in REPLAYED}
    arms[ORACLE] = accuracy(drive, truth.poses, truth.features, scorer, config, (0, 0), 0.0)
    driven = sum(a.distance_to(b) for a, b in zip(drive.true_poses, drive.true_poses[1:], strict=False))
    return DriveOutcome(
        world=job.world,
        noise=job.noise,
        seed=job.seed,
        fingerprint=fingerprint,
        true_poses=[(round(p.x, 4), round(p.y, 4)) for p in drive.true_poses],
        driven_m=round(driven, 3),
        arms=arms,
        error=None,
    )
