"""A world as a picture: the plan, the start, and what the robot reaches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from sonar_explore.amigobot import AmigoBot
from sonar_explore.envs.room import room_for
from sonar_explore.envs.survey import DOOR_MAX_M, Survey
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.wording import counted

_WALL, _REACHED, _START, _NARROW = "#1a1a1a", "#cfe3f2", "#d55e00", "#b3367a"
_PAPER = "#f3f3f1"


def save_picture(world: World, found: Survey, path: Path) -> None:
    """The plan with a title and what was found, to a PNG, SVG or PDF file."""
    width, height = found.extent_m
    scale = 7.0 / max(width, height, 1e-9)
    figure = Figure(
        figsize=(max(4.5, width * scale + 0.8), max(3.0, height * scale + 1.0)), layout="constrained"
    )
    axes = figure.add_subplot()
    draw_plan(axes, world)
    narrow = found.passages[found.passages[:, 2] <= DOOR_MAX_M][:60]
    if len(narrow):
        label = counted(found.doors, "narrow passage")
        axes.plot(*narrow[:, :2].T, "D", color=_NARROW, markersize=3.5, label=label, zorder=4)
    axes.set_title(
        f"{world.name}: {found.free_area_m2:.1f} m², {100 * found.reached_share:.1f} % within reach",
        fontsize=10,
    )
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.tick_params(labelsize=8)
    handles, _ = axes.get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    save(figure, path)


def draw_plan(axes: Axes, world: World) -> None:
    """Walls, columns, the reachable floor and the start, north up, one scale on both axes."""
    x_min, y_min, x_max, y_max = world.bounds
    room = room_for(world.walls, world.cylinders, (x_min, y_min, x_max, y_max))
    centres = room.reachable(world.start.x, world.start.y, AmigoBot.radius_m)
    floor = np.ma.masked_equal(_swept(centres, AmigoBot.radius_m / room.cell_m), 0)
    half = room.cell_m / 2
    rows, cols = centres.shape
    axes.set_facecolor(_PAPER)
    axes.imshow(
        floor,
        cmap=ListedColormap([_REACHED]),
        origin="lower",
        extent=(
            room.origin[0] - half,
            room.origin[0] - half + cols * room.cell_m,
            room.origin[1] - half,
            room.origin[1] - half + rows * room.cell_m,
        ),
        interpolation="nearest",
        zorder=1,
    )
    axes.plot([], [], "s", color=_REACHED, markersize=8, label="within the robot's reach")
    thickness = float(np.clip(18.0 / max(x_max - x_min, y_max - y_min), 0.5, 1.6))
    axes.add_collection(
        LineCollection(
            list(world.walls.reshape(-1, 2, 2)),
            colors=_WALL,
            linewidths=thickness,
            capstyle="round",
            zorder=2,
        )
    )
    circles = [Circle((x, y), radius) for x, y, radius in world.cylinders.tolist()]
    axes.add_collection(PatchCollection(circles, facecolor=_WALL, edgecolor=_WALL, linewidths=0.3, zorder=2))
    start = world.start
    size = max(AmigoBot.radius_m, 0.02 * max(x_max - x_min, y_max - y_min))
    nose = start.transform(np.array([[1.6, 0.0], [-0.8, 0.8], [-0.4, 0.0], [-0.8, -0.8]]) * size)
    axes.fill(nose[:, 0], nose[:, 1], color=_START, label="start", zorder=3, linewidth=0)
    margin = 0.03 * max(x_max - x_min, y_max - y_min)
    axes.set(xlim=(x_min - margin, x_max + margin), ylim=(y_min - margin, y_max + margin), aspect="equal")


def save(figure: Figure, path: Path, dpi: int = 110) -> None:
    """Write a figure; what the file system or the format refuses is one line."""
    try:
        figure.savefig(path, dpi=dpi)
    except (OSError, ValueError) as error:
        why = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise SonarExploreError(f"cannot write the picture {str(path)!r}: {why}") from None


def _swept(centres: np.ndarray, radius_cells: float) -> np.ndarray:
    """Cells that a disc covers somewhere, 1 or 0."""
    from scipy import ndimage

    if not centres.any():
        return centres.astype(np.uint8)
    return np.asarray(ndimage.distance_transform_edt(~centres) <= radius_cells, dtype=np.uint8)
