"""A situation as a picture or as text, in numpy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_explore.explorer import Situation
from sonar_explore.mapping.grid import FREE, OCCUPIED

_SHADES = np.array([[178, 178, 178], [255, 255, 255], [30, 30, 30]], dtype=np.uint8)
_SCANS, _CANDIDATES, _ROBOT = (0, 114, 178), (230, 159, 0), (213, 94, 0)


def render_rgb(situation: Situation) -> NDArray[np.uint8]:
    """The map with scan positions (blue), candidates (orange) and the robot (red), north up, (rows, columns, 3)."""
    grid = situation.grid
    picture = _SHADES[grid.states].copy()
    candidates = np.array([(c.x, c.y) for c in situation.candidates]).reshape(-1, 2)
    robot = np.array([[situation.pose.x, situation.pose.y]])
    for points, colour in ((candidates, _CANDIDATES), (situation.scan_positions, _SCANS), (robot, _ROBOT)):
        for row, column in grid.frame.cells(points):
            picture[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2] = colour
    return np.ascontiguousarray(np.kron(picture[::-1], np.ones((3, 3, 1), dtype=np.uint8)))


def render_ansi(situation: Situation) -> str:
    """The map as text, a character for 20 by 20 cm: `#` wall, `.` free, `R` robot, `o` scan position."""
    grid = situation.grid
    block = 4
    rows, columns = (n // block for n in grid.frame.shape)
    blocks = grid.states[: rows * block, : columns * block].reshape(rows, block, columns, block)
    text = np.where((blocks == OCCUPIED).any(axis=(1, 3)), "#", np.where((blocks == FREE).any(axis=(1, 3)), ".", " "))
    for points, mark in ((situation.scan_positions, "o"), (np.array([[situation.pose.x, situation.pose.y]]), "R")):
        for row, column in grid.frame.cells(points) // block:
            text[row, column] = mark
    return "\n".join("".join(line).rstrip() for line in text[::-1])
