"""What a point is, told by how widely it is heard: an edge, a corner or a column, and how thick (beyond the paper).

A free edge answers weakly and is heard within a few degrees of the axis; a concave corner answers like a plane. A
column of radius R is between the two: sqrt(R / (R + r)) of a plane's amplitude at a distance r of its surface (READING
section 2). So the width at which a disc hears it gives R, to two fifths or so. It matters: a column answers from
another place of its surface on each side: its middle stays.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from sonar_explore.beam import Beam


class PointKind(enum.IntEnum):
    """Of a point."""

    EDGE = 0
    """Or anything as thin."""
    COLUMN = 1
    CORNER = 2


@dataclass(frozen=True)
class ColumnConfig:
    """Which points are columns."""

    thin_m: float = 0.03
    """A column of a smaller radius is as good as an edge, [m]."""
    thick_m: float = 0.35
    """What seems to have a larger radius is a corner, [m]."""
    corner_share: float = 0.62
    """As is what has more than this share of a plane's amplitude."""
    most_share: float = 2.0
    """What is heard so widely that it would have more than this times a plane's amplitude is no single point."""


def told_by_width(
    width_rad: float, range_m: float, echo_m: float, beam: Beam, config: ColumnConfig
) -> tuple[PointKind, float] | None:
    """What the point is, and its radius, [m], 0 for all but columns; None where it is no single point.

    Args:
        width_rad: over which turn it was heard, mean over the discs, [rad].
        range_m: from the turning axis, [m].
        echo_m: from the disc, mean over the discs, [m]: the disc goes round the axis, so that it turns past by more.
    """
    half = 0.5 * width_rad * range_m / echo_m
    share = beam.threshold * math.exp((half / beam.s_rad) ** 2) * echo_m
    if share > config.most_share:
        return None
    radius = echo_m * share**2 / (1.0 - share**2) if share < config.corner_share else math.inf
    if radius > config.thick_m:
        return PointKind.CORNER, 0.0
    return (PointKind.COLUMN, radius) if radius >= config.thin_m else (PointKind.EDGE, 0.0)
