"""The map's marks, in picture units: what the template draws once and what the script draws scan by scan."""

from __future__ import annotations

import math
from itertools import repeat
from typing import Any

from sonar_explore.amigobot import AmigoBot
from sonar_explore.episodes.record import (
    AssociationRecord,
    DecisionRecord,
    EpisodeRecord,
    GridRecord,
    Point,
    Pose3,
    Segment4,
    StepRecord,
)
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.reports.colours import chain_colours
from sonar_explore.reports.frame import Frame
from sonar_explore.reports.history import ChainHistory, chain_history
from sonar_explore.reports.raster import grid_png

NEVER = 1_000_000  # a step that never comes


def chain_rows(record: EpisodeRecord) -> list[dict[str, Any]]:
    """The chains at the end, with the colour class of each."""
    colours = chain_colours(record.chains)
    return [
        {
            "id": chain.id,
            "colour": f"c{colours[chain.id]}",
            "links": chain.links,
            "root": chain.root,
            "probability": chain.root_probability,
            "dangling": chain.dangling,
        }
        for chain in sorted(record.chains, key=lambda chain: chain.id)
    ]


def map_changes(record: EpisodeRecord, frame: Frame) -> list[dict[str, Any]]:
    """The attributes of the `image`s: those up to a scan, laid over each other, show the map as it was known then."""
    changes = [(step.index, step.map_change) for step in record.steps]
    return [{"data-s": index, **_image(grid, frame)} for index, grid in changes if grid]


def past_walls(record: EpisodeRecord) -> list[dict[str, Any]]:
    """Every wall feature where it was placed when it was seen: the map as of an earlier scan."""
    history = chain_history(record)
    colours = {row["id"]: row["colour"] for row in chain_rows(record)}
    walls = []
    for step in record.steps:
        for index, feature in enumerate(step.features):
            if feature.kind != "wall":
                continue
            key = (step.index, index)
            chain = history.born_in.get(key)
            walls.append(
                {
                    "step": step.index,
                    "segment": feature.segment,
                    "chain": -1 if chain is None else chain,
                    "colour": "loose" if chain is None else colours.get(history.final(chain), "loose"),
                    "root_until": _root_until(history, key),
                }
            )
    return walls


def cut_associations(record: EpisodeRecord) -> list[tuple[int, Segment4]]:
    """(step, line from the feature to the link) for each association that the link graph cut."""
    history = chain_history(record)
    return [
        (step.index, line)
        for step in record.steps
        for index, association in enumerate(step.associations)
        if not association.kept and (line := _connector(step, index, association, history))
    ]


def drive(step: StepRecord, before: StepRecord | None) -> list[Point]:
    """The believed way to this scan, the jump of the correction included, [m]."""
    start = [before.pose[:2]] if before else []
    return [*start, *(pose[:2] for pose in step.trail), step.pose[:2]]


def true_drive(step: StepRecord, before: StepRecord | None) -> list[Point]:
    """The true way to this scan, [m]."""
    start = [before.true_pose[:2]] if before else []
    return [*start, *(pose[:2] for pose in step.true_trail), step.true_pose[:2]]


def scan_data(record: EpisodeRecord, frame: Frame) -> list[dict[str, Any]]:
    """One plain dict a scan, for the script."""
    history = chain_history(record)
    return [
        {
            "time": round(step.sim_time_s),
            "driven": round(step.path_length_m, 2),
            "explored": round(100 * step.explored_fraction, 1),
            "poses": [_pose(pose, frame) for pose in (step.predicted_pose, step.pose, step.true_pose)],
            "errors": [_errors(pose, step.true_pose) for pose in (step.predicted_pose, step.pose)],
            "fan": _fan(step, frame),
            "features": [[*_line(f.segment, frame), f.kind] for f in step.features],
            "associations": [
                _association(step, index, history, frame) for index in range(len(step.associations))
            ],
            "roots": step.new_chains,
            "merges": step.merges,
            "dangling": step.dangling,
            "decision": _decision(step.decision, frame) if step.decision else None,
        }
        for step in record.steps
    ]


def _image(grid: GridRecord, frame: Frame) -> dict[str, Any]:
    rows, columns = grid.shape
    x, y = grid.origin
    return {
        "x": frame.x(x),
        "y": frame.y(y + rows * grid.resolution_m),
        "width": frame.length(columns * grid.resolution_m),
        "height": frame.length(rows * grid.resolution_m),
        "href": grid_png(grid),
    }


def _root_until(history: ChainHistory, key: tuple[int, int]) -> int:
    """The first step at which this feature is no root; 0 where it never was one."""
    if key not in history.roots:
        return 0
    return history.merges.get(history.born_in[key], (0, NEVER))[1]


def _errors(pose: Pose3, truth: Pose3) -> list[float]:
    """[position error in m, heading error in degrees]"""
    turn = math.degrees(wrap_angle(pose[2] - truth[2]))
    return [round(math.dist(pose[:2], truth[:2]), 3), round(abs(turn), 2)]


def _pose(pose: Pose3, frame: Frame) -> list[float]:
    """[x, y, heading in degrees as a picture turns: clockwise, metres x, metres y, heading in degrees]"""
    degrees = math.degrees(wrap_angle(pose[2]))
    return [
        frame.x(pose[0]),
        frame.y(pose[1]),
        round(-degrees, 1),
        round(pose[0], 3),
        round(pose[1], 3),
        round(degrees, 1),
    ]


def _fan(step: StepRecord, frame: Frame) -> list[list[float]]:
    """[x, y, heard] of every reading's end, placed by the believed pose."""
    robot = AmigoBot()
    ring = [Pose(*disc) for disc in step.scan_ring] or repeat(robot.sonars[robot.scan_sonar])
    ends = []
    for heading, distance, disc in zip(step.scan_headings_rad, step.scan_ranges_m, ring, strict=False):
        echo = Pose(*step.pose) @ Pose(0.0, 0.0, heading) @ disc @ Pose(distance, 0.0, 0.0)
        ends.append([frame.x(echo.x), frame.y(echo.y), int(distance < robot.range_max_m - 1e-6)])
    return ends


def _line(segment: Segment4, frame: Frame) -> list[float]:
    x1, y1, x2, y2 = segment
    return [frame.x(x1), frame.y(y1), frame.x(x2), frame.y(y2)]


def _connector(
    step: StepRecord, index: int, association: AssociationRecord, history: ChainHistory
) -> Segment4 | None:
    """From the middle of the feature to the middle of the link, [m]; None where the link is not known."""
    link = history.links.get((step.index, index))
    if link is None or not 0 <= association.feature < len(step.features):
        return None
    feature = step.features[association.feature].segment
    return (*_middle(feature), *_middle(link))


def _middle(segment: Segment4) -> Point:
    return (segment[0] + segment[2]) / 2, (segment[1] + segment[3]) / 2


def _association(step: StepRecord, index: int, history: ChainHistory, frame: Frame) -> dict[str, Any]:
    association = step.associations[index]
    line = _connector(step, index, association, history)
    return {
        "feature": association.feature,
        "chain": association.chain,
        "kept": association.kept,
        "angle": round(math.degrees(association.angle_residual_rad), 1),
        "normal": round(100 * association.normal_residual_m, 1),
        "probability": round(association.probability, 2),
        "line": _line(line, frame) if line else None,
    }


def _decision(decision: DecisionRecord, frame: Frame) -> dict[str, Any]:
    terms = list(dict.fromkeys(name for candidate in decision.candidates for name in candidate.terms))
    return {
        "terms": terms,
        "chosen": decision.chosen,
        "outcome": decision.outcome,
        "path": frame.points(decision.path),
        "candidates": [
            [
                frame.x(candidate.x),
                frame.y(candidate.y),
                round(candidate.path_length_m, 2),
                round(candidate.score, 3),
                *(round(candidate.terms.get(name, 0.0), 3) for name in terms),
            ]
            for candidate in decision.candidates
        ],
    }
