"""What the robot measures: all that SLAM, map and policies ever see of the world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from sonar_explore.geometry import Array, Pose


@dataclass(frozen=True, eq=False)
class Scan:
    """Ranges all round from one place: a full turn as one sonar heard it (section IV), or a ring scan.

    The headings are what the odometry says. The robot turns by the same wrong odometry, so the
    true headings differ a little more with every reading: the scan is smeared.

    In a ring scan (beyond the paper) all sonars listen during a short turn, and each reading has its own disc.
    """

    pose_robot_in_odometry: Pose
    """Odometry when the turn began. Readings are placed in this robot frame."""
    headings_rad: Array
    """Heading of the robot at each ping, relative to the start of the turn, shape (n,), [rad]; monotonic with one
    sonar. In a ring scan the readings are in the order of their bearings."""
    ranges_m: Array
    """Distance from the sonar disc to the first echo, shape (n,), [m]; `range_max_m` where nothing was heard."""
    pose_sonar_in_robot: Pose
    """Where the disc that was kept sits on the body."""
    range_max_m: float
    """Reported where nothing was heard, [m]."""
    ring: Array | None = None
    """Of a ring scan: where the disc of each reading sits on the body, x y [m], heading [rad], shape (n, 3)."""
    others: tuple[Scan, ...] = ()
    """The same turn as the other discs heard it, one scan for each: what the paper throws away."""

    def turned(self, turn_error: float) -> Scan:
        """The scan with the headings that the robot had if it turned by so much more than it counted, relative."""
        return replace(
            self,
            headings_rad=self.headings_rad * (1.0 + turn_error),
            others=tuple(other.turned(turn_error) for other in self.others),
        )

    @cached_property
    def discs(self) -> Array:
        """Where the disc of each reading sits on the body, x y [m], heading [rad], shape (n, 3)."""
        if self.ring is not None:
            return self.ring
        disc, discs = self.pose_sonar_in_robot, np.empty((len(self.headings_rad), 3))
        discs[:] = disc.x, disc.y, disc.heading
        return discs

    @cached_property
    def levers(self) -> tuple[Array, Array]:
        """Of each reading: distance of its disc from the robot's centre [m], and its direction from there relative to
        the beam [rad]; shape (n,) each."""
        if self.ring is None:
            return _levers_of_one(self.pose_sonar_in_robot, len(self.headings_rad))
        return _levers(self.ring)

    @cached_property
    def bearings_rad(self) -> Array:
        """Direction of the beam of each reading in the robot frame, shape (n,), [rad]."""
        turned = self.pose_sonar_in_robot.heading if self.ring is None else self.ring[:, 2]
        return np.asarray(self.headings_rad, dtype=float) + turned

    @cached_property
    def step_rad(self) -> float:
        """Usual angle between the beams of two readings, [rad]."""
        return _median(np.abs(self.bearings_rad[1:] - self.bearings_rad[:-1]))

    @cached_property
    def origins(self) -> Array:
        """x y of the disc when it heard each reading, in the robot frame, shape (n, 2), [m]."""
        c, s = np.cos(self.headings_rad), np.sin(self.headings_rad)
        x, y, _ = self.discs.T
        return np.column_stack([c * x - s * y, s * x + c * y])


def _levers(discs: Array) -> tuple[Array, Array]:
    x, y, heading = discs.T
    return np.hypot(x, y), np.arctan2(y, x) - heading


@lru_cache(maxsize=64)
def _levers_of_one(disc: Pose, n: int) -> tuple[Array, Array]:
    length, direction = _levers(np.array([[disc.x, disc.y, disc.heading]]))
    return np.full(n, length[0]), np.full(n, direction[0])


def _median(values: Array) -> float:
    """`np.median` of a few numbers, without its overhead."""
    rising, n = np.sort(values).tolist(), len(values)
    return rising[n // 2] if n % 2 else 0.5 * (rising[n // 2 - 1] + rising[n // 2])
