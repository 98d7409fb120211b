"""Generated worlds: offices, homes, mazes and halls without end, each brought back by its name.

`generated/office-17` is always the same world; `generated/office` is the first of ever new ones that
`draw_world` makes; `generated/home-4?difficulty=0.9` is larger, fuller and more oblique than the default 0.5.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonar_explore.envs.generator import build, layouts
from sonar_explore.envs.world import GENERATED, World
from sonar_explore.errors import SonarExploreError, unknown_name

DEFAULT_DIFFICULTY = 0.5
MAX_SEED = 2**63 - 1

KINDS: dict[str, Callable[[np.random.Generator, float], layouts.Layout]] = {
    "hall": layouts.hall,
    "home": layouts.home,
    "maze": layouts.maze,
    "office": layouts.office,
}
_TITLES = {
    "hall": "A hall with pillars, slanting walls and screens",
    "home": "A home of rooms that lead into each other",
    "maze": "A maze of corridors",
    "office": "Offices on corridors",
}
_NAME = re.compile(r"([a-z]+)(?:-(\d{1,19}))?")


@dataclass(frozen=True)
class GeneratorName:
    """What the name of a generated world says."""

    kind: str
    seed: int | None
    """None for a new one each time."""
    difficulty: float

    def with_seed(self, seed: int) -> str:
        """The full name of one world."""
        tail = "" if self.difficulty == DEFAULT_DIFFICULTY else f"?difficulty={self.difficulty:g}"
        return f"{GENERATED}{self.kind}-{seed}{tail}"


def generator_names() -> tuple[str, ...]:
    """`generated/office` and its like."""
    return tuple(GENERATED + kind for kind in sorted(KINDS))


def generate(kind: str, seed: int, difficulty: float = DEFAULT_DIFFICULTY) -> World:
    """The world of that seed; difficulty 0 (small, plain, empty) to 1 (large, oblique, full, with loops).

    >>> generate("office", 17).name
    'generated/office-17'
    """
    if kind not in KINDS:
        raise unknown_name("generator", GENERATED + kind, generator_names())
    if not 0.0 <= difficulty <= 1.0:
        raise SonarExploreError(f"difficulty {difficulty:g}; 0 to 1 is possible")
    if not 0 <= seed <= MAX_SEED:
        raise SonarExploreError(f"seed {seed}; 0 to {MAX_SEED} is possible")
    name = GeneratorName(kind, seed, difficulty).with_seed(seed)
    rng = np.random.default_rng([sorted(KINDS).index(kind), seed, round(difficulty * 1e6)])
    return build.build(name, _TITLES[kind], lambda: KINDS[kind](rng, difficulty), rng, difficulty)


def generate_by_name(name: str, options: dict[str, str]) -> World:
    """The world of `generated/office-17` with `difficulty` and `seed` among the options; no seed is seed 0."""
    wanted = parse_name(name, options)
    return generate(wanted.kind, wanted.seed or 0, wanted.difficulty)


def draw(name: str, options: dict[str, str], rng: np.random.Generator) -> World:
    """A new world of `generated/office`; that of `generated/office-17`, always the same."""
    wanted = parse_name(name, options)
    seed = int(rng.integers(2**31)) if wanted.seed is None else wanted.seed
    return generate(wanted.kind, seed, wanted.difficulty)


def parse_name(name: str, options: dict[str, str]) -> GeneratorName:
    """The parts of `generated/office-17` and its options."""
    match = _NAME.fullmatch(name.removeprefix(GENERATED))
    if match is None or match.group(1) not in KINDS:
        known = unknown_name("world", name, generator_names())
        raise SonarExploreError(f"{known}, each with a seed of 0 to {MAX_SEED}, as {GENERATED}office-17")
    for key in options:
        if key not in ("difficulty", "seed"):
            raise SonarExploreError(f"{name}: {unknown_name('option', key, ('difficulty', 'seed'))}")
    try:
        seed = int(options["seed"]) if "seed" in options else None
        difficulty = float(options.get("difficulty", DEFAULT_DIFFICULTY))
    except ValueError:
        said = "&".join(f"{key}={value}" for key, value in options.items())
        raise SonarExploreError(f"{name}: a value is no number: {said}") from None
    return GeneratorName(match.group(1), seed if match.group(2) is None else int(match.group(2)), difficulty)
