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
    by_own: Array
    """Its derivative by the own error of the turn of the scan that it began with, shape (3,)."""
    covariance: Array
    """Of the rest of its random part, shape (3, 3)."""


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

    def clear(self, own_turn_rad: float = 0.0) -> None:
        """Begin at a new scan, whose turn of this size, signed, [rad], is about to be counted."""
        self._own_left_rad = own_turn_rad
        self._by_own = [0.0, 0.0, 0.0]
        self._x = self._y = self._heading = 0.0
        self._by_turn, self._by_bend = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        self._xx = self._yy = 1e-6
        self._hh = 1e-8
        self._xy = self._xh = self._yh = 0.0

    def add(self, before: Pose, after: Pose) -> None:
        """A bit that is nearly straight, or a turn on the spot; `pose_robot_in_odometry` both.

        Heading errors so far move the end of the bit across it: with F = I + [0 0 a; 0 0 b; 0 0 0] the derivative
        goes over into F D, the covariance into F P F'. Written out, for this runs 25 times a simulated second.
        """
        step = before.inverse() @ after
        forward, turn = step.x, after.heading - before.heading
        heading = self._heading + 0.5 * turn
        c, s = math.cos(heading), math.sin(heading)
        a, b = -s * forward, c * forward
        own = own_part(turn, self._own_left_rad)
        self._own_left_rad -= own
        for by, more in ((self._by_turn, turn), (self._by_bend, forward), (self._by_own, own)):
            by[0] += a * by[2]
            by[1] += b * by[2]
            by[2] += more
        walk, distance = self._walk, abs(forward)
        along = walk.distance_m**2 * distance
        self._xx += 2.0 * a * self._xh + a * a * self._hh + along * c * c
        self._xy += a * self._yh + b * self._xh + a * b * self._hh + along * c * s
        self._yy += 2.0 * b * self._yh + b * b * self._hh + along * s * s
        self._xh += a * self._hh
        self._yh += b * self._hh
        self._hh += walk.turn_rad**2 * abs(turn - own) / math.tau + walk.drift_rad**2 * distance
        self._x, self._y = self._x + c * forward, self._y + s * forward
        self._heading += turn

    @property
    def total(self) -> Motion:
        """The motion so far."""
        rows = [
            [self._xx, self._xy, self._xh],
            [self._xy, self._yy, self._yh],
            [self._xh, self._yh, self._hh],
        ]
        by_wheels = np.column_stack([self._by_turn, self._by_bend])
        change = np.array([self._x, self._y, self._heading])
        return Motion(change, by_wheels, np.array(self._by_own), np.array(rows))


def own_part(turn_rad: float, left_rad: float) -> float:
    """How much of a turn still belongs to a scan's own turn, of which this much is left; signed, [rad]."""
    return min(max(turn_rad, min(0.0, left_rad)), max(0.0, left_rad))
