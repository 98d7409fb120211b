"""A drawn floor plan, PNG or PGM: bright is free, dark is wall."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
import skimage.color
import skimage.io

from sonar_explore.envs.readers.bitmap import Bitmap, bitmap_world
from sonar_explore.envs.readers.source import ReadOptions, read_bytes
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

DEFAULT_RESOLUTION_M = 0.05
DEFAULT_THRESHOLD = 210
"""Brighter pixels are free, 0 to 255; just above 205, the grey that map servers draw for unknown."""
MAX_PIXELS = 16_000_000
_MAGIC = (b"\x89PNG", b"P2", b"P5")


def read_image(path: Path, options: ReadOptions) -> World:
    """The world in a drawing of 0.05 m per pixel, unless said otherwise."""
    resolution = DEFAULT_RESOLUTION_M if options.resolution_m is None else options.resolution_m
    return load_image_world(path, resolution, options.start)


def load_image_world(
    path: str | Path,
    resolution_m: float = DEFAULT_RESOLUTION_M,
    start: Pose | None = None,
    threshold: float = DEFAULT_THRESHOLD,
) -> World:
    """The world in a drawing: row 0 on top, the world's origin at the lower left corner of the image."""
    path = Path(path)
    free = brightness(path) > threshold
    if not free.any() or free.all():
        what = "brighter" if not free.any() else "as dark or darker"
        raise SonarExploreError(
            f"{path.name}: no pixel is {what} than the threshold {threshold:g} of 0 to 255"
        )
    return bitmap_world(Bitmap(path.name, free, resolution_m), f"Floor plan {path.name}", start)


def brightness(path: Path) -> Array:
    """Grey values 0 to 255, shape (rows, columns); what is transparent shows white paper."""
    data = read_bytes(path)
    if not data.startswith(_MAGIC):
        raise SonarExploreError(f"{path.name}: not a PNG or PGM image: it starts with {data[:8]!r}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of decoders that are tried in vain
            image = np.asarray(skimage.io.imread(io.BytesIO(data)))
    except Exception:  # the decoders raise whatever they meet
        raise SonarExploreError(f"{path.name}: a PNG or PGM image that is damaged or cut short") from None
    if image.ndim not in (2, 3) or image.size == 0 or image.shape[0] * image.shape[1] > MAX_PIXELS:
        raise SonarExploreError(f"{path.name}: image of shape {image.shape}; at most {MAX_PIXELS} pixels")
    top = np.iinfo(image.dtype).max if np.issubdtype(image.dtype, np.integer) else 1.0
    levels = image.astype(float) / top
    if levels.ndim == 2:
        return 255.0 * levels
    alpha = levels[..., -1] if levels.shape[2] in (2, 4) else np.ones(levels.shape[:2])
    grey = skimage.color.rgb2gray(levels[..., :3]) if levels.shape[2] >= 3 else levels[..., 0]
    return 255.0 * (alpha * grey + 1.0 - alpha)
