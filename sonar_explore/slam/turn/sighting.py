"""What one scan heard of a wall or a point that the map knows: an observation of the smoother."""

from __future__ import annotations

from typing import NamedTuple

from sonar_explore.slam.features import Feature
from sonar_explore.slam.turn.columns import PointKind
from sonar_explore.slam.turn.points import Point


class Sighting(NamedTuple):
    """A wall on a chain, or a point, as one scan heard it."""

    scan: int
    what: int
    """The chain, or the number of the point."""
    bearing_rad: float
    """Of the normal or of the point, as the odometry has it, robot frame at the start of the scan, [rad]."""
    sweep_rad: float
    """How far the robot had turned when it heard it, signed, [rad]."""
    range_m: float
    """[m]"""
    discs: int = 1
    """How many discs heard it."""
    radius_m: float = 0.0
    """Of a column, as its width tells it; 0 for a thin point, and for a wall, [m]."""
    kind: PointKind = PointKind.EDGE
    """Of a point."""

    @classmethod
    def of(cls, scan: int, what: int, heard: Feature | Point, turn_error: float) -> Sighting:
        """As the odometry has it; the bearing that was heard is already free of this relative error of the turn."""
        bearing = heard.bearing_rad - heard.sweep_rad * turn_error
        seen = scan, what, bearing, heard.sweep_rad, heard.range_m, heard.discs
        return cls(*seen, heard.radius_m, heard.kind) if isinstance(heard, Point) else cls(*seen)
