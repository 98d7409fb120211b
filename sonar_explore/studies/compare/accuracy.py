"""How far a SLAM was off on a recorded drive; the definitions are in docs/comparison.md."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import msgspec
import numpy as np

from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.record import Pose3, Stats
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.mapping.looks import look_of
from sonar_explore.mapping.occupancy import OccupancyMapper
from sonar_explore.slam import Feature, ScanUpdate, Slam, make_slam
from sonar_explore.slam.dual import surviving
from sonar_explore.studies.compare.drives import Drive
from sonar_explore.studies.compare.oracle import OracleResult

AGAIN_M, AFTER_M = 0.5, 8.0
"""Two scans this near to one another, with this much way between them, visit one place twice, [m]."""

SAME_RAD, SAME_M = math.radians(8.0), 0.03
"""Two extractions of one scan, straightened differently, differ by no more in a feature's bearing and range."""


class Accuracy(msgspec.Struct, frozen=True):
    """One SLAM on one drive."""

    position_error_m: Stats
    """Absolute trajectory error over the scans, placed by the start pose."""
    heading_error_deg: Stats
    aligned_error_m: float
    """Mean position error after the best rigid alignment of the whole trajectory."""
    gap_m: float | None
    """Between two visits of one place, mean; None where no place was visited twice."""
    wall_error_m: float | None
    """Of the grid drawn from the scans at the poses found."""
    associations: int
    """That corrected something; 0 for who associates nothing."""
    false_associations: int
    """Of them, those of walls on two different lines, or of a wall and something that is none."""
    update_ms: float
    """Processor time of a scan's update with the odometry before it, mean, [ms]."""
    poses: list[Pose3]
    """Of every scan, as last believed."""


def replay(
    drive: Drive, name: str, truth: OracleResult, scorer: Scorer, config: ExplorationConfig
) -> Accuracy:
    """Feed a drive to a SLAM."""
    slam = make_slam(name, drive.world.start, config.slam)
    judge = _Judge(truth)
    spent, way = 0.0, list[Pose]()
    for entry in drive.log:
        if isinstance(entry, Pose):
            way.append(entry)
            continue
        odometry = np.array([pose.as_row() for pose in way])
        began = time.process_time()
        if way:
            slam.predict_along(odometry)
        update = slam.update(entry)
        spent += time.process_time() - began
        judge.see(slam, update)
        way.clear()
    scans = slam.scans
    features = [entry.features for entry in scans]
    found = [entry.pose for entry in scans]
    counts = (judge.associations, judge.false) if name in ASSOCIATING else (0, 0)
    return accuracy(drive, found, features, scorer, config, counts, 1e3 * spent / len(scans))


ASSOCIATING = ("literal", "chain", "smoothed")
"""Those whose associations correct the pose."""


def accuracy(
    drive: Drive,
    poses: Sequence[Pose],
    features: Sequence[Sequence[Feature]],
    scorer: Scorer,
    config: ExplorationConfig,
    associations: tuple[int, int],
    update_ms: float,
) -> Accuracy:
    """Poses of a drive's scans against the truth.

    Args:
        associations: how many, and how many of them false.
    """
    found = np.array([(p.x, p.y, p.heading) for p in poses])
    true = np.array([(p.x, p.y, p.heading) for p in drive.true_poses])
    position = np.hypot(*(found - true)[:, :2].T)
    turn = found[:, 2] - true[:, 2]
    heading = np.degrees(np.abs(np.arctan2(np.sin(turn), np.cos(turn))))
    return Accuracy(
        position_error_m=_stats(position),
        heading_error_deg=_stats(heading),
        aligned_error_m=round(aligned_error(found[:, :2], true[:, :2]), 6),
        gap_m=revisit_gap(found[:, :2], true[:, :2]),
        wall_error_m=_wall_error(drive, poses, features, scorer, config),
        associations=associations[0],
        false_associations=associations[1],
        update_ms=round(update_ms, 4),
        poses=[(round(p.x, 4), round(p.y, 4), round(p.heading, 5)) for p in poses],
    )


def aligned_error(found: Array, true: Array) -> float:
    """Mean distance of points, shape (n, 2), [m], after the rigid motion that brings them closest (Umeyama 1991)."""
    a, b = true - true.mean(axis=0), found - found.mean(axis=0)
    angle = math.atan2(float((b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]).sum()), float((a * b).sum()))
    c, s = math.cos(angle), math.sin(angle)
    return float(np.hypot(*(b @ np.array([[c, s], [-s, c]]) - a).T).mean())


def revisit_gap(found: Array, true: Array) -> float | None:
    """How differently two visits place the robot, mean over the places visited twice, [m]; points of shape (n, 2)."""
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true, axis=0).T))])
    apart = np.hypot(true[:, None, 0] - true[None, :, 0], true[:, None, 1] - true[None, :, 1])
    first, second = np.nonzero((apart <= AGAIN_M) & (driven[None, :] - driven[:, None] >= AFTER_M))
    if not len(first):
        return None
    gaps = (found[second] - found[first]) - (true[second] - true[first])
    return round(float(np.hypot(*gaps.T).mean()), 6)


def _wall_error(
    drive: Drive,
    poses: Sequence[Pose],
    features: Sequence[Sequence[Feature]],
    scorer: Scorer,
    config: ExplorationConfig,
) -> float | None:
    robot = config.simulator.robot
    mapper = OccupancyMapper(config.mapping, robot.radius_m, robot.range_reliable_m)
    looks = [look_of(scan, seen, config.mapping) for scan, seen in zip(drive.scans, features, strict=True)]
    grid = mapper.draw(poses, looks, [np.zeros((1, 2))] * len(poses), [])
    frame = grid.frame
    error = scorer.wall_error(grid.states, (frame.x0, frame.y0), frame.resolution_m)
    return None if error is None else round(error, 6)


class _Judge:
    """Counts false associations as they are made: a merge hides later which root was meant."""

    def __init__(self, truth: OracleResult) -> None:
        self._truth = truth
        self.associations = 0
        self.false = 0

    def see(self, slam: Slam, update: ScanUpdate) -> None:
        """Judge the associations that one scan kept."""
        for scored in update.associations:
            if not scored.kept:
                continue
            chain = surviving(scored.association.chain, update.merges)
            root = slam.chains[chain].root
            feature = update.features[scored.association.feature]
            here, there = self._line(update.index, feature), self._line(root.scan, root.feature)
            self.associations += 1
            self.false += here != there

    def _line(self, scan: int, feature: Feature) -> int | None:
        """The line of a feature's true wall: that of the same feature as the oracle extracts it."""
        known = self._truth.features[scan]
        if not known:
            return None
        turn = np.abs(wrap_angle(np.array([f.bearing_rad for f in known]) - feature.bearing_rad)) / SAME_RAD
        gap = np.abs(np.array([f.range_m for f in known]) - feature.range_m) / SAME_M
        best = int(np.argmin(turn + gap))
        wall = self._truth.walls[scan][best] if max(turn[best], gap[best]) <= 1.0 else None
        return None if wall is None else self._truth.lines[wall]


def _stats(values: Array) -> Stats:
    return Stats(*(round(float(v), 6) for v in (values.mean(), values.max(), values[-1])))
