"""How the `nxt` sensor was fitted to recorded scans, and how its simulated twin compares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from sonar_explore.envs.acoustics import SonarPhysics, echoes, measured
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array, Pose, Segment
from sonar_explore.measurement import Scan
from sonar_explore.studies.real_sonar.walls import Verdict, judged

TWINS = 10
"""Simulated scans for each recorded one."""
NEAR_M = 0.10


@dataclass(frozen=True)
class BeamFit:
    """A Gaussian beam through the widths of plateaus on true walls."""

    s_deg: float
    """Angle off the axis at which the amplitude falls to 1/e."""
    heard_deg: float
    """Half-angle at which a plane 1 m away is just heard."""
    range_m: Array
    """Of the plateaus, shape (n,)."""
    half_deg: Array
    """Half their widths, shape (n,)."""

    def at(self, range_m: Array) -> Array:
        """Half-angle of a plane, [deg]."""
        return half_angle_deg(self.s_deg, self.heard_deg, range_m)


def half_angle_deg(s_deg: float, heard_deg: float, range_m: Array) -> Array:
    """theta^2 = heard^2 - s^2 ln r, from A = exp(-theta^2 / s^2) / r at the threshold, [deg]."""
    return np.sqrt(np.maximum(0.0, heard_deg**2 - s_deg**2 * np.log(range_m)))


def fit_beam(verdicts: Sequence[Verdict]) -> BeamFit:
    """Least absolute deviations, over the extracted walls that are true: some plateaus are cut by others."""
    true = [f for v in verdicts for f, good in zip(v.walls, v.true, strict=True) if good]
    range_m = np.array([f.range_m for f in true])
    half = np.degrees([0.5 * f.width_rad for f in true])

    def off(x: Array) -> float:
        """Sum of the deviations for x = (s, heard), [deg]."""
        return float(np.abs(half_angle_deg(x[0], x[1], range_m) - half).sum())

    s, heard = optimize.minimize(off, (20.0, 20.0), method="Nelder-Mead").x
    return BeamFit(float(s), float(heard), range_m, half)


@dataclass(frozen=True)
class Likeness:
    """How recorded scans, or their simulated twins, look on the whole."""

    name: str
    silent: float
    """Share of readings that heard nothing."""
    walls: float
    """Extracted from a scan in the mean."""
    width_deg: float
    """Median width of their plateaus."""
    precision: float
    recall: float
    near: float | None
    """Share of readings within `NEAR_M` of the recorded ones; None for these themselves."""


def likeness(name: str, verdicts: Sequence[Verdict], recorded: Sequence[Verdict] | None = None) -> Likeness:
    """Sum up; `recorded` are the scans that these are twins of, in the same order, over and over."""
    ranges = np.concatenate([v.scan.ranges_m for v in verdicts])
    widths = [math.degrees(f.width_rad) for v in verdicts for f in v.walls]
    near = None
    if recorded is not None:
        once = np.concatenate([v.scan.ranges_m for v in recorded])
        off = np.abs(ranges - np.tile(once, len(ranges) // len(once)))
        near = float((off <= NEAR_M).mean())
    return Likeness(
        name=name,
        silent=float((ranges >= verdicts[0].scan.range_max_m).mean()),
        walls=len(widths) / len(verdicts),
        width_deg=float(np.median(widths)) if widths else math.nan,
        precision=sum(sum(v.true) for v in verdicts) / max(1, len(widths)),
        recall=sum(sum(v.found) for v in verdicts) / max(1, sum(len(v.found) for v in verdicts)),
        near=near,
    )


def twins(recorded: Sequence[Verdict], walls: Sequence[Segment], physics: SonarPhysics) -> list[Verdict]:
    """The same scans at the same poses as the simulator has them, `TWINS` times; judged like the recorded ones."""
    rows = np.array([wall.as_row() for wall in walls])
    world = World(
        "arena", "The arena", rows, np.zeros(len(rows)), np.zeros((0, 3)), Pose(0.0, 0.0, 0.0), False
    )
    scene = Scene.of(world, physics.range_max_m, physics.roughness)
    rng = np.random.default_rng(0)
    return [
        judged(_twin(v.scan, v.pose, scene, physics, rng), v.pose, walls, v.features)
        for _ in range(TWINS)
        for v in recorded
    ]


def _twin(scan: Scan, pose: Pose, scene: Scene, physics: SonarPhysics, rng: np.random.Generator) -> Scan:
    discs = np.column_stack([pose.transform(scan.origins), pose.heading + scan.bearings_rad])
    heard, _ = echoes(scene, discs, physics)
    return replace(scan, ranges_m=measured(heard, 1.0, physics, rng))
