"""How wide a sonar hears what: the beam pattern that simulator and robot both know (READING section 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

S_RAD = math.radians(6.4)
"""Gaussian approximation of the 49.4 kHz piston pattern, [rad]."""
EDGE_STRENGTH = 0.1
"""k_e: amplitude of a diffracting edge, of a plane's."""
THRESHOLD = math.exp(-((12.5 / 6.4) ** 2))
"""Amplitude at which a plane 1 m away is just heard at 12.5 degrees."""


@dataclass(frozen=True)
class Beam:
    """A Gaussian pattern and a threshold; the defaults are the AmigoBot's."""

    s_rad: float = S_RAD
    """Angle off the axis at which the amplitude has fallen to 1/e, [rad]."""
    threshold: float = THRESHOLD
    """Least amplitude that is heard; a plane 1 m away on the axis has 1."""
    edge_strength: float = EDGE_STRENGTH
    """Amplitude of a diffracting edge, of a plane's."""

    def half_angle_rad(self, on_axis: float) -> float:
        """Widest angle off the axis at which a source of this amplitude on the axis is heard, [rad]; 0 if never."""
        return self.s_rad * math.sqrt(max(0.0, math.log(on_axis / self.threshold)))

    def plane_half_angle_rad(self, range_m: float) -> float:
        """Of a plane or a right corner, A = exp(-theta^2/s^2) / r, [rad].

        >>> [round(math.degrees(Beam().plane_half_angle_rad(r)), 1) for r in (0.5, 1.0, 2.0, 5.0)]
        [13.6, 12.5, 11.3, 9.5]
        """
        return self.half_angle_rad(1.0 / range_m)

    def edge_half_angle_rad(self, range_m: float) -> float:
        """Of a convex edge, A = k_e exp(-theta^2/s^2) / r^1.5, [rad].

        >>> [round(math.degrees(Beam().edge_half_angle_rad(r)), 1) for r in (0.5, 1.0, 2.0, 3.0)]
        [10.2, 7.9, 4.4, 0.0]
        """
        return self.half_angle_rad(self.edge_strength * range_m**-1.5)
