"""A believable episode made without simulator or SLAM: a corridor and two rooms, 8 m by 6 m, 20 scans.

Ranges are the feet of the normals that can be seen, so plateaus stand where a sonar would give them; the
believed pose drifts away from the true one and is pulled back by a part of the error at every scan.
"""

from __future__ import annotations

import base64
import math
import zlib
from typing import NamedTuple

import numpy as np

from sonar_explore.episodes.record import (
    AssociationRecord,
    CandidateRecord,
    ChainRecord,
    DecisionRecord,
    EpisodeRecord,
    FeatureRecord,
    GridRecord,
    Point,
    Pose3,
    Segment4,
    Stats,
    StepRecord,
    Summary,
    WorldRecord,
)

WALLS: list[Segment4] = [
    (0, 0, 8, 0),
    (8, 0, 8, 6),
    (8, 6, 0, 6),
    (0, 6, 0, 0),
    (0, 2, 5, 2),
    (5.9, 2, 8, 2),
    (4, 2, 4, 3.5),
    (4, 4.4, 4, 6),
]
ROUTE: list[Point] = [
    *((0.9 + 0.75 * i, 1.0) for i in range(7)),
    *((5.45, 1.6 + 0.55 * i) for i in range(4)),
    *(
        (6.6, 3.6),
        (6.7, 4.7),
        (5.6, 4.9),
        (4.8, 3.95),
        (3.9, 3.95),
        (3.1, 3.95),
        (2.3, 4.5),
        (1.3, 4.6),
        (1.2, 3.3),
    ),
]
HALF_BEAM = math.radians(11.0)
SONAR_HEADING = math.radians(15.0)
RANGE_MAX = 5.0


class Foot(NamedTuple):
    """Where a wall is heard from a position: its index and side, the bearing [rad] and the distance [m]."""

    wall: int
    side: bool
    bearing: float
    distance: float


def _crosses(a: Point, b: Point, wall: Segment4) -> bool:
    x1, y1, x2, y2 = wall

    def side(px: float, py: float, qx: float, qy: float, r: Point) -> float:
        return (qx - px) * (r[1] - py) - (qy - py) * (r[0] - px)

    return (
        side(x1, y1, x2, y2, a) * side(x1, y1, x2, y2, b) < 0
        and side(*a, *b, (x1, y1)) * side(*a, *b, (x2, y2)) < 0
    )


def _feet(x: float, y: float) -> list[Foot]:
    found = []
    for index, (x1, y1, x2, y2) in enumerate(WALLS):
        length = math.hypot(x2 - x1, y2 - y1)
        ux, uy = (x2 - x1) / length, (y2 - y1) / length
        along = (x - x1) * ux + (y - y1) * uy
        foot = (x1 + along * ux, y1 + along * uy)
        if not 0 <= along <= length or any(
            _crosses((x, y), foot, wall) for i, wall in enumerate(WALLS) if i != index
        ):
            continue
        left = ux * (y - y1) - uy * (x - x1) > 0
        distance = math.hypot(foot[0] - x, foot[1] - y)
        found.append(Foot(index, left, math.atan2(foot[1] - y, foot[0] - x), distance))
    return found


def _ranges(headings: list[float], pose: Pose3, feet: list[Foot], rng: np.random.Generator) -> list[float]:
    ranges = []
    for heading in headings:
        beam = pose[2] + heading + SONAR_HEADING
        heard = [f.distance for f in feet if abs(math.remainder(f.bearing - beam, 2 * math.pi)) <= HALF_BEAM]
        ranges.append(
            round(min(heard, default=RANGE_MAX) + (float(rng.normal(0, 0.006)) - 0.15) * bool(heard), 3)
        )
    return ranges


def _feature(foot: Foot, pose: Pose3, error: float) -> FeatureRecord:
    """Tangent to the arc at the foot's bearing, placed by a believed heading off by `error`."""
    bearing, width = foot.bearing + error, 2 * HALF_BEAM
    cx, cy = pose[0] + foot.distance * math.cos(bearing), pose[1] + foot.distance * math.sin(bearing)
    half = foot.distance * math.tan(width / 2)
    dx, dy = -half * math.sin(bearing), half * math.cos(bearing)
    return FeatureRecord(
        "wall", (cx - dx, cy - dy, cx + dx, cy + dy), bearing - pose[2], foot.distance, width
    )


def _corner(foot: Foot, pose: Pose3) -> FeatureRecord:
    x = pose[0] + foot.distance * math.cos(foot.bearing + 0.6)
    y = pose[1] + foot.distance * math.sin(foot.bearing + 0.6)
    return FeatureRecord("corner", (x, y, x, y), foot.bearing + 0.6 - pose[2], foot.distance, 0.15)


def _trail(start: Pose3, end: Pose3) -> list[Pose3]:
    return [
        (
            start[0] + t * (end[0] - start[0]),
            start[1] + t * (end[1] - start[1]) + 0.04 * math.sin(math.pi * t),
            start[2] + t * (end[2] - start[2]),
        )
        for t in np.linspace(0, 1, 9).tolist()
    ]


def _decision(at: Point, goal: Point, rng: np.random.Generator) -> DecisionRecord:
    candidates = []
    points = [goal, *((at[0] + float(dx), at[1] + float(dy)) for dx, dy in rng.uniform(-1.3, 1.3, (29, 2)))]
    for k, (x, y) in enumerate(points):
        travel = math.hypot(x - at[0], y - at[1])
        terms = {
            "new_area": 2.1 if k == 0 else float(rng.uniform(0.0, 1.9)),
            "associations": 0.9 if k == 0 else float(rng.uniform(0.0, 0.9)),
            "travel": -0.3 * travel,
            "missing_link": 0.4 * (k in (0, 3)),
        }
        if 0.2 < x < 7.8 and 0.2 < y < 5.8:
            candidates.append(CandidateRecord(x, y, travel * 1.1, terms, sum(terms.values())))
    return DecisionRecord(candidates, 0, "arrived", [at, goal])


def _associations(
    feet: list[Foot], chains: dict[tuple[int, bool], int], sizes: dict[int, int], index: int
) -> list[AssociationRecord]:
    """Every foot of a known wall goes to its chain; every fourth scan one of them to a wrong one too, cut."""
    made = [
        AssociationRecord(i, chains[f.wall, f.side], sizes[chains[f.wall, f.side]] - 1, True, 0.02, 0.03, 0.9)
        for i, f in enumerate(feet)
        if (f.wall, f.side) in chains
    ]
    if index % 4 == 3 and made:
        wrong = next((c for c in sizes if c != made[0].chain), made[0].chain)
        made.append(AssociationRecord(made[0].feature, wrong, 0, False, -0.31, 0.18, 0.0))
    return made


def synthetic_record(name: str = "synthetic/two-rooms") -> EpisodeRecord:
    """The same record for the same name, always."""
    rng = np.random.default_rng(7)
    chains: dict[tuple[int, bool], int] = {}
    links: dict[int, list[Segment4]] = {}
    steps: list[StepRecord] = []
    drift, driven = [0.0, 0.0, 0.0], 0.0
    previous: Pose3 = (0.9, 1.0, 0.0)
    true_previous: Pose3 = previous
    for index, (x, y) in enumerate(ROUTE):
        nxt = ROUTE[min(index + 1, len(ROUTE) - 1)]
        true: Pose3 = (x, y, math.atan2(nxt[1] - y, nxt[0] - x))
        driven += math.hypot(x - true_previous[0], y - true_previous[1])
        if index:
            grown = zip(drift, (0.012, 0.035, 0.03), rng.normal(0, 0.006, 3).tolist(), strict=True)
            drift = [sum(terms) for terms in grown]
        predicted: Pose3 = (x + drift[0], y + drift[1], true[2] + drift[2])
        drift = [0.62 * d for d in drift]
        pose: Pose3 = (x + drift[0], y + drift[1], true[2] + drift[2])
        headings = [math.radians(4 * i) for i in range(90)]
        feet = [f for f in _feet(x, y) if f.distance < 2.6]
        features = [_feature(f, pose, drift[2]) for f in feet] + [_corner(feet[0], pose)]
        associations = _associations(feet, chains, {c: len(v) for c, v in links.items()}, index)
        new = []
        for foot, feature in zip(feet, features, strict=False):
            if (foot.wall, foot.side) not in chains:
                new.append(len(chains))
                chains[foot.wall, foot.side] = len(chains)
            links.setdefault(chains[foot.wall, foot.side], []).append(feature.segment)
        dangling = [c for c in links if c == max(links) and index >= 15]
        last = index == len(ROUTE) - 1
        steps.append(
            StepRecord(
                index=index,
                sim_time_s=35.0 * index,
                path_length_m=driven,
                predicted_pose=predicted,
                pose=pose,
                true_pose=true,
                trail=_trail(previous, predicted) if index else [],
                true_trail=_trail(true_previous, true) if index else [],
                scan_headings_rad=headings,
                scan_ring=[],
                scan_ranges_m=_ranges(headings, true, _feet(x, y), rng),
                odometry=predicted,
                features=features,
                associations=associations,
                new_chains=new,
                merges=[],
                dangling=dangling,
                map_change=_grid(8.0 * (index + 1) / len(ROUTE)),
                explored_fraction=1 - math.exp(-0.16 * (index + 1)),
                decision=None if last else _decision((pose[0], pose[1]), nxt, rng),
            )
        )
        previous, true_previous = pose, true
    return EpisodeRecord(
        version="0.1.0",
        config={"slam": {"max_link_distance_m": 0.2}, "explorer": {"max_scans": 60}},
        world=WorldRecord(name, "A corridor and two rooms", WALLS, [(6.9, 5.4, 0.12)], (0.9, 1.0, 0.0)),
        summary=_summary(name, steps, len(links)),
        steps=steps,
        chains=[ChainRecord(c, segs, 0, 0.9, c in steps[-1].dangling) for c, segs in links.items()],
        grid=_grid(8.0),
    )


def _summary(name: str, steps: list[StepRecord], chains: int) -> Summary:
    errors = [math.dist(s.pose[:2], s.true_pose[:2]) for s in steps]
    turns = [abs(math.degrees(s.pose[2] - s.true_pose[2])) for s in steps]
    return Summary(
        world=name,
        agent="frontier",
        slam="chain",
        noise="paper",
        sensor="amigobot",
        scan="turn",
        seed=7,
        end_reason="nothing left to explore",
        scans=len(steps),
        decisions=len(steps) - 1,
        path_length_m=steps[-1].path_length_m,
        sim_time_s=steps[-1].sim_time_s,
        wall_time_s=12.5,
        explored_fraction=steps[-1].explored_fraction,
        wall_recall=0.91,
        wall_error_m=0.034,
        false_free_fraction=0.004,
        contacts=1,
        loop_closed=None,
        position_error_m=Stats(sum(errors) / len(errors), max(errors), errors[-1]),
        heading_error_deg=Stats(sum(turns) / len(turns), max(turns), turns[-1]),
        chains=chains,
        dangling_chains=1,
        merges=0,
    )


def _grid(known_m: float) -> GridRecord:
    """The map as far as an x, [m]."""
    rows, columns, cell = 66, 86, 0.1
    y, x = np.mgrid[0:rows, 0:columns] * cell - 0.25
    states = np.zeros((rows, columns), np.uint8)
    states[(x > 0) & (x < 8) & (y > 0) & (y < 6) & ~((x > 7) & (y > 5.4))] = 1
    for x1, y1, x2, y2 in WALLS:
        inside = (x >= min(x1, x2) - 0.06) & (x <= max(x1, x2) + 0.06)
        states[inside & (y >= min(y1, y2) - 0.06) & (y <= max(y1, y2) + 0.06)] = 2
    states[x > known_m + 0.1] = 0
    packed = base64.b64encode(zlib.compress(states.tobytes())).decode()
    return GridRecord((-0.3, -0.3), cell, (rows, columns), packed)
