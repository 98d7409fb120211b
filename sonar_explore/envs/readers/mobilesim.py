"""ActivMedia / MobileSim `.map`: text, whole millimetres; made by hand or out of laser scans.

`LINES` are walls. `DATA` are laser points: those that no line explains are clutter, chair legs and the like,
and become small round columns on a lattice. `Cairn: RobotHome` is the start. Forbidden lines and areas and
the simulator's boxes are walls as well: whoever drew the map keeps the robot from what lies behind them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely

from sonar_explore.envs.readers.lines import world_of_lines
from sonar_explore.envs.readers.source import ReadOptions, read_bytes
from sonar_explore.envs.validation import MAX_CYLINDERS, MAX_WALLS
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

MAX_BYTES = 8 * 2**20
CLUTTER_CELL_M = 0.10
"""Laser points closer together than this are one thing."""
CLUTTER_RADIUS_M = 0.03
EXPLAINED_M = 0.15
"""A laser point this close to a line is a measurement of that line."""
LEAST_POINTS = 2
"""A cell with fewer laser points is noise, or somebody's foot."""

_LINE_CAIRNS = ("ForbiddenLine",)
_BOX_CAIRNS = ("ForbiddenArea", "Sim.BoxObstacle")


@dataclass
class _Sections:
    """Rows of whole millimetres by section, and the start."""

    lines: list[tuple[float, ...]] = field(default_factory=list)
    points: list[tuple[float, ...]] = field(default_factory=list)
    home: Pose | None = None


def read_mobilesim(path: Path, options: ReadOptions) -> World:
    """The world in a `.map` file."""
    sections = _parse(path, read_bytes(path, MAX_BYTES))
    if not sections.lines:
        raise SonarExploreError(f"{path.name}: no LINES section with a line; is this a MobileSim map?")
    walls = np.array(sections.lines, dtype=float).reshape(-1, 4) / 1000.0
    points = np.array(sections.points, dtype=float).reshape(-1, 2) / 1000.0
    clutter = _clutter(points, walls)
    return world_of_lines(path, f"Map {path.name}", walls, clutter, options.start or sections.home)


def _parse(path: Path, data: bytes) -> _Sections:
    text = data.decode("utf-8", errors="replace")
    if not text.lstrip("\ufeff \r\n\t").startswith("2D-Map"):
        raise SonarExploreError(f"{path.name}: no MobileSim map: the first line is not '2D-Map'")
    found, rows, width = _Sections(), None, 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not (words := line.split()):
            continue
        if rows is not None and (words[0][0].isdigit() or words[0][0] in "-+."):
            rows.append(_numbers(path, number, words, width))
            continue
        rows, width = None, 0
        section = words[0] if len(words) == 1 else ""
        if section.endswith("LINES"):  # also of one sensor: Sick_LINES
            rows, width = found.lines, 4
        elif section.endswith("DATA"):
            rows, width = found.points, 2
        elif words[0] == "Cairn:" and len(words) >= 5:
            _read_cairn(path, number, words[1:], found)
        if len(found.lines) > MAX_WALLS:
            break
    return found


def _numbers(path: Path, number: int, words: list[str], width: int) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in words[:width])
    except ValueError:
        values = ()
    if len(values) < width or not all(math.isfinite(v) for v in values):
        raise SonarExploreError(f"{path.name}: line {number}: expected {width} numbers of millimetres")
    return values


def _read_cairn(path: Path, number: int, words: list[str], found: _Sections) -> None:
    """`RobotHome x y degrees "" ICON "name"`, or a line or box with its two corners at the end."""
    kind = words[0]
    if kind == "RobotHome" and found.home is None:
        x, y, degrees = _numbers(path, number, words[1:], 3)
        found.home = Pose(x / 1000.0, y / 1000.0, math.radians(degrees))
    elif kind in _LINE_CAIRNS:
        found.lines.append(_numbers(path, number, words[-4:], 4))
    elif kind in _BOX_CAIRNS:
        _, _, degrees = _numbers(path, number, words[1:], 3)
        x1, y1, x2, y2 = _numbers(path, number, words[-4:], 4)
        turn = Pose(0.0, 0.0, math.radians(degrees))  # its corners are given in axes turned about the origin
        corners = turn.transform(np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]]))
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            found.lines.append((*a.tolist(), *b.tolist()))


def _clutter(points: Array, walls: Array) -> Array:
    """Columns x y radius, shape (m, 3), [m], for the laser points that no line explains."""
    if not len(points):
        return np.empty((0, 3))
    tree = shapely.STRtree(shapely.linestrings(walls.reshape(-1, 2, 2)))
    explained = tree.query(shapely.points(points), predicate="dwithin", distance=EXPLAINED_M)[0]
    points = np.delete(points, np.unique(explained), axis=0)
    cell = CLUTTER_CELL_M
    while True:
        cells, index, count = np.unique(
            np.floor(points / cell), axis=0, return_inverse=True, return_counts=True
        )
        keep = count >= LEAST_POINTS
        if keep.sum() <= MAX_CYLINDERS:
            break
        cell *= 2.0
    sums = np.zeros((len(cells), 2))
    np.add.at(sums, index.ravel(), points)
    middles = (sums / count[:, None])[keep]
    return np.column_stack([middles, np.full(len(middles), CLUTTER_RADIUS_M)])
