"""What a robot believes, or the truth from above, as a picture or as text, in numpy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.world import World
from sonar_explore.explorer import Situation
from sonar_explore.geometry import Array, Pose
from sonar_explore.mapping.grid import FREE, OCCUPIED

_SHADES = np.array([[178, 178, 178], [255, 255, 255], [30, 30, 30]], dtype=np.uint8)
_SCANS, _CANDIDATES, _ROBOT = (0, 114, 178), (230, 159, 0), (213, 94, 0)
_PIXELS_PER_M, _MOST_PIXELS, _MOST_CHARACTERS = 40.0, 800.0, 100.0
_MARGIN_M = 0.25


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
    """The true walls (black), the robot (red, with its heading) and echoes (n, 2) [m] (blue), north up."""
    view = _TopView(world, min(_PIXELS_PER_M, _MOST_PIXELS / _extent(world)))
    picture = np.full((*view.shape, 3), 255, dtype=np.uint8)
    body = _disc(AmigoBot.radius_m)
    nose = np.linspace([0.0, 0.0], [2.0 * AmigoBot.radius_m, 0.0], 40)
    for points, colour in (
        (_wall_points(world, 0.5 / view.per_m), _SHADES[2]),
        (true_pose.transform(np.vstack([body, nose])), _ROBOT),
        ((echoes[:, None, :] + _disc(0.04)).reshape(-1, 2), _SCANS),
    ):
        rows, columns = view.cells(points)
        picture[rows, columns] = colour
    return np.ascontiguousarray(picture[::-1])


def top_view_ansi(world: World, true_pose: Pose) -> str:
    """The true walls `#` and the robot `R` as text, a character for 20 by 20 cm (more in a large world)."""
    view = _TopView(world, min(5.0, _MOST_CHARACTERS / _extent(world)))
    text = np.full(view.shape, " ")
    text[view.cells(_wall_points(world, 0.5 / view.per_m))] = "#"
    text[view.cells(np.array([[true_pose.x, true_pose.y]]))] = "R"
    return "\n".join("".join(line).rstrip() for line in text[::-1])


class _TopView:
    """World metres to picture cells, row 0 the lowest y."""

    def __init__(self, world: World, per_m: float) -> None:
        x_min, y_min, x_max, y_max = world.bounds
        self.per_m = per_m
        self._low = np.array([x_min, y_min]) - _MARGIN_M
        size = np.ceil((np.array([x_max, y_max]) + _MARGIN_M - self._low) * per_m).astype(int)
        self.shape = (int(size[1]), int(size[0]))

    def cells(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the points, shape (n, 2) [m], that lie in the picture."""
        cells = np.floor((points - self._low) * self.per_m).astype(np.int64)
        cells = cells[((cells >= 0) & (cells < self.shape[::-1])).all(axis=1)]
        return cells[:, 1], cells[:, 0]


def _extent(world: World) -> float:
    x_min, y_min, x_max, y_max = world.bounds
    return max(x_max - x_min, y_max - y_min)


def _wall_points(world: World, apart_m: float) -> Array:
    """Points along every wall and round every column, shape (n, 2), [m]."""
    lines = [
        np.linspace(wall[:2], wall[2:], int(np.hypot(*(wall[2:] - wall[:2])) / apart_m) + 2)
        for wall in world.walls
    ]
    columns = [centre + _disc(radius) for *centre, radius in world.cylinders.tolist()]
    return np.vstack([*lines, *columns])


def _disc(radius_m: float) -> Array:
    """Points that fill a disc about the origin, shape (n, 2), [m]."""
    side = np.linspace(-radius_m, radius_m, 2 * int(radius_m * _PIXELS_PER_M) + 3)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return points[np.hypot(points[:, 0], points[:, 1]) <= radius_m]
