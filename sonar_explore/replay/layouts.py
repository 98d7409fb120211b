"""Recorded sonar of others, as it lies in their files, read as logs (docs/replay.md).

- `imperial_nxt`: a rotating ultrasonic sensor at five hand-placed waypoints, one `.dat` a scan, in centimetres.
- `pioneer8`: eight sonars on a driving robot, `measurement.txt` and `poses.txt`, in millimetres.
- `handheld_maxbotix`: a sensor with an IMU turned by hand on the spot, one CSV a scan.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.replay.files import MAX_READINGS, read_log
from sonar_explore.replay.log import Log

MAX_BYTES = 8 * 2**20
WAYPOINTS_M = ((0.84, 0.30), (1.80, 0.30), (1.80, 0.54), (1.38, 0.54), (1.38, 1.68))
NXT_RANGE_MAX_M = 2.55
PIONEER_BEARINGS_DEG = (-90.0, -37.5, -22.5, -7.5, 7.5, 22.5, 37.5, 90.0)
PIONEER_RANGE_MAX_M = 5.11
PIONEER_TURN_RAD = math.radians(20.0)
"""A stretch of the drive that turned this far is read as a scan: whoever does not turn hears no plateau."""
MAXBOTIX_RANGE_MAX_M = 5.0
MAXBOTIX_NEAREST_M = 0.3
"""Reported for everything nearer: it says nothing of where."""
FAR = 1e9
HOLD_S = 0.25
"""The hand-held sensor measures four times a second, the file repeats each value until the next."""
MAXBOTIX_HEAD = ("t_s", "yaw_rad", "pitch_rad", "roll_rad", "range_mm")


def read_logs(files: Sequence[Path]) -> list[Log]:
    """The logs in these files, each in the layout that its first line shows.

    Raises:
        SonarExploreError: in one line that names the file.
    """
    sets: dict[tuple[Path, str], list[Path]] = {}
    for file in (file for file in files if file.suffix == ".dat"):
        sets.setdefault((file.parent, file.stem.rstrip("0123456789")), []).append(file)
    logs = [read_imperial(scans) for scans in sets.values()]
    for file in (file for file in files if file.suffix != ".dat"):
        if file.name in ("measurement.txt", "poses.txt"):
            log = read_pioneer(file.parent)
            logs += [] if any(other.about == log.about for other in logs) else [log]
        elif file.suffix == ".csv":
            logs.append(read_maxbotix(file))
        else:
            logs.append(read_log(file))
    return logs


@dataclass(frozen=True)
class Placement:
    """What is known of how a scan of `imperial_nxt` was taken."""

    waypoint: int
    """From 0."""
    sense: int = 1
    """+1 counter-clockwise, -1 clockwise."""
    start_heading_rad: float = 0.0
    """Direction of the first reading, fitted to the walls."""
    fitted: Pose | None = None
    """Where the walls say that it was."""
    quality: str = "unknown"

    @property
    def reference(self) -> Pose:
        """The waypoint, to which the robot was put by hand."""
        return Pose(*WAYPOINTS_M[self.waypoint], self.start_heading_rad)


def read_imperial(files: Sequence[Path]) -> Log:
    """Scans in waypoint order; the odometry is the waypoints' own, without any error."""
    placed = sorted(((imperial_placement(file), file) for file in files), key=lambda pair: pair[0].waypoint)
    waypoints = [placement.waypoint for placement, _ in placed]
    if len(set(waypoints)) < len(waypoints):
        raise SonarExploreError(
            f"{files[0]} and those beside it are two scans of one waypoint (number mod 5)"
        )
    poses = [placement.reference for placement, _ in placed]
    scans = [imperial_scan(file, placement) for placement, file in placed]
    about = f"imperial_nxt, {files[0].parent.name}, {files[0].stem.rstrip('_0123456789')}"
    return Log(about, poses[0], tuple(scans), tuple(poses), sensor="nxt")


def imperial_placement(file: Path) -> Placement:
    """From the file's number and, where there is one, the INDEX.tsv of the folder above."""
    number = re.search(r"(\d+)\.dat$", file.name)
    if number is None:
        raise SonarExploreError(f"{file} has no number before .dat: it says which waypoint it is")
    waypoint = int(number[1]) % len(WAYPOINTS_M)
    index = file.resolve().parent.parent / "INDEX.tsv"
    if not index.is_file():
        return Placement(waypoint)
    rows = csv.DictReader(_text(index).splitlines(), delimiter="\t")
    name = f"{file.resolve().parent.name}/{file.name}"
    row = next((row for row in rows if row.get("file") == name), None)
    if row is None:
        return Placement(waypoint)
    try:
        heading = math.radians(float(row["start_heading_deg"]))
        fitted = Pose(float(row["fit_x_cm"]) / 100, float(row["fit_y_cm"]) / 100, heading)
        return Placement(waypoint, 1 if row["sense"] == "ccw" else -1, heading, fitted, row["quality"])
    except (KeyError, TypeError, ValueError) as error:
        raise SonarExploreError(f"{index}: the row of {name} cannot be read: {error}") from error


def imperial_scan(file: Path, placement: Placement) -> Scan:
    """One scan; the sensor turned on its motor, about the point that the waypoint names."""
    values = [line.strip("() \r").split(",")[0] for line in _text(file).splitlines() if line.strip()]
    if not 3 <= len(values) <= MAX_READINGS:
        raise SonarExploreError(f"{file} has {len(values)} readings; possible: 3 to {MAX_READINGS}")
    ranges = _numbers(file, values) / 100
    heard = (ranges > 0.0) & (ranges < NXT_RANGE_MAX_M - 0.005)
    steps = np.arange(len(ranges)) * math.tau / len(ranges)
    return Scan(
        pose_robot_in_odometry=placement.reference,
        headings_rad=placement.sense * steps,
        ranges_m=np.where(heard, ranges, NXT_RANGE_MAX_M),
        pose_sonar_in_robot=Pose(0.0, 0.0, 0.0),
        range_max_m=NXT_RANGE_MAX_M,
    )


def read_pioneer(folder: Path) -> Log:
    """Every stretch on which the robot turned by `PIONEER_TURN_RAD` as one scan, heard from along the way."""
    ranges = _table(folder / "measurement.txt", 9)[:, 1:] / 1000
    rows = _table(folder / "poses.txt", 4)
    if len(rows) != len(ranges):
        raise SonarExploreError(f"{folder} has {len(ranges)} measurements, but {len(rows)} poses")
    headings = np.unwrap(np.radians(rows[:, 3] / 10))
    places = np.column_stack([rows[:, 1:3] / 1000, headings]).tolist()
    poses = [Pose(*place) for place in places]
    scans = [_moving_scan(poses[a:b], ranges[a:b]) for a, b in turning_stretches(headings, PIONEER_TURN_RAD)]
    if not scans:
        raise SonarExploreError(f"{folder}: the robot turned nowhere by 20 degrees, and no scan can be made")
    start = scans[0].pose_robot_in_odometry
    return Log(f"pioneer8, {folder.resolve().name}", start, tuple(scans), sensor="pioneer")


def turning_stretches(headings_rad: Array, least_rad: float) -> list[tuple[int, int]]:
    """[first, end) of stretches without overlap, each as short as it can be for a turn of `least_rad` one way round."""
    stretches, first = [], 0
    for last in range(1, len(headings_rad)):
        turns = headings_rad[first : last + 1] - headings_rad[last]
        begin = first + int(np.argmax(np.abs(turns)))
        if abs(turns[begin - first]) >= least_rad:
            stretches.append((begin, last + 1))
            first = last + 1
    return stretches


def _moving_scan(poses: Sequence[Pose], ranges: Array) -> Scan:
    """Readings of all discs along a stretch as one scan from the place in its middle.

    A plane answers each disc from the foot of its normal, wherever the disc was: as in a ring scan, each reading keeps
    the place of its own disc. Of readings of one bearing the first is kept.
    """
    here = poses[len(poses) // 2]
    rows = []
    for pose, step in zip(poses, ranges, strict=True):
        for bearing, heard in zip(PIONEER_BEARINGS_DEG, step, strict=True):
            disc = here.inverse() @ pose @ Pose(0.0, 0.0, math.radians(bearing))
            rows.append((wrap_angle(disc.heading), disc.x, disc.y, min(heard, PIONEER_RANGE_MAX_M)))
    rows.sort()
    kept = [rows[0]]
    for row in rows[1:]:
        if row[0] - kept[-1][0] >= math.radians(1.0):
            kept.append(row)
    bearing, x, y, heard = np.array(kept).T
    return Scan(
        pose_robot_in_odometry=here,
        headings_rad=np.zeros(len(kept)),
        ranges_m=heard,
        pose_sonar_in_robot=Pose(0.0, 0.0, 0.0),
        range_max_m=PIONEER_RANGE_MAX_M,
        ring=np.column_stack([x, y, bearing]),
    )


def read_maxbotix(file: Path) -> Log:
    """One scan: the first full turn, or as much of it as was turned."""
    lines = _text(file).splitlines()
    if not lines or tuple(lines[0].split(",")[: len(MAXBOTIX_HEAD)]) != MAXBOTIX_HEAD:
        raise SonarExploreError(f"{file} does not begin with the columns {','.join(MAXBOTIX_HEAD)}")
    rows = [line.split(",") for line in lines[1:] if line.strip()]
    if len(rows) < 3 or any(len(row) < len(MAXBOTIX_HEAD) for row in rows):
        raise SonarExploreError(f"{file} needs three rows or more of {len(MAXBOTIX_HEAD)} columns")
    columns = np.array([_numbers(file, [row[i] for row in rows]) for i in (0, 1, 4)])
    t, yaw, ranges = columns[0], -np.unwrap(columns[1]), columns[2] / 1000
    fresh = _fresh(t, ranges)
    headings = yaw[fresh] - yaw[fresh[0]]
    spin = 1.0 if headings[np.argmax(np.abs(headings))] > 0.0 else -1.0
    onward = _onward(spin * headings)
    headings, heard = headings[onward], ranges[fresh][onward]
    deaf = (heard >= MAXBOTIX_RANGE_MAX_M) | (heard <= MAXBOTIX_NEAREST_M)
    if len(headings) < 3:
        raise SonarExploreError(f"{file}: the sensor was not turned")
    scan = Scan(
        pose_robot_in_odometry=Pose(0.0, 0.0, 0.0),
        headings_rad=headings,
        ranges_m=np.where(deaf, MAXBOTIX_RANGE_MAX_M, heard),
        pose_sonar_in_robot=Pose(0.0, 0.0, 0.0),
        range_max_m=MAXBOTIX_RANGE_MAX_M,
    )
    return Log(f"handheld_maxbotix, {file.stem}", Pose(0.0, 0.0, 0.0), (scan,), sensor="maxbotix")


def _fresh(t: Array, ranges: Array) -> list[int]:
    """Rows that hold a measurement of their own: the value has changed, or is held for longer than one lasts."""
    fresh = [0]
    for i in range(1, len(t)):
        if ranges[i] != ranges[i - 1] or t[i] - t[fresh[-1]] >= HOLD_S:
            fresh.append(i)
    return fresh


def _onward(turned: Array) -> list[int]:
    """Rows at which the sensor had turned farther than ever before, up to once round, a quarter of a degree apart."""
    onward, farthest = [], -math.inf
    for i, angle in enumerate(turned):
        if 0.0 <= angle < math.tau and angle >= farthest + math.radians(0.25):
            onward.append(i)
            farthest = float(angle)
    return onward[:MAX_READINGS]


def _table(file: Path, columns: int) -> Array:
    rows = [line.split() for line in _text(file).splitlines() if line.strip()]
    if not rows or any(len(row) != columns for row in rows):
        raise SonarExploreError(f"{file} needs {columns} numbers in every line")
    return _numbers(file, [word for row in rows for word in row]).reshape(-1, columns)


def _numbers(file: Path, words: Sequence[str]) -> Array:
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:
        raise SonarExploreError(f"{file}: {error}") from error
    if not np.isfinite(numbers).all() or np.abs(numbers).max() > FAR:
        raise SonarExploreError(f"{file} has a number that no measurement can be")
    return numbers


def _text(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise SonarExploreError(f"{file} is larger than {MAX_BYTES // 2**20} MiB")
        return content.decode("utf-8")
    except OSError as error:
        raise SonarExploreError(f"cannot read {file}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SonarExploreError(f"{file} is not text: {error.reason}") from error
