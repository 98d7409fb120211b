"""Driving a path by odometry, with the ring of eight watching the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.planning.echoes import EchoMemory
from sonar_explore.planning.passing import Passing
from sonar_explore.planning.straight import StraightBit
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
        self._echoes = EchoMemory(body, points)
        self._passing = Passing(body)
        self._ticks = 0
        self._listened = False

    def follow(self, path: Array) -> DriveReport:
        """Drive along a path, shape (n, 2), map frame, [m]; stop where something is in the way."""
        self._ticks = 0
        self._since_glance = math.inf
        for x, y in path[1:]:
            report = self._to(float(x), float(y))
            if report is not None:
                return report
        return DriveReport(DriveEnd.ARRIVED, np.zeros((0, 2)))

    def forget(self) -> None:
        """A scan was taken: what the ring heard before is on the map now, or was nothing."""
        self._echoes.forget()
        self._passing.forget()
        self._listened = False

    def walls_passed(self) -> Array:
        """Pieces of wall that the ring was sure of since the last scan, shape (n, 4), map frame, [m]."""
        return self._passing.walls()

    def _to(self, x: float, y: float) -> DriveReport | None:
        """One straight bit; None once there."""
        cfg, body = self._config, self._body
        self._here = self._pose()
        while self._ticks < cfg.most_ticks:
            here = self._here
            distance = math.sqrt((x - here.x) * (x - here.x) + (y - here.y) * (y - here.y))
            error = wrap_angle(math.atan2(y - here.y, x - here.x) - here.heading)
            if distance <= cfg.arrived_m or (distance <= 2.0 * cfg.arrived_m and abs(error) > math.pi / 2):
                return None
            far = distance > 3.0 * cfg.arrived_m
            enough = cfg.aligned_rad if far else max(cfg.aligned_rad, 0.5)
            if abs(error) > enough:
                self._turn([self._turn_rate(error)] * self._surely_turning(abs(error) - enough))
                continue
            if not self._listened:  # a wall close ahead: the disc that hears it may not have fired since
                self._turn([0.0] * len(body.sonars))
                self._listened = True
                continue
            room = body.radius_m + cfg.side_m
            if far and self._since_glance >= self._echoes.glance_after_m(here, room, cfg.glance_every_m):
                self._glance()
                continue
            ahead = min(cfg.brake_m, distance)
            obstacle = self._echoes.in_the_way(here, ahead, room)
            if obstacle is not None:
                return DriveReport(DriveEnd.BLOCKED, obstacle)
            if not self._go_on(x, y, distance):
                speed = min(cfg.speed_m_s, distance / body.ping_interval_s)
                self._tick(speed, self._turn_rate(error) if far else 0.0)
                self._since_glance += speed * body.ping_interval_s
            if self._robot.bumper:
                return DriveReport(DriveEnd.BUMPED, np.array([[body.radius_m + 0.02, 0.0]]))
        return None

    def _go_on(self, x: float, y: float, distance: float) -> bool:
        """The ticks from here to where there is something to decide, in one call; False where that cannot be had."""
        drive_straight = getattr(self._robot, "drive_straight", None)
        belief = self._belief() if drive_straight else None
        if drive_straight is None or self._poses is None or belief is None:
            return False
        cfg = self._config
        to_glance = cfg.glance_every_m - self._since_glance
        left = min(distance, to_glance if to_glance > 0.0 else math.inf)
        ticks = math.ceil(left / (cfg.speed_m_s * self._body.ping_interval_s)) + 2
        bit = StraightBit(
            steering=(x, y, *self._steering),
            since_glance_m=self._since_glance,
            belief=belief,
            echoes=self._echoes,
            most_ticks=min(ticks, cfg.most_ticks - self._ticks),
        )
        odometry, rings = drive_straight(bit)
        if not len(odometry):
            return False
        self._ticks += len(odometry)
        self._since_glance = bit.since_glance_m
        poses = self._poses(odometry)
        self._here = Pose(*poses[-1].tolist())
        self._passing.note(poses, rings)
        return True

    def _glance(self) -> None:
        """Turn a little left and right, and let every disc fire there: the gaps between their axes are swept."""
        full = self._body.turn_rate_max_rad_s * self._body.ping_interval_s
        ticks = math.ceil(self._config.glance_rad / full)
        rate = self._config.glance_rad / (ticks * self._body.ping_interval_s)
        listen = [0.0] * len(self._body.sonars)
        self._turn([rate] * ticks + listen + [-rate] * 2 * ticks + listen + [rate] * ticks)
        self._since_glance = 0.0

    def _surely_turning(self, more_rad: float) -> int:
        """How many ticks at the full rate turn by less than this, even as the belief has them; 1 at least."""
        full = self._body.turn_rate_max_rad_s * self._body.ping_interval_s
        ticks = math.floor((more_rad - full) / (1.1 * full))
        return max(1, min(ticks, self._config.most_ticks - self._ticks))

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

    def _turn_rate(self, error_rad: float) -> float:
        rate = error_rad / self._body.ping_interval_s
        return max(-self._body.turn_rate_max_rad_s, min(self._body.turn_rate_max_rad_s, rate))
