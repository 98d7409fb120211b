"""A log of measurements: what SLAM was given on a run, in order of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.planning.leg import Leg
from sonar_explore.robot import Robot


@dataclass(frozen=True, eq=False)
class Log:
    """What one robot measured on one way, from a simulator or a real one."""

    about: str
    """What and where, in a line."""
    start: Pose
    """`pose_robot_in_map` at the first scan: it places the map."""
    entries: tuple[Pose | Scan, ...]
    """In order of time: scans, and `pose_robot_in_odometry` as often as SLAM was told."""
    reference: tuple[Pose, ...] | None = None
    """`pose_robot_in_map` when each scan began, as somebody outside knows it; for scoring alone."""
    sensor: str = "amigobot"
    """What heard it (`sonar_explore.sensors`)."""

    @cached_property
    def scans(self) -> tuple[Scan, ...]:
        """In order."""
        return tuple(entry for entry in self.entries if isinstance(entry, Scan))


class Recorder:
    """Notes what a robot tells its mind; `of` stands between the two."""

    def __init__(self, sensor: str = "amigobot") -> None:
        self._sensor = sensor
        self._entries: list[Pose | Scan] = []
        self.log: Log
        """There once the run is over."""

    def of(self, robot: Robot) -> Robot:
        """The same robot, overheard. Another robot, or the same on another day, begins anew."""
        self._entries = []
        return _Overheard(robot, self._entries)

    def close(self, about: str, start: Pose, reference: Sequence[Pose]) -> None:
        """The run is over; say what it was, and where the robot was at each scan."""
        self.log = Log(about, start, tuple(self._entries), tuple(reference), self._sensor)


class _Overheard:
    """Passes everything on (implements `sonar_explore.robot.Robot`)."""

    def __init__(self, robot: Robot, entries: list[Pose | Scan]) -> None:
        self._robot = robot
        self._entries = entries

    @property
    def pose_robot_in_odometry(self) -> Pose:
        """The wheels' pose, noted down: [m], [rad]."""
        pose = self._robot.pose_robot_in_odometry
        self._entries.append(pose)
        return pose

    @property
    def ring_m(self) -> Array:
        """Last range of every disc, not noted down, [m]."""
        return self._robot.ring_m

    @property
    def bumper(self) -> bool:
        """Whether the last tick touched something."""
        return self._robot.bumper

    def tick(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        """Drive for one tick at this speed, [m/s] and [rad/s]."""
        self._robot.tick(speed_m_s, turn_rate_rad_s)

    @property
    def drive_leg(self) -> Callable[[Leg], tuple[Array, Array]] | None:
        """Drive along a leg, where the robot can; each reading is noted down."""
        drive = getattr(self._robot, "drive_leg", None)
        return None if drive is None else lambda leg: self._leg_noted(*drive(leg))

    def _leg_noted(self, odometry: Array, rings_m: Array) -> tuple[Array, Array]:
        return self._noted(odometry), rings_m

    def turn(self, turn_rates_rad_s: Array) -> tuple[Array, Array]:
        """Turn on the spot tick by tick at these rates [rad/s]; the pose after each is noted down."""
        odometry, rings = self._robot.turn(turn_rates_rad_s)
        return self._noted(odometry), rings

    def scan(self, direction: int) -> Scan:
        """A full turn, +1 to the left or -1 to the right, noted down."""
        return self._note(self._robot.scan(direction))

    def ring_scan(self, direction: int) -> Scan:
        """A turn of the ring, +1 to the left or -1 to the right, noted down."""
        return self._note(self._robot.ring_scan(direction))

    def _noted(self, odometry: Array) -> Array:
        self._entries.extend(Pose(*row) for row in odometry.tolist())
        return odometry

    def _note(self, scan: Scan) -> Scan:
        self._entries.append(scan)
        return scan
