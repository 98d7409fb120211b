"""What the robot measures: all that SLAM, map and policies ever see of the world."""

from __future__ import annotations

from dataclasses import dataclass

from sonar_explore.geometry import Array, Pose


@dataclass(frozen=True, eq=False)
class Scan:
    """A full turn on the spot with one sonar kept: 90 readings, 4 degrees apart (section IV).

    The headings are what the odometry says. The robot turns by the same wrong odometry, so the
    true headings differ a little more with every reading: the scan is smeared.
    """

    pose_robot_in_odometry: Pose
    """Odometry when the turn began. Readings are placed in this robot frame."""
    headings_rad: Array
    """Heading of the robot at each ping, relative to the start of the turn, shape (n,), [rad], monotonic."""
    ranges_m: Array
    """Distance from the sonar disc to the first echo, shape (n,), [m]; `range_max_m` where nothing was heard."""
    pose_sonar_in_robot: Pose
    """Where the disc that was kept sits on the body."""
    range_max_m: float
    """Reported where nothing was heard, [m]."""
