"""The AmigoBot: body, sonar array and speeds, from its vendor's parameter file (READING section 1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sonar_explore.geometry import Pose


def _mount(x_mm: float, y_mm: float, heading_deg: float) -> Pose:
    return Pose(x_mm / 1000.0, y_mm / 1000.0, math.radians(heading_deg))


@dataclass(frozen=True)
class AmigoBot:
    """What the simulator and the robot's own software both know about the body."""

    radius_m: float = 0.18
    """Radius of the smallest disc about the turning axis that covers the body, [m]."""
    wheel_base_m: float = 0.23
    """Distance between the wheels, [m]."""
    speed_max_m_s: float = 0.5
    """[m/s]"""
    turn_rate_max_rad_s: float = math.radians(50.0)
    """[rad/s]"""
    ping_interval_s: float = 0.04
    """One disc fires every 40 ms, 320 ms for all eight, [s]."""
    sonars: tuple[Pose, ...] = (
        _mount(76, 100, 90),
        _mount(125, 75, 41),
        _mount(150, 30, 15),
        _mount(150, -30, -15),
        _mount(125, -75, -41),
        _mount(76, -100, -90),
        _mount(-140, -58, -145),
        _mount(-140, 58, 145),
    )
    """The eight discs, `pose_sonar_in_robot`."""
    scan_sonar: int = 2
    """The disc kept during a rotating scan. Its offset bends the constant depth by 6 mm only."""
    range_min_m: float = 0.20
    """Nearest reliable range (section III.F), [m]."""
    range_reliable_m: float = 2.00
    """Farthest reliable range (section III.F), [m]."""
    range_max_m: float = 5.00
    """Reported where nothing was heard, [m]."""
