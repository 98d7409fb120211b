"""HouseExpo: homes as one closed outline of their free space, JSON, metres.

Walls inside are slots 0.10 m wide cut into the outline, and its corners have jogs of 1 cm, which are drawn
straight here: a sonar hears neither.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import shapely

from sonar_explore.envs.readers.lines import world_of_lines
from sonar_explore.envs.readers.source import ReadOptions, read_bytes, why_undecoded
from sonar_explore.envs.validation import MAX_COORDINATE_M
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array

MAX_BYTES = 8 * 2**20
MAX_VERTICES = 100_000
JOG_M = 0.02
"""Smaller steps of the outline are none."""


class Home(msgspec.Struct, frozen=True):
    """The part of the file that is geometry; the rest (room categories and their boxes) is left alone."""

    verts: list[tuple[float, float]]


def read_houseexpo(path: Path, options: ReadOptions) -> World:
    """The home in a HouseExpo file; the robot starts in the roomiest place."""
    try:
        home = msgspec.json.decode(read_bytes(path, MAX_BYTES), type=Home)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SonarExploreError(f"{path.name}: {why_undecoded(error, 'JSON')}") from None
    corners = _outline(path, np.array(home.verts, dtype=float).reshape(-1, 2))
    walls = np.hstack([corners, np.roll(corners, -1, axis=0)])
    return world_of_lines(path, f"Home {path.stem}", walls, np.empty((0, 3)), options.start)


def _outline(path: Path, corners: Array) -> Array:
    """The corners of the outline without its jogs, shape (n, 2), [m]."""
    if not 3 <= len(corners) <= MAX_VERTICES:
        raise SonarExploreError(
            f"{path.name}: verts has {len(corners)} corners; 3 to {MAX_VERTICES} are possible"
        )
    if not (np.abs(corners) <= MAX_COORDINATE_M).all():
        raise SonarExploreError(f"{path.name}: verts has a corner that is no place in metres")
    outermost = int(np.hypot(*(corners - corners.mean(axis=0)).T).argmax())  # the first one is always kept
    ring = shapely.LinearRing(np.roll(corners, -outermost, axis=0)).simplify(JOG_M, preserve_topology=False)
    if ring.is_empty or len(ring.coords) < 4:
        raise SonarExploreError(f"{path.name}: verts encloses no room")
    return np.array(ring.coords)[:-1]
