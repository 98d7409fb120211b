"""What an episode leaves behind: `episode.json`, from which its report can be made again.

All lengths in metres, angles in radians, poses `[x, y, heading]` and segments `[x1, y1, x2, y2]` in the map
frame (the world's frame: the map is placed by the start pose) unless the name says otherwise. Fields that
start with `true_` come from the simulator; nothing but scoring and pictures reads them.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec

Pose3 = tuple[float, float, float]
Point = tuple[float, float]
Segment4 = tuple[float, float, float, float]


class WorldRecord(msgspec.Struct, frozen=True):
    """The true world, for overlays and scoring."""

    name: str
    title: str
    walls: list[Segment4]
    cylinders: list[tuple[float, float, float]]
    """(x, y, radius)"""
    start: Pose3


class FeatureRecord(msgspec.Struct, frozen=True):
    """One feature of a scan, placed by the pose the robot believed after the correction."""

    kind: Literal["wall", "corner", "edge"]
    segment: Segment4
    """Of no length for corners and edges."""
    bearing_rad: float
    """In the robot frame at the start of the scan."""
    range_m: float
    width_rad: float


class AssociationRecord(msgspec.Struct, frozen=True):
    """One edge of the initial link graph (section III.B) and what became of it."""

    feature: int
    """Index into the step's features."""
    chain: int
    link: int
    """Index of the closest link in its chain."""
    kept: bool
    """In the final winner (section III.C)."""
    angle_residual_rad: float
    """ADR: signed angle from the feature to the root of the chain, before the correction."""
    normal_residual_m: float
    """NDR: signed normal distance to the root's line, before the correction."""
    probability: float
    """P(association), equation (2); 0 where not kept."""


class CandidateRecord(msgspec.Struct, frozen=True):
    """One candidate scan position, as the policy saw it."""

    x: float
    y: float
    path_length_m: float
    terms: dict[str, float]
    """The weighted terms of the score, by name; their sum is the score."""
    score: float


class DecisionRecord(msgspec.Struct, frozen=True):
    """What the policy chose, and how the drive went."""

    candidates: list[CandidateRecord]
    chosen: int
    outcome: str
    """`arrived`, `blocked` (the way was shut and no other was found), or `bumped`."""
    path: list[Point]
    """The planned path."""


class GridRecord(msgspec.Struct, frozen=True):
    """An occupancy grid, or a part of one: row 0 is the lowest y, column 0 the lowest x."""

    origin: Point
    """Outer corner of cell (0, 0)."""
    resolution_m: float
    shape: tuple[int, int]
    """(rows, columns)"""
    states: str
    """zlib + base64 of uint8 (row-major): 0 unknown, 1 free, 2 occupied."""


class StepRecord(msgspec.Struct, frozen=True):
    """One scan, with what SLAM made of it, and the decision that followed it."""

    index: int
    sim_time_s: float
    path_length_m: float
    """Driven so far, by the wheels."""
    predicted_pose: Pose3
    """Before this scan's correction."""
    pose: Pose3
    """After it."""
    true_pose: Pose3
    """When the scan began."""
    trail: list[Pose3]
    """Believed poses on the drive that led here."""
    true_trail: list[Pose3]
    scan_headings_rad: list[float]
    """Of the one disc that the paper would keep."""
    scan_ranges_m: list[float]
    scan_ring: list[Pose3]
    """Of a ring scan: where the disc of each reading sits on the body; empty where one disc heard all."""
    odometry: Pose3
    """When the scan began, in the odometry frame. A log (`run --log`) keeps what a replay needs: all discs, the way."""
    features: list[FeatureRecord]
    associations: list[AssociationRecord]
    new_chains: list[int]
    """Ids of chains that this scan rooted."""
    merges: list[tuple[int, int]]
    """(surviving chain, absorbed chain)"""
    dangling: list[int]
    """Ids of the chains that dangle after this scan."""
    map_change: GridRecord | None
    """The part of the map that this scan and the way to it changed, as it is now. Laid over those of the steps before,
    in order, it is the map from which the decision was made. None where nothing changed."""
    explored_fraction: float
    """Scored against the truth."""
    decision: DecisionRecord | None
    """None where the episode ended."""


class ChainRecord(msgspec.Struct, frozen=True):
    """A feature chain at the end of the episode."""

    id: int
    links: list[Segment4]
    root: int
    """Index of the root among the links."""
    root_probability: float
    dangling: bool


class Stats(msgspec.Struct, frozen=True):
    """Mean and maximum over the scans, and the value at the end."""

    mean: float
    max: float
    final: float


class Summary(msgspec.Struct, frozen=True):
    """What `sonar-explore run --json` prints. Definitions: docs/metrics.md."""

    world: str
    agent: str
    slam: str
    noise: str
    sensor: str
    """Name of the sonar, `custom` where none is called so."""
    scan: str
    """`turn` or `ring`."""
    seed: int
    end_reason: str
    scans: int
    decisions: int
    path_length_m: float
    sim_time_s: float
    wall_time_s: float
    explored_fraction: float
    wall_recall: float
    wall_error_m: float | None
    """None where no cell is occupied."""
    false_free_fraction: float
    contacts: int
    loop_closed: bool | None
    """None where the world has no loop."""
    position_error_m: Stats
    heading_error_deg: Stats
    chains: int
    dangling_chains: int
    merges: int


class EpisodeRecord(msgspec.Struct, frozen=True):
    """The whole episode."""

    version: str
    """Of sonar_explore."""
    config: dict[str, Any]
    world: WorldRecord
    summary: Summary
    steps: list[StepRecord]
    chains: list[ChainRecord]
    grid: GridRecord
    """At the end."""
