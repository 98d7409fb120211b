"""Points on which several discs agree: edges, corners and thin columns (beyond the paper).

A point answers every disc of the turning robot from one place. Each disc hears it at another heading and from another
place beside the turning axis; put where each of them heard it, the echoes fall together. Those of a plane do not: the
foot of the normal moves along the wall with the disc. What falls together is known to millimetres in range and to half
a degree in bearing, and unlike a wall it stops the robot from sliding either way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sonar_explore.beam import Beam
from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.turn.columns import ColumnConfig, PointKind, told_by_width
from sonar_explore.slam.turn.discs import adds_to_turn, agreeing
from sonar_explore.sums import dot, fma, hypot, total


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
    columns: ColumnConfig = field(default_factory=ColumnConfig)
    """Which of them are columns."""


class Point(NamedTuple):
    """One point as one scan heard it, in the robot frame at the start of the scan."""

    bearing_rad: float
    """From the robot's centre, [rad]."""
    range_m: float
    """[m]"""
    sweep_rad: float
    """How far the robot had turned when it was heard, on average, signed, [rad]."""
    discs: int
    """How many discs agree on it."""
    kind: PointKind = PointKind.EDGE
    radius_m: float = 0.0
    """Of a column, from its middle to the surface that answered, as its width tells it, [m]."""

    def seen_from(self, pose: Pose, turn_error: float = 0.0) -> tuple[float, float]:
        """x y of its middle in the frame of the pose, [m].

        Args:
            turn_error: by how much more the robot turned than it counted, relative.
        """
        angle = pose.heading + self.bearing_rad + self.sweep_rad * turn_error
        depth = self.range_m + self.radius_m
        return pose.x + depth * math.cos(angle), pose.y + depth * math.sin(angle)


def points_among(in_front: Array, beam: Beam, config: PointConfig, sums: Array) -> tuple[Point, ...]:
    """The points of one turn; what they say of the turn is added to `sums` (`discs.TurnError.of`).

    Args:
        in_front: what each disc heard in front of all beside it, the discs in order, shape (n, 7).
        beam: of the discs.
    """
    found = np.empty((len(in_front), 6))
    count = _agreed(in_front, np.arctan2(in_front[:, 2], in_front[:, 1]), _limits(config), found, sums)
    points = []
    for bearing, depth, sweep, discs, width, echo in found[:count].tolist():
        told = told_by_width(width, depth, echo, beam, config.columns)
        if told is not None:
            points.append(Point(bearing, depth, sweep, int(discs), *told))
    return tuple(points)


@lru_cache(maxsize=4)
def _limits(config: PointConfig) -> Array:
    """What counts as one point, as the kernel takes it."""
    return np.array([config.discs_min, config.together_m, config.near_m, config.plane_share])


@inner_kernel
def in_front(bearings, headings, ranges, rows, runs, count, disc, mount, limits, out, found):  # type: ignore[no-untyped-def]
    """What one disc heard in front of all beside it, into `out` from row `found` on: how many rows there are then.

    The number of the disc; x y of what it heard in the middle of each region [m]; how far the robot had turned by then
    [rad]; how far the axis of the disc passes from the turning axis [m]; over which turn it was heard, one step more
    than from its first reading to its last [rad]; and how far it was from the disc [m].
    """
    n, clockwise = len(ranges), bearings[-1] < bearings[0]
    for k in range(count):
        width, echo = rows[k, 1] - rows[k, 0], rows[k, 3]
        if not (limits[17] <= width <= limits[18] and limits[2] <= echo <= limits[3]):
            continue
        first, last = runs[k, 0] % n, (runs[k, 0] + runs[k, 1] - 1) % n
        before, after = (first - 1) % n, (last + 1) % n
        if clockwise:
            first, last, before, after = n - 1 - first, n - 1 - last, n - 1 - before, n - 1 - after
        if min(ranges[before], ranges[after]) < echo + limits[19]:
            continue
        beam = 0.5 * (rows[k, 0] + rows[k, 1])
        c, s = math.cos(beam - mount[2]), math.sin(beam - mount[2])
        out[found, 0] = disc
        out[found, 1] = c * mount[0] - s * mount[1] + echo * math.cos(beam)
        out[found, 2] = s * mount[0] + c * mount[1] + echo * math.sin(beam)
        out[found, 3] = 0.5 * (headings[first] + headings[last])
        out[found, 4] = mount[3]
        out[found, 5] = width + abs(headings[1] - headings[0])
        out[found, 6] = echo
        found += 1
    return found


@kernel
def _agreed(heard, bearings, limits, points, sums):  # type: ignore[no-untyped-def]
    """Bearing, range, sweep, discs, width and distance from the discs of each point into `points`: how many; what
    enough discs heard, one row a disc, is one where it is no plane's foot."""
    n = len(heard)
    distance, disc = np.empty((n, n)), np.empty(n, dtype=np.int64)
    for i in range(n):
        disc[i] = int(heard[i, 0])
        for j in range(i + 1):
            distance[i, j] = distance[j, i] = np.inf
            dx, dy = abs(heard[i, 1] - heard[j, 1]), abs(heard[i, 2] - heard[j, 2])
            if dx <= limits[1] and dy <= limits[1]:
                off = np.hypot(dx, dy)
                if off <= limits[1]:
                    distance[i, j] = distance[j, i] = off
    members, ends = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    count = 0
    for thing in range(agreeing(distance, disc, heard[:, 3], limits[0], members, ends)):
        rows = members[(ends[thing - 1] if thing else 0) : ends[thing]]
        x = y = 0.0
        for i in rows:
            x, y = x + heard[i, 1], y + heard[i, 2]
        x, y = x / len(rows), y / len(rows)
        depth, bearing = hypot(x, y), math.atan2(y, x)
        lever, sweep = np.empty(len(rows)), np.empty(len(rows))
        width = echo = 0.0
        for k in range(len(rows)):
            lever[k], sweep[k] = heard[rows[k], 4], heard[rows[k], 3]
            width, echo = width + heard[rows[k], 5], echo + heard[rows[k], 6]
        middle, along = total(lever) / len(rows), np.empty(len(rows))
        for k in range(len(rows)):
            lever[k] -= middle
            along[k] = fma(heard[rows[k], 1] - x, -y, (heard[rows[k], 2] - y) * x) / depth
        scatter = dot(lever, lever)
        if depth < limits[2] or (scatter > 1e-9 and abs(dot(lever, along)) > limits[3] * scatter):
            continue
        for k in range(len(rows)):
            along[k] = math.pi - (math.pi - (bearings[rows[k]] - bearing)) % (2.0 * math.pi)
        points[count, 0], points[count, 1] = bearing, depth
        points[count, 2], points[count, 3] = total(sweep) / len(rows), len(rows)
        points[count, 4], points[count, 5] = width / len(rows), echo / len(rows)
        adds_to_turn(sweep, along, sums)
        count += 1
    return count
