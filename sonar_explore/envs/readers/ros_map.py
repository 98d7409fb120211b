"""ROS map_server: a YAML file of scale and thresholds, and the image it names, in the same folder or below.

A pixel of brightness v stands for the probability p = (255 - v) / 255 of a wall, or v / 255 with `negate`.
Below `free_thresh` it is free, above `occupied_thresh` wall, and unknown in between; a robot can neither
enter nor see through the unknown, so that it is wall here. The world's frame is the map's.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

import msgspec
import numpy as np

from sonar_explore.envs.readers.bitmap import Bitmap, bitmap_world
from sonar_explore.envs.readers.image import brightness
from sonar_explore.envs.readers.source import ReadOptions, read_bytes, why_undecoded
from sonar_explore.envs.validation import MAX_COORDINATE_M
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

MAX_BYTES = 64 * 2**10
_MAX_BRACKETS = 100

Probability = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class MapFile(msgspec.Struct, frozen=True):
    """The fields of map_server; others are left alone."""

    image: str
    resolution: Annotated[float, msgspec.Meta(gt=0.0)]
    origin: Annotated[tuple[float, ...], msgspec.Meta(min_length=2, max_length=3)] = (0.0, 0.0, 0.0)
    negate: bool | int = 0
    occupied_thresh: Probability = 0.65
    free_thresh: Probability = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def read_ros_map(path: Path, options: ReadOptions) -> World:
    """The world in a map_server YAML file and its image."""
    file = _decode(path)
    grey = brightness(_image_beside(path, file.image))
    occupied = grey / 255.0 if file.negate else 1.0 - grey / 255.0
    if file.mode == "raw":  # the brightness is the percentage itself; 255 is unknown
        occupied = grey / 100.0
    free = occupied < file.free_thresh
    if not free.any():
        raise SonarExploreError(f"{path.name}: no pixel of {file.image} is free (p < {file.free_thresh:g})")
    x, y, yaw = (*file.origin, 0.0)[:3]
    bitmap = Bitmap(path.name, free, file.resolution, Pose(x, y, yaw))
    return bitmap_world(bitmap, f"Map {path.name}", options.start)


def _decode(path: Path) -> MapFile:
    data = read_bytes(path, MAX_BYTES)
    if data.count(b"[") + data.count(b"{") > _MAX_BRACKETS:
        raise SonarExploreError(f"{path.name}: nested too deeply for a map_server file")
    try:
        file = msgspec.yaml.decode(data, type=MapFile, strict=False)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SonarExploreError(f"{path.name}: {why_undecoded(error, 'YAML')}") from None
    except Exception as error:  # the YAML library raises what its parts raise: dates, bases, surrogates
        reason = " ".join(str(error).split())
        raise SonarExploreError(f"{path.name}: no map_server file: {reason}") from None
    if not (np.abs(file.origin) <= MAX_COORDINATE_M).all():
        raise SonarExploreError(f"{path.name}: the origin is no place in metres: {list(file.origin)}")
    return file


def _image_beside(path: Path, image: str) -> Path:
    """The image that the file names; a stranger's file shall not point anywhere on this machine."""
    name = PurePosixPath(image)
    if name.is_absolute() or ".." in name.parts or not image.strip() or "\0" in image:
        raise SonarExploreError(f"{path.name}: the image {image!r} must lie in the same folder or below it")
    beside = path.parent / name
    if not beside.is_file():
        raise SonarExploreError(
            f"{path.name}: there is no image {image!r} beside it, in {str(path.parent)!r}"
        )
    return beside
