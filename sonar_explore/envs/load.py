"""Worlds by name: shipped, generated, or in a file.

`load_world` takes the name of a shipped world (`paper/rooms`) or of a generated one (`generated/office-17`),
or a file, which the reader for its suffix turns into a `World`. Every reader ends in `validate`, so that a
`World` in hand is one a robot can drive in. Formats and the shipped worlds: docs/worlds.md.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from sonar_explore.envs.readers.source import ReadOptions
from sonar_explore.envs.validation import validate, validate_start
from sonar_explore.envs.world import GENERATED, World
from sonar_explore.errors import SonarExploreError, unknown_name
from sonar_explore.geometry import Pose

_SHIPPED = Path(__file__).parent / "worlds"

# One reader a file, imported when its suffix is met: only drawings need scikit-image.
_READERS = {
    ".toml": "sonar_explore.envs.readers.toml_world:read_toml",
    ".json": "sonar_explore.envs.readers.houseexpo:read_houseexpo",
    ".yaml": "sonar_explore.envs.readers.ros_map:read_ros_map",
    ".yml": "sonar_explore.envs.readers.ros_map:read_ros_map",
    ".map": "sonar_explore.envs.readers.mobilesim:read_mobilesim",
    ".svg": "sonar_explore.envs.readers.svg:read_svg",
    ".png": "sonar_explore.envs.readers.image:read_image",
    ".pgm": "sonar_explore.envs.readers.image:read_image",
}
_UNSCALED = (".svg", ".png", ".pgm")
"""Formats that may leave it to the reader what one unit is."""


def shipped_worlds() -> tuple[str, ...]:
    """The names that `load_world` knows without a file."""
    return tuple(sorted(p.relative_to(_SHIPPED).with_suffix("").as_posix() for p in _SHIPPED.rglob("*.toml")))


def load_world(
    name_or_path: str | Path, start: Pose | None = None, resolution_m: float | None = None
) -> World:
    """The shipped or generated world of that name, or the world in that file.

    `start` and `resolution_m` say what a file leaves open, or put the robot elsewhere. Both fit into a name:
    `plan.png?resolution=0.02&start=1.5,2,90` (metres, degrees).

    >>> load_world("paper/corridor").title
    'A straight corridor'
    """
    name, options = _split_options(name_or_path)
    if name.startswith(GENERATED):
        from sonar_explore.envs.generator import generate_by_name

        world = generate_by_name(name, options)
        return world if start is None else validate(replace(world, start=start))
    given = _read_options(name, options)
    given = ReadOptions(start or given.start, given.resolution_m if resolution_m is None else resolution_m)
    if given.start is not None:
        validate_start(name, given.start)
    if name in shipped_worlds():
        world = _reader(".toml")(_SHIPPED / f"{name}.toml", ReadOptions(given.start))
        return replace(world, name=name)
    path = Path(name)
    suffix = path.suffix.lower()
    if suffix in _READERS:
        if given.resolution_m is not None and suffix not in _UNSCALED:
            raise SonarExploreError(f"{path.name}: the file says its own scale; it takes no resolution")
        try:
            return _reader(suffix)(path, given)
        except SonarExploreError as error:
            if _exists(path):
                raise
            raise SonarExploreError(f"{error}; shipped: {', '.join(shipped_worlds())}") from None
    if path.is_file():
        raise SonarExploreError(
            f"{path.name}: no reader for files that end in {path.suffix!r}; known: {', '.join(_READERS)}"
        )
    if path.is_dir():
        raise SonarExploreError(f"{name!r} is a folder; give a file in it that ends in {', '.join(_READERS)}")
    from sonar_explore.envs.generator import generator_names

    known = unknown_name("world", name, shipped_worlds(), hidden=generator_names())
    raise SonarExploreError(f"{known}, {GENERATED}..., or a file that ends in {', '.join(_READERS)}")


def assumed_scale(name: str) -> str:
    """What was taken for the scale of a drawing that leaves it open; empty where nothing was."""
    file, options = _split_options(name)
    if Path(file).suffix.lower() not in (".png", ".pgm") or "resolution" in options:
        return ""
    from sonar_explore.envs.readers.image import DEFAULT_RESOLUTION_M

    return f"{DEFAULT_RESOLUTION_M:g} m a pixel is assumed; FILE?resolution=... says another"


def is_generator(name: object) -> bool:
    """Whether the name stands for ever new worlds: `generated/office`, and not `generated/office-17`."""
    if not isinstance(name, str) or not name.startswith(GENERATED):
        return False
    from sonar_explore.envs.generator import parse_name

    return parse_name(*_split_options(name)).seed is None


def draw_world(name: str, rng: np.random.Generator) -> World:
    """A new world of a generator; its own name, with the seed, brings it back."""
    from sonar_explore.envs.generator import draw

    return draw(*_split_options(name), rng)


def drawn_name(name: str, seed: int) -> str:
    """The name of the world that an environment of this generator draws when it is reset with this seed."""
    from gymnasium.utils.seeding import np_random

    return draw_world(name, np_random(seed)[0]).name


def _split_options(name_or_path: str | Path) -> tuple[str, dict[str, str]]:
    """`name?key=value&...` as its name and options; a file that is really called so keeps its name."""
    text = str(name_or_path)
    name, mark, tail = text.rpartition("?")
    if not mark or isinstance(name_or_path, Path):
        return text, {}
    pairs = [part.partition("=") for part in tail.split("&")]
    if not all(key and equals for key, equals, _ in pairs):
        raise SonarExploreError(f"{text!r}: options look like ?resolution=0.02&start=1.5,2,90")
    return name, {key: value for key, _, value in pairs}


def _read_options(name: str, options: dict[str, str]) -> ReadOptions:
    for key in options:
        if key not in ("resolution", "start"):
            raise SonarExploreError(f"{name}: {unknown_name('option', key, ('resolution', 'start'))}")
    try:
        resolution = float(options["resolution"]) if "resolution" in options else None
        numbers = [float(n) for n in options["start"].split(",")] if "start" in options else []
    except ValueError:
        said = "&".join(f"{key}={value}" for key, value in options.items())
        raise SonarExploreError(f"{name}: a value is no number: {said}") from None
    if numbers and len(numbers) not in (2, 3):
        raise SonarExploreError(f"{name}: start is x,y or x,y,degrees; got {options['start']!r}")
    start = Pose(numbers[0], numbers[1], math.radians(([*numbers, 0.0])[2])) if numbers else None
    return ReadOptions(start, resolution)


def _reader(suffix: str) -> Callable[[Path, ReadOptions], World]:
    module, _, function = _READERS[suffix].partition(":")
    reader: Callable[[Path, ReadOptions], World] = getattr(importlib.import_module(module), function)
    return reader


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name too long, or with a null in it
        return True
