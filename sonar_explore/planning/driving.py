"""Driving a path by odometry, with the ring of eight watching the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.robot import Robot


@dataclass(frozen=True)
class DrivingConfig:
    """How the robot drives."""

    speed_m_s: float = 0.3
    """Cruising speed, [m/s]: between two echoes of one disc the robot goes 10 cm."""
    brake_m: float = 0.10
    """Room that must be left before the body, [m]."""
    side_m: float = 0.02
    """Room that must be left beside the body, [m]."""
    arrived_m: float = 0.03
    """A corner of the path counts as reached within this, [m]."""
    aligned_rad: float = math.radians(3.0)
    """Off by more than this the robot turns on the spot, [rad]."""
    most_ticks: int = 5000
    """No drive takes longer."""


class DriveEnd(StrEnum):
    """How a drive ended."""

    ARRIVED = "arrived"
    UNDERWAY = "underway"
    """Stopped on a long way for a scan."""
    BLOCKED = "blocked"
    BUMPED = "bumped"


@dataclass(frozen=True)
class DriveReport:
    """How a drive ended, and where the way was shut."""

    end: DriveEnd
    obstacle: tuple[float, float] | None
    """Where, in the robot frame at the end, [m]; None after arrival."""


def drive(
    robot: Robot, body: AmigoBot, path: Array, pose: Callable[[], Pose], config: DrivingConfig
) -> DriveReport:
    """Follow a polyline, shape (n, 2), map frame, [m]; stop where something is in the way.

    Args:
        pose: where the robot believes to be now, `pose_robot_in_map`.
    """
    ticks = 0
    for x, y in path[1:]:
        while ticks < config.most_ticks:
            ticks += 1
            here = pose()
            distance = math.hypot(x - here.x, y - here.y)
            error = wrap_angle(math.atan2(y - here.y, x - here.x) - here.heading)
            if distance <= config.arrived_m or (
                distance <= 2.0 * config.arrived_m and abs(error) > math.pi / 2
            ):
                break
            if abs(error) > config.aligned_rad and (distance > 3 * config.arrived_m or abs(error) > 0.5):
                robot.tick(0.0, _turn_rate(error, body))
                continue
            obstacle = in_the_way(robot.ring_m, body, distance, config)
            if obstacle is not None:
                return DriveReport(DriveEnd.BLOCKED, obstacle)
            speed = min(config.speed_m_s, distance / body.ping_interval_s)
            robot.tick(speed, _turn_rate(error, body) if distance > 3 * config.arrived_m else 0.0)
            if robot.bumper:
                return DriveReport(DriveEnd.BUMPED, (body.radius_m + 0.02, 0.0))
    return DriveReport(DriveEnd.ARRIVED, None)


def _turn_rate(error_rad: float, body: AmigoBot) -> float:
    rate = error_rad / body.ping_interval_s
    return max(-body.turn_rate_max_rad_s, min(body.turn_rate_max_rad_s, rate))


def in_the_way(
    ring_m: Array, body: AmigoBot, ahead_m: float, config: DrivingConfig
) -> tuple[float, float] | None:
    """The nearest echo in the corridor that the body is about to sweep, robot frame, [m]; None where it is clear."""
    found: tuple[float, float] | None = None
    reach = body.radius_m + min(config.brake_m, max(ahead_m, 0.0) + 0.02)
    for echo, disc in zip(ring_m, body.sonars, strict=True):
        x = disc.x + echo * math.cos(disc.heading)
        y = disc.y + echo * math.sin(disc.heading)
        if 0.0 < x <= reach and abs(y) <= body.radius_m + config.side_m and (found is None or x < found[0]):
            found = (x, y)
    return found


def shut_at(pose_robot_in_map: Pose, obstacle: tuple[float, float]) -> Array:
    """Map points of a short bar across the heading where the way was shut, shape (n, 2), [m]."""
    x, y = obstacle
    bar = np.column_stack([np.full(5, x + 0.02), y + np.linspace(-0.1, 0.1, 5)])
    return pose_robot_in_map.transform(bar)
