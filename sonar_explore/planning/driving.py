"""Driving a path by odometry, with the ring of eight watching the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.planning.echoes import EchoMemory
from sonar_explore.planning.leg import (
    BLOCKED,
    BUMPED,
    GLANCE,
    LISTEN,
    MORE,
    SHUT,
    THERE,
    TURN,
    Leg,
    next_move,
)
from sonar_explore.planning.passing import Passing
from sonar_explore.robot import Robot

FEW = 6  # ticks that are not worth a call for all of them


@dataclass(frozen=True)
class DrivingConfig:
    """How the robot drives."""

    speed_m_s: float = 0.3
    """Cruising speed, [m/s]: between two echoes of one disc the robot goes 10 cm."""
    brake_m: float = 0.14
    """How far ahead the way must be clear, [m]."""
    side_m: float = 0.03
    """Room that must be left about the body, [m]."""
    arrived_m: float = 0.03
    """A corner of the path counts as reached within this, [m]."""
    aligned_rad: float = math.radians(3.0)
    """Off by more than this the robot turns on the spot, [rad]."""
    glance_rad: float = math.radians(14.0)
    """How far the robot turns left and right as it goes: the ring's gap between 41 and 90 degrees closes, [rad]."""
    glance_every_m: float = 0.4
    """How often, [m], and more often beside an edge: a wall that no disc hears comes nearer by 0.24 m at most."""
    most_ticks: int = 5000
    """No drive takes longer."""


class DriveEnd(StrEnum):
    """How a drive ended."""

    ARRIVED = "arrived"
    UNDERWAY = "underway"
    """Stopped on a long way for a scan."""
    BLOCKED = "blocked"
    BUMPED = "bumped"


@dataclass(frozen=True, eq=False)
class DriveReport:
    """How a drive ended, and where the way was shut."""

    end: DriveEnd
    obstacle: Array
    """Points in the robot frame at the end, shape (n, 2), [m]; none after arrival."""


class Driver:
    """Follows polylines. What it hears on the way it keeps until the next scan."""

    def __init__(
        self,
        robot: Robot,
        body: AmigoBot,
        pose: Callable[[], Pose],
        points: Callable[[], Array],
        config: DrivingConfig,
        poses: Callable[[Array], Array] | None = None,
        belief: Callable[[], Array | None] = lambda: None,
    ) -> None:
        """
        Args:
            robot: what drives.
            body: its shape and speeds.
            pose: where it believes to be now, `pose_robot_in_map`.
            points: edges and corners on the map now, not walls, x y, shape (n, 2), [m].
            config: how to drive.
            poses: carries that belief along several readings of the odometry, x y [m] heading [rad], shape (n, 3) both;
                None where it must be asked each time.
            belief: what `odometry_filter.carried` carries it by; None where it cannot.
        """
        self._belief = belief
        self._poses = poses
        self._robot = robot
        self._body = body
        self._pose = pose
        self._config = config
        self._steering = (
            *(config.arrived_m, config.aligned_rad, config.speed_m_s, config.brake_m),
            *(body.radius_m + config.side_m, config.glance_every_m),
            *(body.turn_rate_max_rad_s, body.ping_interval_s),
        )
        self._glance_rates = _rates_of_glance(config, body)
        self._echoes = EchoMemory(body, points)
        self._passing = Passing(body)
        self._ticks = 0
        self._listened = False

    def follow(self, path: Array) -> DriveReport:
        """Drive along a path, shape (n, 2), map frame, [m]; stop where something is in the way."""
        self._ticks, self._since_glance = 0, math.inf
        for corner, (x, y) in enumerate(path[1:].tolist()):
            self._here = self._pose()
            if corner == 0 and (leg := self._leg(path[1:])) is not None:
                return self._steered_by_robot(leg)
            report = self._to(x, y)
            if report is not None:
                return report
        return _arrived()

    def forget(self) -> None:
        """A scan was taken: what the ring heard before is on the map now, or was nothing."""
        self._echoes.forget()
        self._passing.forget()
        self._listened = False

    def walls_passed(self) -> tuple[Array, Array]:
        """Pieces of wall that the ring heard since the last scan, and those heard from near by alone, shape (n, 4)
        both, map frame, [m]."""
        return self._passing.walls()

    def _to(self, x: float, y: float) -> DriveReport | None:
        """One straight bit, tick by tick; None once there."""
        while self._ticks < self._config.most_ticks:
            pose, pieces, count = self._here.as_row(), *self._echoes.held
            corner = self._steering, x, y
            move, speed, rate, ticks = next_move(
                *corner, pose, pieces, count, self._since_glance, self._listened
            )
            if move == THERE:
                return None
            if move == SHUT:
                return self._blocked(x, y)
            if move == TURN:
                self._turn([rate] * min(ticks, self._config.most_ticks - self._ticks))
            elif move == LISTEN:
                self._turn([0.0] * len(self._body.sonars))
                self._listened = True
            elif move == GLANCE:
                self._glance()
            else:
                self._tick(speed, rate)
                self._since_glance += speed * self._body.ping_interval_s
                if self._robot.bumper:
                    return self._bumped()
        return None

    def _leg(self, corners: Array) -> Leg | None:
        """All of the way, for a robot that steers itself by its belief; None where it cannot."""
        belief = self._belief() if getattr(self._robot, "drive_leg", None) is not None else None
        if belief is None or self._poses is None:
            return None
        return Leg(
            path=np.ascontiguousarray(corners),
            steering=self._steering,
            glance_rad_s=self._glance_rates,
            belief=belief,
            echoes=self._echoes,
            most_ticks=self._config.most_ticks,
            since_glance_m=self._since_glance,
            listened=self._listened,
        )

    def _steered_by_robot(self, leg: Leg) -> DriveReport:
        drive: Callable[[Leg], tuple[Array, Array]] = self._robot.drive_leg  # type: ignore[attr-defined]
        assert self._poses is not None
        while leg.end == MORE:
            odometry, rings = drive(leg)
            if len(odometry):
                poses = self._poses(odometry)
                self._here = Pose(*poses[-1].tolist())
                self._passing.note(poses, rings)
        self._ticks, self._since_glance, self._listened = leg.ticks, leg.since_glance_m, leg.listened
        if leg.end == BLOCKED:
            return self._blocked(*leg.path[leg.corner].tolist())
        return self._bumped() if leg.end == BUMPED else _arrived()

    def _blocked(self, x: float, y: float) -> DriveReport:
        """Something is in the way to this corner."""
        ahead = min(self._config.brake_m, math.hypot(x - self._here.x, y - self._here.y))
        obstacle = self._echoes.in_the_way(self._here, ahead, self._body.radius_m + self._config.side_m)
        assert obstacle is not None
        return DriveReport(DriveEnd.BLOCKED, obstacle)

    def _bumped(self) -> DriveReport:
        return DriveReport(DriveEnd.BUMPED, np.array([[self._body.radius_m + 0.02, 0.0]]))

    def _glance(self) -> None:
        """Turn a little left and right, and let every disc fire there: the gaps between their axes are swept."""
        self._turn(self._glance_rates.tolist())
        self._since_glance = 0.0

    def _turn(self, rates_rad_s: Sequence[float]) -> None:
        """Tick on the spot at each of these rates."""
        if self._poses is None or len(rates_rad_s) < FEW:
            for rate in rates_rad_s:
                self._tick(0.0, rate)
            return
        self._ticks += len(rates_rad_s)
        odometry, rings = self._robot.turn(np.array(rates_rad_s))
        poses = self._poses(odometry)
        self._note(poses, rings)

    def _tick(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        self._ticks += 1
        self._robot.tick(speed_m_s, turn_rate_rad_s)
        self._note(np.array([self._pose().as_row()]), self._robot.ring_m[None])

    def _note(self, poses: Array, rings_m: Array) -> None:
        self._here = Pose(*poses[-1].tolist())
        self._echoes.note(poses, rings_m)
        self._passing.note(poses, rings_m)


def _arrived() -> DriveReport:
    return DriveReport(DriveEnd.ARRIVED, np.zeros((0, 2)))


def _rates_of_glance(config: DrivingConfig, body: AmigoBot) -> Array:
    """Of each tick, shape (n,), [rad/s]: to the left, to the right and back, and standing still at both ends."""
    full = body.turn_rate_max_rad_s * body.ping_interval_s
    ticks = math.ceil(config.glance_rad / full)
    rate = config.glance_rad / (ticks * body.ping_interval_s)
    listen = [0.0] * len(body.sonars)
    return np.array([rate] * ticks + listen + [-rate] * 2 * ticks + listen + [rate] * ticks)
