"""Odometry between two scans: what was measured, how it depends on the wheels, and how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array, Pose

NO_MOTION = np.diag([1e-6, 1e-6, 1e-8])
"""Covariance of what has hardly moved: that of x, y [m] and heading [rad] can still be inverted."""


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

    def as_arrays(self) -> tuple[Array, Array, Array, Array]:
        """All of it, in this order."""
        return self.change, self.by_wheels, self.by_own, self.covariance


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
        self._variances = np.array([walk.distance_m**2, walk.turn_rad**2, walk.drift_rad**2])
        self._own_left_rad, self._change = np.zeros(1), np.zeros(3)
        self._by = np.zeros((3, 3))
        """Derivative of the change, in columns, by the error of turns, the bend of drives and the own error."""
        self._covariance = NO_MOTION.copy()

    def clear(self, own_turn_rad: float = 0.0) -> None:
        """Begin at a new scan, whose turn of this size, signed, [rad], is about to be counted."""
        self._own_left_rad[0] = own_turn_rad
        self._change[:] = self._by[:] = 0.0
        self._covariance[:] = NO_MOTION

    def add(self, *odometry: Pose) -> None:
        """From each of these readings to the next, `pose_robot_in_odometry`: bits that are nearly straight, or turns on
        the spot."""
        self.add_along(np.array([pose.as_row() for pose in odometry]))

    def add_along(self, odometry: Array) -> None:
        """The same of readings x y [m] heading [rad], shape (n, 3)."""
        _add(
            odometry,
            self._variances,
            self._own_left_rad,
            self._change,
            self._by,
            self._covariance,
        )

    @property
    def total(self) -> Motion:
        """The motion so far."""
        by = self._by.T
        return Motion(self._change.copy(), by[:, :2].copy(), by[:, 2].copy(), self._covariance.copy())


@lean_kernel
def _add(odometry, variances, own_left, change, by, covariance):  # type: ignore[no-untyped-def]
    """Heading errors so far move the end of a bit across it: with F = I + [0 0 a; 0 0 b; 0 0 0] the derivative goes
    over into F D, the covariance P into F P F'; each row of `by` is one column of D."""
    p = covariance
    for i in range(len(odometry) - 1):
        bx, by_, bh = odometry[i, 0], odometry[i, 1], odometry[i, 2]
        c, s = math.cos(bh), math.sin(bh)
        forward = -c * bx - s * by_ + c * odometry[i + 1, 0] + s * odometry[i + 1, 1]
        turn = odometry[i + 1, 2] - bh
        heading = change[2] + 0.5 * turn
        c, s = math.cos(heading), math.sin(heading)
        a, b = -s * forward, c * forward
        own = min(max(turn, min(0.0, own_left[0])), max(0.0, own_left[0]))
        own_left[0] -= own
        for k in range(3):
            by[k, 0] += a * by[k, 2]
            by[k, 1] += b * by[k, 2]
            by[k, 2] += turn if k == 0 else forward if k == 1 else own
        distance = abs(forward)
        along = variances[0] * distance
        p[0, 0] += 2.0 * a * p[0, 2] + a * a * p[2, 2] + along * c * c
        p[0, 1] += a * p[1, 2] + b * p[0, 2] + a * b * p[2, 2] + along * c * s
        p[1, 1] += 2.0 * b * p[1, 2] + b * b * p[2, 2] + along * s * s
        p[0, 2] += a * p[2, 2]
        p[1, 2] += b * p[2, 2]
        p[2, 2] += variances[1] * abs(turn - own) / (2.0 * math.pi) + variances[2] * distance
        p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]
        change[0], change[1] = change[0] + c * forward, change[1] + s * forward
        change[2] += turn


@lean_kernel
def told_by_odometry(change, by_wheels, by_own, covariance, measured):  # type: ignore[no-untyped-def]
    """A motion as a factor of the smoother has it (`FactorKind.ODOMETRY`): what whitens it is the inverse of the
    Cholesky factor of its covariance."""
    p = covariance
    a = math.sqrt(p[0, 0])
    b, d = p[1, 0] / a, p[2, 0] / a
    c = math.sqrt(p[1, 1] - b * b)
    e = (p[2, 1] - d * b) / c
    f = math.sqrt(p[2, 2] - d * d - e * e)
    measured[0], measured[2], measured[5] = 1.0 / a, 1.0 / c, 1.0 / f
    measured[1], measured[4] = -b / (a * c), -e / (c * f)
    measured[3] = (b * e / c - d) / (a * f)
    for i in range(3):
        measured[6 + i], measured[15 + i] = change[i], by_own[i]
        measured[9 + 2 * i], measured[10 + 2 * i] = by_wheels[i, 0], by_wheels[i, 1]


def own_part(turn_rad: float, left_rad: float) -> float:
    """How much of a turn still belongs to a scan's own turn, of which this much is left; signed, [rad]."""
    return min(max(turn_rad, min(0.0, left_rad)), max(0.0, left_rad))
