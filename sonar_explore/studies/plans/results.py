"""What `explore-plans` found: one row for each run, what a failure left out and why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy import ndimage

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.load import load_world
from sonar_explore.episodes.record import EpisodeRecord, Summary
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.mapping.grid import OCCUPIED, GridFrame, Mask
from sonar_explore.reports.raster import grid_states
from sonar_explore.studies.success import LEAST_EXPLORED

KIND = "explore-plans"
LEAST_PART_M2 = 0.25
LATE = 20  # decisions at the end whose time counts: the map is largest there


class Miss(StrEnum):
    """What a run misses of the goal."""

    UNEXPLORED = "unexplored"
    CONTACT = "contact"
    SCAN_LIMIT = "scan limit"
    EXCEPTION = "exception"


class Part(msgspec.Struct, frozen=True):
    """A connected part of the reachable floor that no scan saw."""

    area_m2: float
    x: float
    """Of its innermost cell, world frame, [m]."""
    y: float
    nearest_m: float
    """How near to it the robot has truly scanned, [m]."""
    drift_m: float
    """Position error at that scan, [m]."""
    shut: bool
    """Whether the robot's last map has no way to it that is wide enough for the body."""

    @property
    def says(self) -> str:
        """One line."""
        map_says = "no way to it on the map" if self.shut else "a way to it on the map"
        return (
            f"{self.area_m2:.1f} m2 at ({self.x:.1f}, {self.y:.1f}), {map_says}; "
            f"scanned {self.nearest_m:.1f} m from it, {self.drift_m:.2f} m off then"
        )


class Run(msgspec.Struct, frozen=True):
    """One episode in one building."""

    building: str
    group: str
    area_m2: float
    world: str
    seed: int
    summary: Summary | None
    error: str | None
    tour_m: float
    """Of the tour with the map known."""
    decision_s: float | None
    """Median processor time of a decision near the end, [s]."""
    parts: list[Part] = []
    """What was left out, the largest first; only for runs that explored too little."""

    @property
    def ratio(self) -> float | None:
        """Driven over the tour with the map known; None where too little was explored: to stop early saves nothing."""
        s = self.summary
        if s is None or s.explored_fraction < LEAST_EXPLORED or self.tour_m <= 0.0:
            return None
        return s.path_length_m / self.tour_m

    @property
    def misses(self) -> tuple[Miss, ...]:
        """Empty where the run reaches the goal; the cost is judged over all runs together."""
        s = self.summary
        if s is None:
            return (Miss.EXCEPTION,)
        missed = {
            Miss.UNEXPLORED: s.explored_fraction < LEAST_EXPLORED,
            Miss.CONTACT: s.contacts > 0,
            Miss.SCAN_LIMIT: s.end_reason == "scan_limit",
        }
        return tuple(miss for miss, is_so in missed.items() if is_so)

    @property
    def says(self) -> str:
        """Why it failed, in one line."""
        s = self.summary
        if s is None:
            return str(self.error)
        return (
            f"{', '.join(self.misses)}; ended as {s.end_reason}, explored {100 * s.explored_fraction:.1f} %, "
            f"{s.contacts} contacts, {s.scans} scans; {s.position_error_m.final:.2f} m off at the end, "
            f"{s.position_error_m.max:.2f} m at most"
        )


class PlansStudy(msgspec.Struct, frozen=True):
    """`results.json`."""

    kind: str
    version: str
    code: str
    noise: str
    slam: str
    seeds: int
    max_scans: int
    unread: list[str]
    """A line for each file among the plans that is none."""
    config: dict[str, Any]
    runs: list[Run]

    def failures(self) -> list[Run]:
        """The runs that miss the goal."""
        return [run for run in self.runs if run.misses]


def parts_left(record: EpisodeRecord, world: str) -> list[Part]:
    """What the scans of an episode left out, the largest first."""
    scorer = Scorer(load_world(world))
    left = unseen(scorer, record)
    labels, count = ndimage.label(left, np.ones((3, 3)))
    inner = ndimage.distance_transform_edt(np.pad(left, 1))[1:-1, 1:-1]
    ways = _ways(record)
    true = np.array([step.true_pose for step in record.steps])
    believed = np.array([step.pose for step in record.steps])
    parts = []
    for k in range(1, count + 1):
        area = float((labels == k).sum()) * scorer.resolution_m**2
        if area < LEAST_PART_M2:
            continue
        row, col = np.unravel_index(np.where(labels == k, inner, 0.0).argmax(), left.shape)
        x, y = float(scorer.lattice.x[col]), float(scorer.lattice.y[row])
        away = np.hypot(true[:, 0] - x, true[:, 1] - y)
        i = int(away.argmin())
        drift = believed[i, :2] - true[i, :2]
        part = Part(area, x, y, float(away[i]), float(np.hypot(*drift)), not ways(x + drift[0], y + drift[1]))
        parts.append(part)
    return sorted(parts, key=lambda part: -part.area_m2)


def unseen(scorer: Scorer, record: EpisodeRecord) -> Mask:
    """Reachable cells that no scan saw, shape of `scorer.reachable`."""
    scorer.reset()
    for step in record.steps:
        scorer.add_scan(step.true_pose[0], step.true_pose[1])
    return np.asarray(scorer.reachable & ~scorer.explored)


def _ways(record: EpisodeRecord) -> Callable[[float, float], bool]:
    """Whether the body has a way to a place on the robot's last map, through what is not known to be wall."""
    grid = record.grid
    states = grid_states(grid)
    room = ndimage.distance_transform_edt(states != OCCUPIED) * grid.resolution_m
    labels, _ = ndimage.label(room > AmigoBot.radius_m, np.ones((3, 3)))
    frame = GridFrame(*grid.origin, grid.resolution_m, grid.shape)
    here = frame.cell(record.steps[-1].pose[0], record.steps[-1].pose[1])

    def way(x: float, y: float) -> bool:
        """Whether it has one to x, y, [m]."""
        cell = frame.cell(x, y)
        if not frame.contains(np.array([cell, here])).all():
            return False
        return bool(labels[cell] and labels[cell] == labels[here])

    return way


def late_s(laps: Sequence[float]) -> float | None:
    """The median of the last laps, [s]."""
    return float(np.median(laps[-LATE - 1 : -1])) if len(laps) > 1 else None


def load_plans_study(path: Path) -> PlansStudy:
    """Read `results.json`."""
    return msgspec.json.decode(path.read_bytes(), type=PlansStudy)
