"""The line of a chain that corrections refer to: its root (the paper), or one estimated from all its links (beyond it).

A root keeps the bearing error of the one scan that saw it. Ranges are good to millimetres, bearings to a degree or
two: the feet of the normals seen from several positions fix a wall's direction better than any one RCD does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.geometry import Array, Segment, wrap_undirected
from sonar_explore.slam.chains import Chain

ROUNDS = 3
"""Of reweighting: feet far off the line count less each time."""


@dataclass(frozen=True)
class ReferenceConfig:
    """Root or refined line, and how far a link's foot and direction may be off."""

    refined: bool = False
    """The paper corrects to the root."""
    foot_sigma_m: float = 0.02
    """Standard deviation of a foot across the wall, by range and position, [m]."""
    direction_sigma_rad: float = math.radians(2.0)
    """Standard deviation of the direction of a link that one disc heard, [rad]."""
    direction_least_rad: float = math.radians(0.8)
    """The same, however many discs heard it: that of the pose, [rad]."""


def reference_line(chain: Chain, config: ReferenceConfig) -> Segment:
    """The segment to whose line ADR and NDR are taken."""
    root = chain.root.segment
    if not config.refined or len(chain.links) < 2:
        return root
    x, y, direction = chain.root.foot
    c, s = math.cos(direction), math.sin(direction)
    links = np.array([link.foot for link in chain.links])
    feet = links[:, :2] - (x, y)
    along, across = feet @ (c, s), feet @ (-s, c)
    turns = wrap_undirected(links[:, 2] - direction)
    discs = np.array([link.feature.discs for link in chain.links])
    offset, slope = _fit(along, across, turns, discs, config)
    half, angle = 0.5 * root.length, direction + math.atan(slope)
    mx, my = x - s * offset, y + c * offset
    dx, dy = half * math.cos(angle), half * math.sin(angle)
    return Segment(mx - dx, my - dy, mx + dx, my + dy)


def _fit(
    along: Array, across: Array, turns: Array, discs: Array, config: ReferenceConfig
) -> tuple[float, float]:
    """Offset [m] and slope of the line across = offset + slope along, with the directions as slopes too."""
    n, foot = len(along), 1.0 / config.foot_sigma_m
    rows, values = np.zeros((2 * n, 2)), np.empty(2 * n)
    rows[:n, 0], rows[:n, 1] = foot, foot * along
    rows[n:, 1] = 1.0 / np.sqrt(config.direction_sigma_rad**2 / discs + config.direction_least_rad**2)
    values[:n], values[n:] = foot * across, rows[n:, 1] * np.tan(turns)
    weights: Array = np.ones(2 * n)
    for _ in range(ROUNDS):
        solution = np.linalg.lstsq(rows * weights[:, None], values * weights, rcond=None)[0]
        off = np.abs(values - rows @ solution)
        before, weights = weights, np.sqrt(1.0 / np.maximum(1.0, off / 1.5))  # Huber
        if (weights == before).all():
            break
    return float(solution[0]), float(solution[1])
