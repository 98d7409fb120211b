"""The world: straight specular walls, round columns and the place where the robot starts.

`load_world` takes the name of a shipped world (`paper/rooms`) or of a generated one (`generated/office-17`),
or a file, which the reader for its suffix turns into a `World`. Every reader ends in `validate`, so that a
`World` in hand is one a robot can drive in. Formats and the shipped worlds: docs/worlds.md.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sonar_explore.envs.room import bounds_of
from sonar_explore.envs.validation import validate
from sonar_explore.errors import SonarExploreError, unknown_name
from sonar_explore.geometry import Array, Pose

MAX_FILE_BYTES = 64 * 2**20

GENERATED = "generated/"
"""What the names of generated worlds begin with."""
_SHIPPED = Path(__file__).parent / "worlds"
_CHUNK = 1_000_000

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


@dataclass(frozen=True)
class ReadOptions:
    """What a caller may say about a file that the file leaves open."""

    start: Pose | None = None
    """`pose_robot_in_world`; None takes the file's own, or the roomiest place."""
    resolution_m: float | None = None
    """Metres per pixel of an image, or per user unit of an SVG."""


@dataclass(frozen=True, eq=False)
class World:
    """A building as a sonar meets it, in the world frame."""

    name: str
    """`paper/rooms` where shipped, else the file's stem."""
    title: str
    """One line for a reader."""
    walls: Array
    """Straight specular walls x1 y1 x2 y2, shape (n, 4), [m]; both sides reflect."""
    roughness: Array
    """Share of diffuse return of each wall, shape (n,), 0 (mirror) to 1."""
    cylinders: Array
    """Round columns and chair legs x y radius, shape (m, 3), [m]."""
    start: Pose
    """`pose_robot_in_world` when the episode begins."""
    has_loop: bool
    """The way closes on itself, so that a loop can be closed."""

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max) of walls and cylinders, [m]."""
        return bounds_of(self.walls, self.cylinders)

    def clearance(self, points: Array) -> Array:
        """Distance of points (n, 2) to the nearest wall or cylinder, [m]; negative inside a cylinder."""
        nearest = np.full(len(points), np.inf)
        step = max(1, _CHUNK // (len(self.walls) + 1))
        for i in range(0, len(points), step):
            chunk = points[i : i + step]
            nearest[i : i + step] = distances_to_walls(chunk, self.walls).min(axis=1, initial=np.inf)
        for x, y, radius in self.cylinders:
            np.minimum(nearest, np.hypot(points[:, 0] - x, points[:, 1] - y) - radius, out=nearest)
        return nearest


def distances_to_walls(points: Array, walls: Array) -> Array:
    """Distance of each point, shape (n, 2), to each wall, shape (m, 4): shape (n, m), [m]."""
    x1, y1 = walls[:, 0], walls[:, 1]
    dx, dy = walls[:, 2] - x1, walls[:, 3] - y1
    px, py = points[:, 0, None] - x1, points[:, 1, None] - y1
    share = np.clip((px * dx + py * dy) / np.maximum(dx * dx + dy * dy, 1e-300), 0.0, 1.0)
    return np.hypot(px - share * dx, py - share * dy)


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
    if name in shipped_worlds():
        world = _reader(".toml")(_SHIPPED / f"{name}.toml", ReadOptions(given.start))
        return replace(world, name=name)
    path = Path(name)
    suffix = path.suffix.lower()
    if suffix in _READERS:
        if given.resolution_m is not None and suffix not in _UNSCALED:
            raise SonarExploreError(f"{path.name}: the file says its own scale; it takes no resolution")
        return _reader(suffix)(path, given)
    if path.is_file():
        raise SonarExploreError(
            f"{path.name}: no reader for files that end in {path.suffix!r}; known: {', '.join(_READERS)}"
        )
    known = unknown_name("world", name, shipped_worlds())
    raise SonarExploreError(f"{known}, {GENERATED}..., or a file that ends in {', '.join(_READERS)}")


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


def read_bytes(path: Path, limit: int = MAX_FILE_BYTES) -> bytes:
    """The bytes of a world file; the errors of the file system in one line."""
    try:
        if path.exists() and not path.is_file():
            raise SonarExploreError(f"cannot read the world file {str(path)!r}: it is no plain file")
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except FileNotFoundError:
        shipped = ", ".join(shipped_worlds())
        raise SonarExploreError(f"no world file {str(path)!r}; shipped: {shipped}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SonarExploreError(f"cannot read the world file {str(path)!r}: {reason}") from None
    if len(data) > limit:
        raise SonarExploreError(f"{path.name}: the file is larger than {limit / 2**20:g} MiB")
    if not data.strip():
        raise SonarExploreError(f"{path.name}: the world file is empty")
    return data


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
