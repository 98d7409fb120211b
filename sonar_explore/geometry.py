"""Planar poses, undirected lines and segments: the only place that wraps an angle.

Frames cancel in names: `pose_robot_in_map @ pose_sonar_in_robot` is `pose_sonar_in_map`.
Metres and radians throughout; x forward, y left, angles counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


@overload
def wrap_angle(angle_rad: float) -> float: ...
@overload
def wrap_angle(angle_rad: Array) -> Array: ...
def wrap_angle(angle_rad: float | Array) -> float | Array:
    """Wrap directions to (-pi, pi], [rad]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


@overload
def wrap_undirected(angle_rad: float) -> float: ...
@overload
def wrap_undirected(angle_rad: Array) -> Array: ...
def wrap_undirected(angle_rad: float | Array) -> float | Array:
    """Wrap the angle between undirected lines to (-pi/2, pi/2], [rad] (READING section 5)."""
    return math.pi / 2 - (math.pi / 2 - angle_rad) % math.pi


@dataclass(frozen=True, slots=True)
class Pose:
    """A planar rigid transform, SE(2): the pose of one frame in another."""

    x: float
    """[m]"""
    y: float
    """[m]"""
    heading: float
    """Counter-clockwise from the x axis, [rad]; not wrapped, so that full turns can be told apart."""

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: `pose_a_in_b @ pose_c_in_a` is `pose_c_in_b`."""
        return Pose(*self.place_of(other), self.heading + other.heading)

    def place_of(self, other: Pose) -> tuple[float, float]:
        """x y of `self @ other`, [m]."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y

    def inverse(self) -> Pose:
        """`pose_a_in_b.inverse()` is `pose_b_in_a`."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.heading)

    def transform(self, points: Array) -> Array:
        """Points given in this pose's own frame, shape (n, 2) [m], in the frame that holds it."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return points @ np.array([[c, s], [-s, c]]) + (self.x, self.y)

    def as_row(self) -> tuple[float, float, float]:
        """(x, y, heading), [m] and [rad]: a row of an array of poses, shape (n, 3)."""
        return self.x, self.y, self.heading

    def distance_to(self, other: Pose) -> float:
        """Distance between the two origins, [m]."""
        return math.hypot(other.x - self.x, other.y - self.y)


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of an undirected straight line between two ends, [m]."""

    x1: float
    y1: float
    x2: float
    y2: float

    @property
    def length(self) -> float:
        """[m]"""
        return math.hypot(self.x2 - self.x1, self.y2 - self.y1)

    @property
    def direction(self) -> float:
        """Direction of the undirected line, in (-pi/2, pi/2], [rad]."""
        return wrap_undirected(math.atan2(self.y2 - self.y1, self.x2 - self.x1))

    @property
    def midpoint(self) -> tuple[float, float]:
        """(x, y), [m]."""
        return 0.5 * (self.x1 + self.x2), 0.5 * (self.y1 + self.y2)

    @property
    def unit_normal(self) -> tuple[float, float]:
        """Unit normal, a quarter turn counter-clockwise from `direction`."""
        direction = self.direction
        return -math.sin(direction), math.cos(direction)

    def signed_distance(self, x: float, y: float) -> float:
        """Distance of a point from this segment's infinite line, positive on the side of `unit_normal`, [m]."""
        nx, ny = self.unit_normal
        return (x - self.x1) * nx + (y - self.y1) * ny

    def transformed(self, pose: Pose) -> Segment:
        """This segment, given in the pose's own frame, in the frame that holds the pose."""
        c, s = math.cos(pose.heading), math.sin(pose.heading)
        return Segment(
            pose.x + c * self.x1 - s * self.y1,
            pose.y + s * self.x1 + c * self.y1,
            pose.x + c * self.x2 - s * self.y2,
            pose.y + s * self.x2 + c * self.y2,
        )

    def as_row(self) -> tuple[float, float, float, float]:
        """(x1, y1, x2, y2), [m]: a row of a segment array of shape (n, 4)."""
        return self.x1, self.y1, self.x2, self.y2
