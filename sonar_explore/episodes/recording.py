"""What the environment shows, as a record: steps while it runs, chains, grid and scores at the end."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonar_explore.agents import Decision
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.world import World
from sonar_explore.episodes.loops import loop_closed
from sonar_explore.episodes.record import (
    AssociationRecord,
    CandidateRecord,
    ChainRecord,
    DecisionRecord,
    FeatureRecord,
    GridRecord,
    Pose3,
    Stats,
    StepRecord,
    Summary,
    WorldRecord,
)
from sonar_explore.explorer import Situation, Trip
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.grid import GridFrame, States, window
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.sensors import sensor_name
from sonar_explore.slam import ScanUpdate


@dataclass(frozen=True)
class _Now:
    """What holds at a scan, before the next drive moves on."""

    sim_time_s: float
    path_length_m: float
    true_pose: Pose
    true_trail: Sequence[Pose]
    trail: Sequence[Pose]
    update: ScanUpdate
    explored: float


class EpisodeLog:
    """Turns what the environment shows into steps; scoring happens here, with the truth."""

    def __init__(self, env: ExplorationEnv) -> None:
        self._env = env
        self.steps: list[StepRecord] = []
        self._errors: list[tuple[float, float]] = []
        self._drawn: OccupancyGrid | None = None
        """The map of the step before."""
        self._note()

    def _note(self) -> None:
        """What holds at the scan just taken, before the next drive moves on."""
        env = self._env
        self._now = _Now(
            sim_time_s=env.simulator.time_s,
            path_length_m=env.simulator.driven_m,
            true_pose=env.true_scan_pose,
            true_trail=env.true_trail,
            trail=env.trip.trail if env.trip else (),
            update=env.update,
            explored=env.explored_fraction,
        )
        believed, true = env.update.pose, env.true_scan_pose
        turn = math.remainder(believed.heading - true.heading, math.tau)
        self._errors.append((believed.distance_to(true), abs(math.degrees(turn))))

    def step(self, situation: Situation, decision: Decision | None) -> StepRecord:
        """The step that ended with this decision (and the drive that it led to, which the environment has made)."""
        now = self._now
        update = now.update
        scan = self._env.slam.scans[update.index].scan
        outcome = None
        if decision is not None:
            trip = self._env.trip
            assert trip is not None
            outcome = _decision_record(situation, decision, trip)
        record = StepRecord(
            index=update.index,
            sim_time_s=_round(now.sim_time_s),
            path_length_m=_round(now.path_length_m),
            predicted_pose=_pose(update.predicted_pose),
            pose=_pose(update.pose),
            true_pose=_pose(now.true_pose),
            trail=[_pose(p) for p in now.trail],
            true_trail=[_pose(p) for p in now.true_trail],
            scan_headings_rad=_rounded(scan.headings_rad),
            scan_ranges_m=_rounded(scan.ranges_m),
            scan_ring=[] if scan.ring is None else [_pose(Pose(*disc)) for disc in scan.ring],
            odometry=_pose(scan.pose_robot_in_odometry),
            features=[_feature_record(f, update.pose) for f in update.features],
            associations=[_association_record(a) for a in update.associations],
            new_chains=list(update.new_chains),
            merges=[(m.survivor, m.absorbed) for m in update.merges],
            dangling=list(update.dangling),
            map_change=map_change(self._drawn, situation.grid),
            explored_fraction=_round(now.explored),
            decision=outcome,
        )
        self.steps.append(record)
        self._drawn = situation.grid
        if decision is not None:
            self._note()
        return record

    def summary(self, *, agent: str, slam: str, noise: str, seed: int, wall_time_s: float) -> Summary:
        """The scores of the episode (docs/metrics.md)."""
        env, grid = self._env, self._env.situation.grid
        drawn = (grid.states, (grid.frame.x0, grid.frame.y0), grid.frame.resolution_m)
        position, heading = np.array(self._errors).T
        error = env.scorer.wall_error(*drawn)
        return Summary(
            world=env.world.name,
            agent=agent,
            slam=slam,
            noise=noise,
            sensor=sensor_name(env.config.simulator.sonar),
            scan=env.config.scan,
            seed=seed,
            end_reason=env.end_reason,
            scans=len(self.steps),
            decisions=len(self.steps) - 1,
            path_length_m=_round(env.simulator.driven_m),
            sim_time_s=_round(env.simulator.time_s),
            wall_time_s=wall_time_s,
            explored_fraction=_round(env.explored_fraction),
            wall_recall=_round(env.scorer.wall_recall(*drawn)),
            wall_error_m=None if error is None else _round(error),
            false_free_fraction=_round(env.scorer.false_free_fraction(*drawn)),
            contacts=env.simulator.contacts,
            loop_closed=loop_closed(env.scorer, self.steps) if env.world.has_loop else None,
            position_error_m=_stats(position),
            heading_error_deg=_stats(heading),
            chains=len(env.situation.chains),
            dangling_chains=sum(chain.dangling for chain in env.situation.chains),
            merges=sum(len(step.merges) for step in self.steps),
        )


def _round(value: float) -> float:
    """To the micrometre: more digits would only make files longer."""
    return round(float(value), 6)


def _rounded(values: Array) -> list[float]:
    return [round(value, 6) for value in values.tolist()]


def _pose(pose: Pose) -> Pose3:
    return _round(pose.x), _round(pose.y), _round(pose.heading)


def _stats(values: np.ndarray) -> Stats:
    return Stats(mean=_round(values.mean()), max=_round(values.max()), final=_round(values[-1]))


def _feature_record(feature: Any, pose: Pose) -> FeatureRecord:
    x1, y1, x2, y2 = feature.segment.transformed(pose).as_row()
    return FeatureRecord(
        kind=feature.kind.value,
        segment=(_round(x1), _round(y1), _round(x2), _round(y2)),
        bearing_rad=_round(feature.bearing_rad),
        range_m=_round(feature.range_m),
        width_rad=_round(feature.width_rad),
    )


def _association_record(scored: Any) -> AssociationRecord:
    a = scored.association
    return AssociationRecord(
        feature=a.feature,
        chain=a.chain,
        link=a.link,
        kept=scored.kept,
        angle_residual_rad=_round(scored.adr_rad),
        normal_residual_m=_round(scored.ndr_m),
        probability=_round(scored.probability),
    )


def _decision_record(situation: Situation, decision: Decision, trip: Trip) -> DecisionRecord:
    candidates = [
        CandidateRecord(
            x=_round(c.x),
            y=_round(c.y),
            path_length_m=_round(c.path_length_m),
            terms={name: _round(term) for name, term in score.terms.items()},
            score=_round(score.total),
        )
        for c, score in zip(situation.candidates, decision.scores, strict=True)
    ]
    path = [(_round(x), _round(y)) for x, y in trip.path.tolist()]
    return DecisionRecord(candidates=candidates, chosen=decision.chosen, outcome=trip.end.value, path=path)


def world_record(world: World) -> WorldRecord:
    """The true walls, as the episode met them."""
    return WorldRecord(
        name=world.name,
        title=world.title,
        walls=[tuple(_round(v) for v in wall) for wall in world.walls],  # type: ignore[misc]
        cylinders=[tuple(_round(v) for v in c) for c in world.cylinders],  # type: ignore[misc]
        start=_pose(world.start),
    )


def chain_record(chain: Any) -> ChainRecord:
    """A chain as it was at the end."""
    return ChainRecord(
        id=chain.id,
        links=[tuple(_round(v) for v in link.segment.as_row()) for link in chain.links],  # type: ignore[misc]
        root=chain.root_index,
        root_probability=_round(chain.root_probability),
        dangling=chain.dangling,
    )


def grid_record(grid: OccupancyGrid) -> GridRecord:
    """The grid, packed."""
    return _packed(grid.frame, grid.states)


def map_change(before: OccupancyGrid | None, now: OccupancyGrid) -> GridRecord | None:
    """The smallest part of the map that holds every cell that has changed; None where none has."""
    if before is None:
        old = np.zeros_like(now.states)
    elif before.frame == now.frame:
        old = before.states
    else:  # it has grown
        old = window(before.frame, before.states, now.frame)
    changed = old != now.states
    (rows,), (columns,) = changed.any(axis=1).nonzero(), changed.any(axis=0).nonzero()
    if not len(rows):
        return None
    (top, bottom), (left, right) = (rows[0], rows[-1] + 1), (columns[0], columns[-1] + 1)
    f = now.frame
    x0, y0 = f.x0 + left * f.resolution_m, f.y0 + top * f.resolution_m
    part = GridFrame(x0, y0, f.resolution_m, (int(bottom - top), int(right - left)))
    return _packed(part, now.states[top:bottom, left:right])


def _packed(frame: GridFrame, states: States) -> GridRecord:
    return GridRecord(
        origin=(_round(frame.x0), _round(frame.y0)),
        resolution_m=frame.resolution_m,
        shape=frame.shape,
        states=base64.b64encode(zlib.compress(states.tobytes())).decode("ascii"),
    )
