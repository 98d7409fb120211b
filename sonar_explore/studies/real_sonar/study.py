"""Real sonar: what is extracted from recorded scans, and whether SLAM on them mends an odometry that errs.

The recordings and their layouts: docs/replay.md. `imperial_nxt` has a known arena: five scans at hand-placed
waypoints, known to a few centimetres, are one run. The odometry between them is made up, with the errors of a preset.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sonar_explore.envs.odometry import OdometryError, noise_preset
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose, Segment, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.replay.layouts import imperial_placement, read_logs
from sonar_explore.replay.log import Log
from sonar_explore.replay.play import Replay, replay
from sonar_explore.sensors import sensor_preset
from sonar_explore.slam.features import FeatureConfig
from sonar_explore.studies.real_sonar.fit import BeamFit, Likeness, fit_beam, likeness, twins
from sonar_explore.studies.real_sonar.walls import Verdict, judged

SLAMS = ("off", "literal", "chain", "smoothed")
NOISES = ("paper", "worn")
WHEEL_BASE_M = 0.23
STEP_M, STEP_RAD = 0.02, math.radians(2.0)
"""Odometry is told this often."""
FITTED = ("good", "fair")
"""Scans whose poses the walls confirm: only these are judged for extraction, and fitted to."""


@dataclass(frozen=True, eq=False)
class ScanSet:
    """The five scans of one folder and name."""

    log: Log
    verdicts: tuple[Verdict, ...]
    quality: tuple[str, ...]
    """Of each scan, by how well its pose could be fitted to the walls: good, fair or poor."""

    @property
    def name(self) -> str:
        """Who recorded it."""
        _, folder, scans = self.log.about.split(", ")
        return f"{folder.split('__')[0]}, {scans}"


@dataclass(frozen=True)
class PoseErrors:
    """Of one set, noise and SLAM: over the scans after the first, then over the seeds."""

    scans: str
    noise: str
    slam: str
    position_m: Array
    """Mean over the scans, of each seed."""
    heading_deg: Array
    """Mean over the scans, of each seed."""


@dataclass(frozen=True, eq=False)
class RealSonar:
    """Everything that the study found."""

    walls: tuple[Segment, ...]
    sets: tuple[ScanSet, ...]
    errors: tuple[PoseErrors, ...]
    beam: BeamFit
    likenesses: tuple[Likeness, ...]
    shown: tuple[Replay, ...]
    """Of each set, with `chain` and the odometry of seed 0 at `paper`."""
    others: tuple[Replay, ...]
    """Recordings without known walls."""
    seeds: int


def study_real_sonar(data: Path, seeds: int) -> RealSonar:
    """Read `data`, the folder that holds `imperial_nxt` and, if they are there, the others."""
    folder = data / "imperial_nxt" if (data / "imperial_nxt").is_dir() else data / "sonar" / "imperial_nxt"
    files = sorted(folder.glob("*/*.dat"))
    if not files:
        raise SonarExploreError(f"{data} holds no imperial_nxt/*/*.dat; name the folder of the recordings")
    walls = arena(folder / "arena_walls_lab.txt")
    sensor = sensor_preset("nxt")
    sets = tuple(_scan_set(log, files, walls, sensor.slam.features) for log in read_logs(files))
    known = [v for s in sets for v, q in zip(s.verdicts, s.quality, strict=True) if q in FITTED]
    if not known:
        raise SonarExploreError(f"{folder}/INDEX.tsv names no scan whose pose is known")
    alike = [likeness("recorded", known)]
    for name in ("nxt", "amigobot"):
        physics = replace(sensor_preset(name).sonar, range_max_m=sensor.sonar.range_max_m)
        alike.append(likeness(f"simulated, {name}", twins(known, walls, physics), known))
    rest = [*sorted(folder.parent.glob("handheld_maxbotix/*.csv")), *folder.parent.glob("pioneer8/poses.txt")]
    return RealSonar(
        walls=walls,
        sets=sets,
        errors=tuple(_errors(s, noise, slam, seeds) for s in sets for noise in NOISES for slam in SLAMS),
        beam=fit_beam(known),
        likenesses=tuple(alike),
        shown=tuple(replay(with_odometry(s.log, "paper", 0), "chain") for s in sets),
        others=tuple(replay(log, "off") for log in read_logs(rest)),
        seeds=seeds,
    )


def arena(file: Path) -> tuple[Segment, ...]:
    """Walls of the arena: a line `(x1,y1,x2,y2)` each, in centimetres."""
    try:
        lines = file.read_text(encoding="utf-8").split()
        return tuple(Segment(*(float(v) / 100 for v in line.strip("()").split(","))) for line in lines)
    except (OSError, ValueError, TypeError) as error:
        raise SonarExploreError(f"cannot read the arena's walls from {file}: {error}") from error


def _scan_set(log: Log, files: Iterable[Path], walls: Sequence[Segment], features: FeatureConfig) -> ScanSet:
    prefix = log.about.split(", ")[1:]
    own = [f for f in files if [f.parent.name, f.stem.rstrip("_0123456789")] == prefix]
    placements = sorted((imperial_placement(f) for f in own), key=lambda p: p.waypoint)
    verdicts = [
        judged(scan, placement.fitted or placement.reference, walls, features)
        for scan, placement in zip(log.scans, placements, strict=True)
    ]
    return ScanSet(log, tuple(verdicts), tuple(p.quality for p in placements))


def with_odometry(log: Log, noise: str, seed: int) -> Log:
    """The log with an odometry that errs: turn towards the next waypoint, drive there, turn to where the scan begins.

    A preset says how far the truth is off what the odometry tells. Here the truth is known and the odometry is made
    from it, with the same errors the other way round.
    """
    preset, rng = noise_preset(noise), np.random.default_rng(seed)
    wheels = OdometryError(preset, WHEEL_BASE_M, rng)
    assert log.reference is not None
    told = log.reference[0]
    entries: list[Pose | Scan] = [replace(log.scans[0], pose_robot_in_odometry=told)]
    for before, after, scan in zip(log.reference, log.reference[1:], log.scans[1:], strict=False):
        for forward, turn in _steps(before, after):
            true_forward, true_turn = wheels.true_motion(forward, turn)
            told = told @ Pose(2.0 * forward - true_forward, 0.0, 2.0 * turn - true_turn)
            entries.append(told)
        entries.append(replace(scan, pose_robot_in_odometry=told))
    return replace(log, entries=tuple(entries))


def _steps(before: Pose, after: Pose) -> list[tuple[float, float]]:
    """(forward [m], turn [rad]) in small bits."""
    way = math.atan2(after.y - before.y, after.x - before.x)
    turns = [wrap_angle(way - before.heading), wrap_angle(after.heading - way)]
    bits = [_bits(turn, STEP_RAD) for turn in turns]
    return [
        *((0.0, bit) for bit in bits[0]),
        *((bit, 0.0) for bit in _bits(before.distance_to(after), STEP_M)),
        *((0.0, bit) for bit in bits[1]),
    ]


def _bits(whole: float, most: float) -> list[float]:
    count = max(1, math.ceil(abs(whole) / most))
    return [whole / count] * count


def _errors(scans: ScanSet, noise: str, slam: str, seeds: int) -> PoseErrors:
    found = []
    for seed in range(seeds):
        errors = replay(with_odometry(scans.log, noise, seed), slam).errors
        assert errors is not None
        found.append((errors[1:, 0].mean(), math.degrees(errors[1:, 1].mean())))
    position, heading = np.array(found).T
    return PoseErrors(scans.name, noise, slam, position, heading)
