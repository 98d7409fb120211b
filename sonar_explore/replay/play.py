"""Run a SLAM on a log: the same measurements in the same order, and what it believes after each scan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonar_explore import __version__
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose, wrap_angle
from sonar_explore.replay.log import Log
from sonar_explore.sensors import sensor_preset
from sonar_explore.slam import FeatureKind, ScanUpdate, Slam, SlamConfig, make_slam
from sonar_explore.wording import counted


@dataclass(frozen=True, eq=False)
class Replay:
    """What a SLAM made of a log."""

    log: Log
    slam: str
    mind: Slam
    """As it was after the last scan."""
    updates: tuple[ScanUpdate, ...]
    """One a scan; poses as believed then."""

    @property
    def errors(self) -> Array | None:
        """Distance [m] and angle [rad] to the reference at each scan, shape (n, 2); None where none is known."""
        if self.log.reference is None:
            return None
        pairs = zip(self.updates, self.log.reference, strict=True)
        return np.array(
            [(u.pose.distance_to(true), abs(wrap_angle(u.pose.heading - true.heading))) for u, true in pairs]
        )


def replay(log: Log, slam: str = "chain", config: SlamConfig | None = None) -> Replay:
    """Feed the log to the SLAM of this name.

    Args:
        log: what was measured.
        slam: a known name; `truth` needs a log with reference poses.
        config: every choice of SLAM's; None takes those of the log's sensor.

    Raises:
        SonarExploreError: for an unknown name, or `truth` without reference poses.
    """
    mind = make_slam(slam, log.start, config or sensor_preset(log.sensor).slam)
    told = slam == "truth"
    if told and log.reference is None:
        raise SonarExploreError("slam 'truth' needs a log with reference poses; this one has none")
    updates: list[ScanUpdate] = []
    for entry in log.entries:
        if isinstance(entry, Pose):
            mind.predict(entry)
            continue
        if told and log.reference is not None:
            mind.place(log.reference[len(updates)])
        updates.append(mind.update(entry))
    return Replay(log, slam, mind, tuple(updates))


def headline(done: Replay) -> str:
    """What came of it, in a line."""
    kinds = [f.kind for update in done.updates for f in update.features]
    walls = kinds.count(FeatureKind.WALL)
    parts = [
        f"{done.log.about}: {counted(len(done.updates), 'scan')}, {counted(walls, 'wall')} and "
        f"{counted(len(kinds) - walls, 'point')} (corners and edges)",
        f"{counted(len(done.mind.chains.chains), 'chain')} by {done.slam}",
    ]
    errors = summary_of(done)
    if errors is not None:
        mean, final = errors["position_mean_m"], errors["position_final_m"]
        parts.append(f"position off the reference {mean:.3f} m in the mean, {final:.3f} m at the end")
    return "; ".join(parts)


def as_builtins(done: Replay) -> dict[str, Any]:
    """What `replay.json` holds: metres and radians, map frame; features where the pose then believed has them."""
    return {
        "version": __version__,
        "about": done.log.about,
        "slam": done.slam,
        "scans": [
            _scan(update, entry.pose) for update, entry in zip(done.updates, done.mind.scans, strict=True)
        ],
        "chains": [
            {"id": c.id, "links": [link.segment.as_row() for link in c.links], "dangling": c.dangling}
            for c in done.mind.chains.chains
        ],
        "errors": summary_of(done),
    }


def summary_of(done: Replay) -> dict[str, float] | None:
    """Mean and final error against the reference; None where there is none."""
    errors = done.errors
    if errors is None:
        return None
    position, heading = errors.T
    return {
        "position_mean_m": round(float(position.mean()), 6),
        "position_final_m": round(float(position[-1]), 6),
        "heading_mean_deg": round(math.degrees(float(heading.mean())), 6),
        "heading_final_deg": round(math.degrees(float(heading[-1])), 6),
    }


def _scan(update: ScanUpdate, last: Pose) -> dict[str, Any]:
    return {
        "predicted_pose": _row(update.predicted_pose),
        "pose": _row(update.pose),
        "last_pose": _row(last),
        "features": [
            {"kind": f.kind.value, "segment": f.segment.transformed(update.pose).as_row()}
            for f in update.features
        ],
        "associations": sum(a.kept for a in update.associations),
        "new_chains": list(update.new_chains),
    }


def _row(pose: Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.heading
