"""Points on which several discs agree: edges, corners and thin columns (beyond the paper).

A point answers every disc of the turning robot from one place. Each disc hears it at another heading and from another
place beside the turning axis; put where each of them heard it, the echoes fall together. Those of a plane do not: the
foot of the normal moves along the wall with the disc. What falls together is known to millimetres in range and to half
a degree in bearing, and unlike a wall it stops the robot from sliding either way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonar_explore.compiled import kernel
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.measurement import Scan
from sonar_explore.slam.discs import agreeing, aside
from sonar_explore.slam.features import FeatureConfig
from sonar_explore.slam.rcd import TIE_DECIMALS, check_scan, regions


@dataclass(frozen=True)
class PointConfig:
    """What counts as a point, and as the same one met again."""

    discs_min: int = 4
    """Fewer discs agree on nothing."""
    width_min_rad: float = math.radians(3.5)
    """A narrower region of constant depth is of nothing, [rad]."""
    width_max_rad: float = math.radians(40.0)
    """A wider one is of something that surrounds the robot, [rad]."""
    in_front_m: float = 0.05
    """What is heard to either side lies farther than the point by this, [m]."""
    together_m: float = 0.12
    """Two discs put one point no farther apart, [m]."""
    plane_share: float = 0.4
    """Places that move along with the discs by more than this share of what a plane's would are no point's."""
    near_m: float = 0.5
    """A nearer one is left out: the end of a wall, square to it, passes for a point, [m]."""


@dataclass(frozen=True)
class Point:
    """One point as one scan heard it, in the robot frame at the start of the scan."""

    bearing_rad: float
    """From the robot's centre, [rad]."""
    range_m: float
    """[m]"""
    sweep_rad: float
    """How far the robot had turned when it was heard, on average, signed, [rad]."""
    discs: int
    """How many discs agree on it."""

    def seen_from(self, pose: Pose, turn_error: float = 0.0) -> tuple[float, float]:
        """x y in the frame of the pose, [m], where the robot turned by so much more than it counted, relative."""
        angle = pose.heading + self.bearing_rad + self.sweep_rad * turn_error
        return pose.x + self.range_m * math.cos(angle), pose.y + self.range_m * math.sin(angle)


def points_of(
    scan: Scan, features: FeatureConfig, config: PointConfig
) -> tuple[tuple[Point, ...], list[tuple[Array, Array]]]:
    """The points of one scan; none where only one disc was recorded.

    Returns:
        The points; and for each of them how far the robot had turned when each disc heard it, and at what bearing, less
        the mean, [rad].
    """
    if not scan.others:
        return (), []
    heard = np.vstack([_echoes(k, disc, features, config) for k, disc in enumerate((scan, *scan.others))])
    off = np.hypot(*(heard[:, None, 1:3] - heard[None, :, 1:3]).transpose(2, 0, 1))
    apart = np.where(off <= config.together_m, off, np.inf)
    things = agreeing(apart, heard[:, 0].astype(np.int64), heard[:, 3], config.discs_min)
    found = [(_agreed(heard[members], config), heard[members]) for members in things]
    points = tuple(point for point, _ in found if point is not None)
    return points, [_swept(point, rows) for point, rows in found if point is not None]


def _swept(point: Point, heard: Array) -> tuple[Array, Array]:
    """How far the robot had turned when each disc heard it, and the bearing at which it did, less the mean, [rad]."""
    bearing = np.arctan2(heard[:, 2], heard[:, 1]) - point.bearing_rad
    return heard[:, 3], wrap_angle(bearing)


def _echoes(number: int, scan: Scan, features: FeatureConfig, config: PointConfig) -> Array:
    """What one disc heard in front of all beside it, shape (n, 5).

    The number of the disc; x y of what it heard in the middle of each region [m]; how far the robot had turned by then
    [rad]; and how far the axis of the disc passes from the turning axis [m].
    """
    check_scan(scan)
    mount, limits = scan.pose_sonar_in_robot, _limits(features, config)
    disc = np.array([mount.x, mount.y, mount.heading, aside(mount), number])
    headings, ranges = np.asarray(scan.headings_rad, dtype=float), np.asarray(scan.ranges_m, dtype=float)
    out = np.empty((len(ranges), 5))
    return out[
        : _in_front(scan.bearings_rad, headings, ranges, *scan.levers, scan.range_max_m, disc, limits, out)
    ]


@lru_cache(maxsize=4)
def _limits(features: FeatureConfig, config: PointConfig) -> Array:
    """What counts as a point, as the kernel takes it."""
    return np.array(
        [
            features.tolerance_m,
            10.0**TIE_DECIMALS,
            features.range_min_m,
            features.range_max_m,
            config.width_min_rad,
            config.width_max_rad,
            config.in_front_m,
        ]
    )


@kernel
def _in_front(bearings, headings, ranges, lever_m, lever_rad, range_max, disc, limits, out):  # type: ignore[no-untyped-def]
    """Rows of `_echoes` into `out`: how many."""
    n, clockwise = len(ranges), bearings[-1] < bearings[0]
    rows, runs = np.empty((n, 4)), np.empty((n, 2), dtype=np.int64)
    count = regions(bearings, ranges, lever_m, lever_rad, range_max, limits[0], limits[1], rows, runs)
    found = 0
    for k in range(count):
        width, echo = rows[k, 1] - rows[k, 0], rows[k, 3]
        if not (limits[4] <= width <= limits[5] and limits[2] <= echo <= limits[3]):
            continue
        first, last = runs[k, 0] % n, (runs[k, 0] + runs[k, 1] - 1) % n
        before, after = (first - 1) % n, (last + 1) % n
        if clockwise:
            first, last, before, after = n - 1 - first, n - 1 - last, n - 1 - before, n - 1 - after
        if min(ranges[before], ranges[after]) < echo + limits[6]:
            continue
        beam = 0.5 * (rows[k, 0] + rows[k, 1])
        c, s = math.cos(beam - disc[2]), math.sin(beam - disc[2])
        out[found, 0] = disc[4]
        out[found, 1] = c * disc[0] - s * disc[1] + echo * math.cos(beam)
        out[found, 2] = s * disc[0] + c * disc[1] + echo * math.sin(beam)
        out[found, 3] = 0.5 * (headings[first] + headings[last])
        out[found, 4] = disc[3]
        found += 1
    return found


def _agreed(heard: Array, config: PointConfig) -> Point | None:
    """The point that these heard, one row a disc; None where it is a plane's foot instead."""
    places, turned, beside = heard[:, 1:3], heard[:, 3], heard[:, 4]
    x, y = places.mean(axis=0)
    depth = math.hypot(x, y)
    along = (places - (x, y)) @ np.array([-y, x]) / depth
    lever = beside - beside.mean()
    scatter = float(lever @ lever)
    if depth < config.near_m or (scatter > 1e-9 and abs(float(lever @ along)) > config.plane_share * scatter):
        return None
    return Point(math.atan2(y, x), depth, float(turned.mean()), len(heard))
