"""Odometry between two scans: what was measured, how it depends on the wheels, and how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.geometry import Array, Pose


@dataclass(frozen=True, eq=False)
class Motion:
    """Odometry from one scan to the next, in the frame of the first."""

    change: Array
    """x, y [m], heading [rad] as measured, shape (3,)."""
    by_wheels: Array
    """Its derivative by the error of turns and by the bend of drives [rad/m], shape (3, 2)."""
    covariance: Array
    """Of its random part, shape (3, 3)."""


@dataclass(frozen=True)
class RandomWalk:
    """Standard deviations of the random part of the odometry (READING section 3)."""

    turn_rad: float
    """Of the heading after a full turn, [rad]."""
    drift_rad: float
    """Of the heading after a metre, [rad]."""
    distance_m: float
    """Of the distance after a metre, [m]."""


class MotionSum:
    """Adds up short bits of odometry."""

    def __init__(self, walk: RandomWalk) -> None:
        self._walk = walk
        self.clear()

    def clear(self) -> None:
        """Begin at a new scan."""
        self._change = np.zeros(3)
        self._by_wheels = np.zeros((3, 2))
        self._covariance = np.diag([1e-6, 1e-6, 1e-8])

    def add(self, before: Pose, after: Pose) -> None:
        """A bit that is nearly straight, or a turn on the spot; `pose_robot_in_odometry` both."""
        step = before.inverse() @ after
        forward, turn = step.x, after.heading - before.heading
        heading = self._change[2] + 0.5 * turn
        c, s = math.cos(heading), math.sin(heading)
        moved = np.eye(3)
        moved[0, 2], moved[1, 2] = -s * forward, c * forward
        self._by_wheels = moved @ self._by_wheels
        self._by_wheels[2] += (turn, forward)
        self._covariance = moved @ self._covariance @ moved.T
        along = self._walk.distance_m**2 * abs(forward)
        self._covariance[:2, :2] += along * np.array([[c * c, c * s], [c * s, s * s]])
        self._covariance[2, 2] += self._walk.turn_rad**2 * abs(
            turn
        ) / math.tau + self._walk.drift_rad**2 * abs(forward)
        self._change = self._change + (c * forward, s * forward, turn)

    @property
    def total(self) -> Motion:
        """The motion so far."""
        return Motion(self._change.copy(), self._by_wheels.copy(), self._covariance.copy())
