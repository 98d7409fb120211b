"""What a robot can do: the one interface that the simulator offers and a real AmigoBot could."""

from __future__ import annotations

from typing import Protocol

from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan


class Robot(Protocol):
    """Drive, listen, scan. Nothing here knows where the robot truly is.

    A robot whose own computer can steer it may have one method more, as the simulator does:
    `drive_leg(leg: Leg)` drives along a leg of the way by the decisions of `sonar_explore.planning.leg`, and returns
    what `turn` does, with one reading more wherever another corner is set out for. Others are steered tick by tick,
    with the same result.
    """

    @property
    def pose_robot_in_odometry(self) -> Pose:
        """Integrated wheel odometry; the heading is not wrapped."""
        ...

    @property
    def ring_m(self) -> Array:
        """Latest echo of each of the eight discs, shape (8,), [m]; maximum range where nothing was heard."""
        ...

    @property
    def bumper(self) -> bool:
        """Whether the last tick was stopped by a touch."""
        ...

    def tick(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        """Drive at these speeds for one ping interval; the next disc of the ring fires at its end."""
        ...

    def turn(self, turn_rates_rad_s: Array) -> tuple[Array, Array]:
        """Tick on the spot at each of these rates, shape (n,), n > 0: `pose_robot_in_odometry`, x y [m] heading [rad],
        shape (n, 3), and `ring_m`, shape (n, 8), after each."""
        ...

    def scan(self, direction: int) -> Scan:
        """Turn once on the spot, +1 counter-clockwise or -1 clockwise: what the kept sonar heard (section IV), and with
        it in `others` what the rest did, where they were recorded."""
        ...

    def ring_scan(self, direction: int) -> Scan:
        """Turn by the ring's widest gap, +1 counter-clockwise or -1 clockwise, all sonars listening in turn."""
        ...
