"""An episode in the formats that people use: TUM trajectories, and maps for ROS map_server."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sonar_explore.episodes.files import write_atomically
from sonar_explore.episodes.record import EpisodeRecord, GridRecord, Pose3
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import wrap_angle
from sonar_explore.mapping.grid import FREE, OCCUPIED

BRIGHTNESS = {FREE: 254, OCCUPIED: 0}
UNKNOWN_BRIGHTNESS = 205
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
"""As map_saver writes them: brightness 205 lies between the two."""


def write_trajectory(record: EpisodeRecord, path: Path, *, true: bool = False) -> None:
    """The pose of every scan as a TUM file: as believed after its correction, or as it truly was."""
    poses = [step.true_pose if true else step.pose for step in record.steps]
    write_atomically(path, tum([step.sim_time_s for step in record.steps], poses).encode())


def tum(times_s: Sequence[float], poses: Sequence[Pose3]) -> str:
    """Lines of `timestamp tx ty tz qx qy qz qw`: seconds, metres, a unit quaternion about z, its qw not negative.

    >>> tum([1.5], [(1.0, 2.0, 0.0)])
    '1.500000 1.000000 2.000000 0.000000 0 0 0.000000000 1.000000000\\n'
    """
    lines = []
    for t, (x, y, heading) in zip(times_s, poses, strict=True):
        half = 0.5 * wrap_angle(heading)
        lines.append(f"{t:.6f} {x:.6f} {y:.6f} 0.000000 0 0 {math.sin(half):.9f} {math.cos(half):.9f}\n")
    return "".join(lines)


def write_ros_map(record: EpisodeRecord, name: Path, states: np.ndarray) -> tuple[Path, Path]:
    """`name.yaml` and `name.pgm`, as map_server reads them; the frame is the episode's map frame.

    Args:
        states: of the grid's cells, shape (rows, columns), row 0 the lowest y.
    """
    settings, image = ros_map_files(name)
    write_atomically(image, pgm(states))
    write_atomically(settings, _settings(record.grid, image.name).encode())
    return settings, image


def ros_map_files(name: Path) -> tuple[Path, Path]:
    """`name.yaml` and `name.pgm`, where the name may end in one of the two."""
    name = name.with_suffix("") if name.suffix in (".yaml", ".pgm") else name
    if not name.name.strip():
        raise SonarExploreError("a map needs a name")
    return name.with_name(name.name + ".yaml"), name.with_name(name.name + ".pgm")


def pgm(states: np.ndarray) -> bytes:
    """Cells as grey: free 254, occupied 0, unknown 205; the highest y comes first, as pictures have it."""
    grey = np.full(states.shape, UNKNOWN_BRIGHTNESS, dtype=np.uint8)
    for state, brightness in BRIGHTNESS.items():
        grey[states == state] = brightness
    rows, columns = states.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + grey[::-1].tobytes()


def _settings(grid: GridRecord, image: str) -> str:
    x, y = grid.origin
    quoted = image.replace("'", "''")
    return (
        f"image: '{quoted}'\nresolution: {grid.resolution_m:.6f}\norigin: [{x:.6f}, {y:.6f}, 0.000000]\n"
        f"negate: 0\noccupied_thresh: {OCCUPIED_THRESH}\nfree_thresh: {FREE_THRESH}\nmode: trinary\n"
    )
