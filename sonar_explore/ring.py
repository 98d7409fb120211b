"""Ring scan (beyond the paper): all sonars listen while the robot turns by the widest gap between two of them.

The AmigoBot's ring has its widest gap, 70 degrees, at the back: a turn of 70 degrees, 35 to either side of its
middle, hears every bearing. That is a fifth of the paper's turn, and a fifth of what a wrong wheel base does to it.
One disc fires at a time, so a bearing that two discs could hear is left to the one whose arc has it nearer its middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, wrap_angle

LEAST_SPACING = 0.5  # of a step: where two arcs meet, readings closer than this are one too many


@dataclass(frozen=True, eq=False)
class RingPlan:
    """Which disc fires at which heading; readings by bearing, counter-clockwise."""

    step_rad: float
    """Turn between two headings, signed, [rad]."""
    steps: int
    """Headings at which discs fire; after the last the robot turns one step more."""
    at_step: NDArray[np.intp]
    """Step at which each reading is taken, shape (n,)."""
    disc: NDArray[np.intp]
    """Index of the disc that takes it, shape (n,)."""
    mounts: Array
    """Where that disc sits on the body, x y [m], heading [rad], shape (n, 3); full turns are added to the heading such
    that the bearings rise all the way."""

    @property
    def headings_rad(self) -> Array:
        """Heading of the robot at each reading, relative to the start of the turn, shape (n,), [rad]."""
        return self.step_rad * self.at_step

    @staticmethod
    def of(robot: AmigoBot, step_rad: float, direction: int) -> RingPlan:
        """The plan for a turn to the left (+1) or right (-1), in steps of about `step_rad`.

        >>> plan = RingPlan.of(AmigoBot(), math.radians(4.0), 1)
        >>> plan.steps, round(math.degrees(plan.steps * plan.step_rad)), len(plan.disc)
        (18, 70, 93)
        """
        mounts = np.array([disc.heading for disc in robot.sonars])
        span = _widest_gap(mounts)
        steps = math.ceil(span / step_rad - 1e-9)
        turn = direction * span / steps
        middles = mounts + 0.5 * direction * span
        disc, step = (grid.ravel() for grid in np.meshgrid(np.arange(len(mounts)), np.arange(steps)))
        bearings = wrap_angle(mounts[disc] + turn * step)
        off = np.abs(wrap_angle(bearings[:, None] - middles)).round(9)
        own = off[np.arange(len(disc)), disc] <= off.min(axis=1)
        order = [i for i in np.lexsort((disc, bearings)) if own[i]]
        kept = _spaced(bearings, order, LEAST_SPACING * abs(turn))
        rows = np.array([(disc.x, disc.y, disc.heading) for disc in robot.sonars])[disc[kept]]
        beams = rows[:, 2] + turn * step[kept]
        rows[:, 2] += math.tau * np.round((wrap_angle(beams) - beams) / math.tau)
        return RingPlan(turn, steps, step[kept], disc[kept], rows)


def _widest_gap(mounts: Array) -> float:
    """Between neighbouring discs, [rad]."""
    if len(mounts) < 2:
        raise SonarExploreError("a ring scan needs two sonars or more; turn the robot once with `turn`")
    around = np.sort(mounts % math.tau)
    return float(np.diff(np.append(around, around[0] + math.tau)).max())


def _spaced(bearings: Array, order: list[np.intp], least: float) -> NDArray[np.intp]:
    """The readings of `order`, less those too close after the one before, and at the seam."""
    kept: list[np.intp] = []
    for i in order:
        if not kept or bearings[i] - bearings[kept[-1]] >= least:
            kept.append(i)
    if bearings[kept[0]] + math.tau - bearings[kept[-1]] < least:
        kept.pop()
    return np.array(kept, dtype=np.intp)
