"""The log as a file of JSON lines (docs/replay.md): a head, then one line a scan.

A log may come from anywhere: types, sizes and numbers are checked line by line, and an error is one line that
says which.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from sonar_explore.episodes.files import write_atomically
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose
from sonar_explore.measurement import Scan
from sonar_explore.replay.log import Log
from sonar_explore.sensors import sensor_preset
from sonar_explore.slam.rcd import check_scan

MAX_BYTES = 64 * 2**20
MAX_SCANS = 5000
MAX_READINGS = 720
MAX_ODOMETRY = 100_000  # poses between two scans
MAX_OTHERS = 31  # discs besides the first
FAR_M = 10_000.0

Length = Annotated[float, Meta(ge=-FAR_M, le=FAR_M)]
Angle = Annotated[float, Meta(ge=-1e6, le=1e6)]
Pose3 = tuple[Length, Length, Angle]
Readings = Annotated[list[Angle], Meta(min_length=3, max_length=MAX_READINGS)]
Ranges = Annotated[list[Annotated[float, Meta(ge=0, le=1000)]], Meta(min_length=3, max_length=MAX_READINGS)]
T = TypeVar("T")


class HeadLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The first line."""

    log: Literal["sonar_explore"]
    version: Literal[1]
    start: Pose3
    """Where the first scan is taken, in the map: x y [m], heading [rad]."""
    about: Annotated[str, Meta(max_length=200)] = ""
    sensor: Annotated[str, Meta(max_length=40)] = "amigobot"
    """A known sensor: what its beam is like."""


class DiscLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What another disc heard at the headings of the same turn."""

    sonar: Pose3
    """Where it sits on the robot: x y [m], heading [rad]."""
    ranges: Ranges
    """From it, [m]."""


class ScanLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Every other line: the way since the last scan, and the scan."""

    at: Pose3
    """Odometry when the scan began: x y [m], heading [rad]."""
    headings: Readings
    """Of the robot at each reading, relative to the start of the scan, [rad]."""
    ranges: Ranges
    """From the sonar disc, [m]; `range_max` where nothing was heard."""
    range_max: Annotated[float, Meta(gt=0, le=1000)]
    """[m]"""
    sonar: Pose3 = (0.0, 0.0, 0.0)
    """Where the disc sits on the robot: x y [m], heading [rad]."""
    ring: Annotated[list[Pose3], Meta(max_length=MAX_READINGS)] | None = None
    """Of a ring scan: where the disc of each reading sits."""
    others: Annotated[list[DiscLine], Meta(max_length=MAX_OTHERS)] = []
    """The same turn as other discs heard it."""
    odometry: Annotated[list[Pose3], Meta(max_length=MAX_ODOMETRY)] = []
    """Odometry on the way from the last scan, in order."""
    reference: Pose3 | None = None
    """Where the robot truly was, in the map, if somebody knows; for scoring alone."""


def write_log(log: Log, path: Path) -> None:
    """Every number to the last bit: a replay repeats the run. What comes after the last scan is left out."""
    head = HeadLine("sonar_explore", 1, _row(log.start), log.about[:200], log.sensor)
    lines = [msgspec.json.encode(head), *(msgspec.json.encode(line) for line in _lines(log))]
    write_atomically(path, b"\n".join([*lines, b""]))


def read_log(path: Path) -> Log:
    """Read and check.

    Raises:
        SonarExploreError: in one line, with the number of the line that is wrong.
    """
    lines = [line for line in enumerate(_content(path).split(b"\n"), start=1) if line[1].strip()]
    if not lines:
        raise SonarExploreError(f"{path} is empty; a log begins with a line that names its start pose")
    try:
        head = _decoded(path, *lines[0], HeadLine)
    except SonarExploreError as error:
        if _is_episode(lines[0][1]):
            raise SonarExploreError(
                f"{path} is the record of an episode, which keeps too little for a replay; run with --log FILE"
            ) from error
        raise SonarExploreError(
            f"{error}; a log is what `run --log` keeps, or as in docs/replay.md"
        ) from error
    if not 1 <= len(lines) - 1 <= MAX_SCANS:
        raise SonarExploreError(f"{path} has {len(lines) - 1} scans; possible: 1 to {MAX_SCANS}")
    entries: list[Pose | Scan] = []
    reference: list[Pose] = []
    for number, text in lines[1:]:
        line = _decoded(path, number, text, ScanLine)
        entries += [Pose(*pose) for pose in line.odometry]
        entries.append(_scan(path, number, line))
        reference += [Pose(*line.reference)] if line.reference else []
    if reference and len(reference) != len(lines) - 1:
        raise SonarExploreError(f"{path} has a reference pose for {len(reference)} of {len(lines) - 1} scans")
    sensor_preset(head.sensor)
    known = tuple(reference) or None
    return Log(head.about or path.name, Pose(*head.start), tuple(entries), known, head.sensor)


class _Episode(msgspec.Struct):
    """What tells an episode.json."""

    summary: msgspec.Raw
    steps: msgspec.Raw


def _is_episode(line: bytes) -> bool:
    try:
        msgspec.json.decode(line, type=_Episode)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return True


def _lines(log: Log) -> Iterator[ScanLine]:
    way: list[Pose3] = []
    references: Sequence[Pose | None] = log.reference or [None] * len(log.scans)
    known = iter(references)
    for entry in log.entries:
        if isinstance(entry, Pose):
            way.append(_row(entry))
            continue
        reference = next(known)
        yield ScanLine(
            at=_row(entry.pose_robot_in_odometry),
            headings=[float(h) for h in entry.headings_rad],
            ranges=[float(r) for r in entry.ranges_m],
            range_max=entry.range_max_m,
            sonar=_row(entry.pose_sonar_in_robot),
            ring=None if entry.ring is None else [_row(Pose(*disc)) for disc in entry.ring.tolist()],
            others=[
                DiscLine(_row(o.pose_sonar_in_robot), [float(r) for r in o.ranges_m]) for o in entry.others
            ],
            odometry=way,
            reference=None if reference is None else _row(reference),
        )
        way = []


def _row(pose: Pose) -> Pose3:
    return float(pose.x), float(pose.y), float(pose.heading)


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise SonarExploreError(f"cannot read {path}: {error.strerror}") from error
    if len(content) > MAX_BYTES:
        raise SonarExploreError(f"{path} is larger than {MAX_BYTES // 2**20} MiB")
    return content


def _decoded(path: Path, number: int, text: bytes, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SonarExploreError(f"{path} line {number}: {error}") from error


def _scan(path: Path, number: int, line: ScanLine) -> Scan:
    if line.ring is not None and len(line.ring) != len(line.ranges):
        raise SonarExploreError(
            f"{path} line {number}: {len(line.ranges)} ranges, but `ring` says where {len(line.ring)} discs sit"
        )
    scan = Scan(
        pose_robot_in_odometry=Pose(*line.at),
        headings_rad=np.array(line.headings),
        ranges_m=np.minimum(np.array(line.ranges), line.range_max),
        pose_sonar_in_robot=Pose(*line.sonar),
        range_max_m=line.range_max,
        ring=None if line.ring is None else np.array(line.ring, dtype=float).reshape(-1, 3),
    )
    others = tuple(
        replace(
            scan,
            ranges_m=np.minimum(np.array(other.ranges), line.range_max),
            pose_sonar_in_robot=Pose(*other.sonar),
            ring=None,
        )
        for other in line.others
    )
    scan = replace(scan, others=others)
    try:
        for one in (scan, *others):
            check_scan(one)
    except SonarExploreError as error:
        raise SonarExploreError(f"{path} line {number}: {error}") from error
    if math.fabs(scan.bearings_rad[-1] - scan.bearings_rad[0]) >= math.tau:
        raise SonarExploreError(f"{path} line {number}: the bearings go more than once round")
    return scan
