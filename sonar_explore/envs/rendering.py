"""What a robot believes, or the truth from above, as a picture or as text, in numpy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.world import World
from sonar_explore.explorer import Situation
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.grid import FREE, OCCUPIED, GridFrame, window

_SHADES = np.array([[178, 178, 178], [255, 255, 255], [30, 30, 30]], dtype=np.uint8)
_SCANS, _CANDIDATES, _ROBOT = (0, 114, 178), (230, 159, 0), (213, 94, 0)
_ROWS, _COLUMNS, _MOST_PER_M = 600, 800, 100.0  # of the top view, [pixels], [pixels/m]
_LONGER_SIDE = 1280  # of the map's picture at the most, [pixels]
_MOST_CHARACTERS = 100.0
_MARGIN_M = 0.25


def render_rgb(situation: Situation, frame: GridFrame) -> NDArray[np.uint8]:
    """The map with scan positions (blue), candidates (orange) and the robot (red), north up, (rows, columns, 3).

    It shows what falls on `frame`: the picture's size and scale stay, however much of the map is known.
    """
    grid = situation.grid
    picture = _SHADES[window(grid.frame, grid.states, frame)]
    candidates = np.array([(c.x, c.y) for c in situation.candidates]).reshape(-1, 2)
    robot = np.array([[situation.pose.x, situation.pose.y]])
    for points, colour in ((candidates, _CANDIDATES), (situation.scan_positions, _SCANS), (robot, _ROBOT)):
        for row, column in frame.cells(points):
            picture[max(0, row - 1) : max(0, row + 2), max(0, column - 1) : max(0, column + 2)] = colour
    pixels = max(1, _LONGER_SIDE // max(frame.shape))
    return picture[::-1].repeat(pixels, axis=0).repeat(pixels, axis=1)


def render_ansi(situation: Situation) -> str:
    """The map as text, a character for 20 by 20 cm: `#` wall, `.` free, `R` robot, `o` scan position."""
    grid = situation.grid
    block = 4
    rows, columns = (n // block for n in grid.frame.shape)
    blocks = grid.states[: rows * block, : columns * block].reshape(rows, block, columns, block)
    text = np.where(
        (blocks == OCCUPIED).any(axis=(1, 3)), "#", np.where((blocks == FREE).any(axis=(1, 3)), ".", " ")
    )
    for points, mark in (
        (situation.scan_positions, "o"),
        (np.array([[situation.pose.x, situation.pose.y]]), "R"),
    ):
        for row, column in grid.frame.cells(points) // block:
            text[row, column] = mark
    return "\n".join("".join(line).rstrip() for line in text[::-1])


def top_view_rgb(world: World, true_pose: Pose, echoes: Array) -> NDArray[np.uint8]:
    """The true walls (black), the robot (red, with its heading) and echoes (n, 2) [m] (blue), north up.

    The picture has 600 rows and 800 columns whatever the world, which lies in its middle.
    """
    view = _TopView.on_canvas(world)
    picture = np.full((*view.shape, 3), 255, dtype=np.uint8)
    apart = 0.5 / view.per_m
    body = _disc(AmigoBot.radius_m, apart)
    nose = np.linspace([0.0, 0.0], [2.0 * AmigoBot.radius_m, 0.0], 80)
    for points, colour in (
        (_wall_points(world, apart), _SHADES[2]),
        (true_pose.transform(np.vstack([body, nose])), _ROBOT),
        ((echoes[:, None, :] + _disc(max(0.04, 2.0 * apart), apart)).reshape(-1, 2), _SCANS),
    ):
        rows, columns = view.cells(points)
        picture[rows, columns] = colour
    return np.ascontiguousarray(picture[::-1])


def top_view_ansi(world: World, true_pose: Pose) -> str:
    """The true walls `#` and the robot `R` as text, a character for 20 by 20 cm (more in a large world)."""
    view = _TopView.around(world, min(5.0, _MOST_CHARACTERS / _extent(world)))
    text = np.full(view.shape, " ")
    text[view.cells(_wall_points(world, 0.5 / view.per_m))] = "#"
    text[view.cells(np.array([[true_pose.x, true_pose.y]]))] = "R"
    return "\n".join("".join(line).rstrip() for line in text[::-1])


@dataclass(frozen=True, eq=False)
class _TopView:
    """World metres to picture cells, row 0 the lowest y."""

    low: Array
    """x, y of the picture's lower left corner, [m]."""
    per_m: float
    """[cells/m]"""
    shape: tuple[int, int]
    """(rows, columns)"""

    @classmethod
    def around(cls, world: World, per_m: float) -> _TopView:
        """As large as the world needs."""
        low, high = _corners(world)
        columns, rows = np.ceil((high - low) * per_m).astype(int).tolist()
        return cls(low, per_m, (rows, columns))

    @classmethod
    def on_canvas(cls, world: World) -> _TopView:
        """As large as always, at the largest scale at which the world fits."""
        low, high = _corners(world)
        canvas = np.array([_COLUMNS, _ROWS])
        per_m = min(_MOST_PER_M, float((canvas / (high - low)).min()))
        return cls(0.5 * (low + high - canvas / per_m), per_m, (_ROWS, _COLUMNS))

    def cells(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the points, shape (n, 2) [m], that lie in the picture."""
        cells = np.floor((points - self.low) * self.per_m).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < self.shape[::-1])).all(axis=1)]
        return cells[:, 1], cells[:, 0]


def _corners(world: World) -> tuple[Array, Array]:
    """Lower left and upper right of the world with a margin, [m]."""
    x_min, y_min, x_max, y_max = world.bounds
    return np.array([x_min, y_min]) - _MARGIN_M, np.array([x_max, y_max]) + _MARGIN_M


def _extent(world: World) -> float:
    x_min, y_min, x_max, y_max = world.bounds
    return max(x_max - x_min, y_max - y_min)


def _wall_points(world: World, apart_m: float) -> Array:
    """Points along every wall and round every column, shape (n, 2), [m]."""
    lines = [
        np.linspace(wall[:2], wall[2:], int(np.hypot(*(wall[2:] - wall[:2])) / apart_m) + 2)
        for wall in world.walls
    ]
    columns = [centre + _disc(radius, apart_m) for *centre, radius in world.cylinders.tolist()]
    return np.vstack([*lines, *columns])


def _disc(radius_m: float, apart_m: float) -> Array:
    """Points that fill a disc about the origin, so far apart, [m]."""
    side = np.linspace(-radius_m, radius_m, 2 * int(radius_m / apart_m) + 3)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return points[np.hypot(points[:, 0], points[:, 1]) <= radius_m]
