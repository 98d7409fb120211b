"""How wide a sonar hears what: the beam pattern that simulator and robot both know (READING section 2)."""

from __future__ import annotations

import math

S_RAD = math.radians(6.4)
"""Gaussian approximation of the 49.4 kHz piston pattern, [rad]."""
EDGE_STRENGTH = 0.1
"""k_e: amplitude of a diffracting edge, of a plane's."""
THRESHOLD = math.exp(-((12.5 / 6.4) ** 2))
"""Amplitude at which a plane 1 m away is just heard at 12.5 degrees."""


def half_angle_rad(on_axis: float) -> float:
    """Widest angle off the axis at which a source of this amplitude on the axis is heard, [rad]; 0 if never."""
    return S_RAD * math.sqrt(max(0.0, math.log(on_axis / THRESHOLD)))


def plane_half_angle_rad(range_m: float) -> float:
    """Of a plane or a right corner, A = exp(-theta^2/s^2) / r, [rad].

    >>> [round(math.degrees(plane_half_angle_rad(r)), 1) for r in (0.5, 1.0, 2.0, 5.0)]
    [13.6, 12.5, 11.3, 9.5]
    """
    return half_angle_rad(1.0 / range_m)


def edge_half_angle_rad(range_m: float) -> float:
    """Of a convex edge, A = 0.1 exp(-theta^2/s^2) / r^1.5, [rad].

    >>> [round(math.degrees(edge_half_angle_rad(r)), 1) for r in (0.5, 1.0, 2.0, 3.0)]
    [10.2, 7.9, 4.4, 0.0]
    """
    return half_angle_rad(EDGE_STRENGTH * range_m**-1.5)
