"""The yardstick: batch least squares over a drive's measurements with the true associations.

Odometry, features and points are the robot's own; which wall each feature and which edge or corner each point belongs
to is told from the truth. Poses, walls, points and the two constants of the wheels are unknown. It uses the truth, so
it scores others and never runs on a robot. Nothing that has the same measurements can be much better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.odometry import OdometryNoise
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array, Pose, wrap_undirected
from sonar_explore.measurement import Scan
from sonar_explore.slam.features import Feature, FeatureConfig, FeatureKind
from sonar_explore.slam.motion import Motion, MotionSum, RandomWalk
from sonar_explore.slam.slam import turn_of
from sonar_explore.slam.smoothing.smoothing import Smoother, SmoothingConfig
from sonar_explore.slam.turn.agreement import AgreementConfig, Extraction, extract
from sonar_explore.slam.turn.points import Point
from sonar_explore.slam.turn.sighting import Sighting
from sonar_explore.studies.compare.drives import Drive

TOUCH_M, STRAIGHT_RAD = 0.002, math.radians(0.5)
ONE_LINE_M, ONE_LINE_RAD = 0.02, math.radians(1.0)
STILL = 1e-5  # [m] and [rad]
MOST_ROUNDS = 20
_LEAST = 1e-5  # of a standard deviation: an ideal robot's would be none


@dataclass(frozen=True)
class OracleConfig:
    """When a feature is of a wall, and how sure a feature is."""

    distance_m: float = 0.05
    """Between the foot of its normal and the wall's line, or a point and a wall's end, seen from the true pose, [m]."""
    angle_rad: float = math.radians(6.0)
    """Between its normal and the wall's, [rad]."""
    beyond_m: float = 0.05
    """How far the foot may lie beyond the wall's end, [m]."""
    smoothing: SmoothingConfig = field(
        default_factory=lambda: SmoothingConfig(bearing_rad=math.radians(1.1), range_m=0.004)
    )
    """As features of walls were measured to be off at the true poses."""


@dataclass(frozen=True, eq=False)
class OracleResult:
    """What the oracle makes of a drive."""

    poses: tuple[Pose, ...]
    """`pose_robot_in_map` of every scan."""
    walls: tuple[tuple[int | None, ...], ...]
    """The true wall of each feature, scan by scan; None where it has none."""
    features: tuple[tuple[Feature, ...], ...]
    lines: tuple[int, ...]
    """The line that each true wall lies on."""


def oracle(
    drive: Drive,
    noise: OdometryNoise,
    features: FeatureConfig,
    agreement: AgreementConfig,
    config: OracleConfig | None = None,
) -> OracleResult:
    """Poses of a drive's scans from its measurements and their true associations."""
    config = config or OracleConfig()
    walls = straight_walls(drive.world)
    motions = _motions(drive, noise)
    turn_error = 0.0
    for _ in range(2):  # the second time with the smear of the scans taken out, as far as it was learned
        seen = [extract(scan, features, agreement, turn_error) for scan in drive.scans]
        owners = [
            true_walls(pose, found.features(), ratio / (1.0 + turn_error) - 1.0, walls, config)
            for pose, ratio, found in zip(drive.true_poses, drive.turn_ratios, seen, strict=True)
        ]
        ends = [
            true_ends(pose, found.points, ratio / (1.0 + turn_error) - 1.0, walls, config)
            for pose, ratio, found in zip(drive.true_poses, drive.turn_ratios, seen, strict=True)
        ]
        smoother = _solved(drive, motions, seen, owners, ends, turn_error, noise, config)
        turn_error = float(smoother.constants[0])
    poses = tuple(Pose(*map(float, row)) for row in smoother.poses)
    return OracleResult(poses, tuple(owners), tuple(found.features() for found in seen), lines_of(walls))


def straight_walls(world: World) -> Array:
    """The walls, pieces that touch and go on straight joined into one, shape (n, 4), [m]."""
    parts = shapely.get_parts(shapely.union_all(shapely.linestrings(world.walls.reshape(-1, 2, 2))))
    points = [shapely.get_coordinates(part) for part in parts]
    pieces = np.vstack([np.hstack([xy[:-1], xy[1:]]) for xy in points])
    direction = np.arctan2(pieces[:, 3] - pieces[:, 1], pieces[:, 2] - pieces[:, 0])
    ends = cKDTree(np.vstack([pieces[:, :2], pieces[:, 2:]]))
    touching = ends.query_pairs(TOUCH_M, output_type="ndarray") % len(pieces)
    straight = np.abs(wrap_undirected(direction[touching[:, 0]] - direction[touching[:, 1]])) <= STRAIGHT_RAD
    first, second = touching[straight].T
    together = coo_array((np.ones(len(first)), (first, second)), shape=(len(pieces), len(pieces)))
    count, group = connected_components(together, directed=False)
    return np.array([_hull(pieces[group == k]) for k in range(count)])


def lines_of(walls: Array) -> tuple[int, ...]:
    """The line that each wall, shape (n, 4), [m], lies on: walls either side of a door have one number."""
    along = (walls[:, 2:] - walls[:, :2]) / np.hypot(*(walls[:, 2:] - walls[:, :2]).T)[:, None]
    ends = walls.reshape(-1, 2, 2)
    off = ends[None] - walls[:, None, None, :2]
    across = np.abs(off[..., 0] * along[:, None, None, 1] - off[..., 1] * along[:, None, None, 0]).max(
        axis=-1
    )
    turn = np.abs(along[:, None, 0] * along[None, :, 1] - along[:, None, 1] * along[None, :, 0])
    one_line = (across <= ONE_LINE_M) & (across.T <= ONE_LINE_M) & (turn <= math.sin(ONE_LINE_RAD))
    return tuple(map(int, connected_components(one_line, directed=False)[1]))


def _hull(pieces: Array) -> Array:
    """The two ends of pieces on one line, shape (n, 4), as x1 y1 x2 y2, [m]."""
    ends = pieces.reshape(-1, 2)
    along = ends @ (pieces[0, 2:] - pieces[0, :2])
    return np.concatenate([ends[np.argmin(along)], ends[np.argmax(along)]])


def true_walls(
    true_pose: Pose, features: Sequence[Feature], smear: float, walls: Array, config: OracleConfig
) -> tuple[int | None, ...]:
    """Row of the wall that each feature is of, seen from the true pose; None where it is of none.

    Args:
        smear: true over assumed turn of the scan, less one.
    """
    return tuple(
        _true_wall(true_pose, f, f.bearing_rad + smear * f.sweep_rad, walls, config)
        if f.kind is FeatureKind.WALL
        else None
        for f in features
    )


def _true_wall(
    pose: Pose, feature: Feature, bearing: float, walls: Array, config: OracleConfig
) -> int | None:
    normal = pose.heading + bearing
    x, y = pose.x + feature.range_m * math.cos(normal), pose.y + feature.range_m * math.sin(normal)
    dx, dy = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    length = np.hypot(dx, dy)
    along = ((x - walls[:, 0]) * dx + (y - walls[:, 1]) * dy) / length
    across = np.abs((y - walls[:, 1]) * dx - (x - walls[:, 0]) * dy) / length
    turn = np.abs(wrap_undirected(np.arctan2(dy, dx) - (normal + math.pi / 2)))
    off = (across / config.distance_m) ** 2 + (turn / config.angle_rad) ** 2
    fits = (across <= config.distance_m) & (turn <= config.angle_rad)
    fits &= (along >= -config.beyond_m) & (along <= length + config.beyond_m)
    return int(np.argmin(np.where(fits, off, np.inf))) if fits.any() else None


def true_ends(
    true_pose: Pose, points: Sequence[Point], smear: float, walls: Array, config: OracleConfig
) -> tuple[int | None, ...]:
    """Which end of which wall each point is, counted two a wall, seen from the true pose; None where it is none.

    Args:
        smear: true over assumed turn of the scan, less one.
    """
    ends = walls.reshape(-1, 2)
    off = [np.hypot(*(ends - point.seen_from(true_pose, smear)).T) for point in points]
    return tuple(int(np.argmin(d)) if d.min() <= config.distance_m else None for d in off)


def _motions(drive: Drive, noise: OdometryNoise) -> list[Motion]:
    """Odometry from each scan to the next, as sure as the simulator makes it."""
    walk = RandomWalk(
        max(noise.turn_sigma_rad, _LEAST),
        max(noise.drift_sigma_rad, _LEAST),
        max(noise.distance_sigma_m, _LEAST),
    )
    motions, total, last = [], MotionSum(walk), None
    for entry in drive.log:
        here = entry if isinstance(entry, Pose) else entry.pose_robot_in_odometry
        if last is not None:
            total.add(last, here)
        last = here
        if isinstance(entry, Scan):
            motions.append(total.total)
            total.clear(turn_of(entry))
    return motions[1:]


def _solved(
    drive: Drive,
    motions: Sequence[Motion],
    seen: Sequence[Extraction],
    walls: Sequence[Sequence[int | None]],
    ends: Sequence[Sequence[int | None]],
    turn_error: float,
    noise: OdometryNoise,
    config: OracleConfig,
) -> Smoother:
    """The first guess is the truth: there is one minimum to be found, and it is near."""
    wheels = (max(abs(noise.base_ratio - 1.0), _LEAST), max(_bend(noise), _LEAST))
    smoothing = replace(config.smoothing, turn_rad=max(noise.turn_sigma_rad, _LEAST))
    out = Smoother(drive.world.start, smoothing, wheels)
    for i, pose in enumerate(drive.true_poses):
        turn = seen[i].turn
        turn = turn and replace(turn, relative=turn.relative + turn_error)
        out.add_scan(pose, motions[i - 1] if i else None, turn)
        for feature, wall in zip(seen[i].features(), walls[i], strict=True):
            if wall is not None:
                out.add_sighting(Sighting.of(i, wall, feature, turn_error))
        for point, end in zip(seen[i].points, ends[i], strict=True):
            if end is not None:
                out.add_point(Sighting.of(i, end, point, turn_error))
    for _ in range(MOST_ROUNDS):
        before = out.poses
        out.solve()
        if np.abs(out.poses - before).max() < STILL:
            break
    return out


def _bend(noise: OdometryNoise) -> float:
    """Bend of a straight drive by unequal wheels, [rad/m]."""
    return 2.0 * abs(noise.wheel_ratio - 1.0) / ((noise.wheel_ratio + 1.0) * AmigoBot.wheel_base_m)
