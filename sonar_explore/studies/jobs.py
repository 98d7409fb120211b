"""One episode of a study: what is run, under which name, and what comes out of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from sonar_explore import __version__
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import load_world
from sonar_explore.episodes.record import Summary
from sonar_explore.studies.options import with_option

NOT_RUNNING = {"studies", "reports"}  # packages whose change leaves an episode as it is


@dataclass(frozen=True)
class Variant:
    """What one arm of a study does otherwise than the default."""

    name: str
    """Also the name of its folder."""
    slam: str = "chain"
    changes: tuple[tuple[str, Any], ...] = ()
    """Options (dotted name, value)."""

    def applied_to(self, config: ExplorationConfig) -> ExplorationConfig:
        """The configuration of this arm."""
        for name, value in self.changes:
            config = with_option(config, name, value)
        return config


@dataclass(frozen=True)
class Job:
    """One episode to be run. Arms with the same world, noise and seed meet the same luck."""

    world: str
    variant: Variant
    seed: int
    noise: str
    base: ExplorationConfig

    @property
    def config(self) -> ExplorationConfig:
        """What the episode runs with."""
        return self.variant.applied_to(self.base.with_noise(self.noise))

    @property
    def path(self) -> Path:
        """Of its outcome, within the study's folder."""
        world = self.world.strip("/.").replace("/", "-")
        return Path("episodes") / self.variant.name / world / f"{self.seed:04d}.json"

    @property
    def fingerprint(self) -> str:
        """The same for the same episode: code, world, configuration, arm and noise."""
        config = msgspec.json.encode([self.config, self.variant.slam, self.noise])
        return _digest([code_fingerprint().encode(), _world_bytes(self.world), config])


class Outcome(msgspec.Struct, frozen=True):
    """What one episode came to."""

    world: str
    variant: str
    seed: int
    fingerprint: str
    version: str
    summary: Summary | None
    """None where the episode raised."""
    error: str | None
    """What it raised, in one line."""
    decision_cpu_s: tuple[float, ...] = ()
    """Processor time from each decision to the next: the drive, the scan and all thinking, in order, [s]."""


def jobs_of(
    worlds: Sequence[str],
    variants: Sequence[Variant],
    seeds: Iterable[int],
    noise: str,
    base: ExplorationConfig,
) -> list[Job]:
    """Seed by seed, so that a study that was cut short has whole pairs."""
    return [Job(w, v, s, noise, base) for s in seeds for w in worlds for v in variants]


@cache
def code_fingerprint() -> str:
    """Of version and source of all that an episode runs through."""
    root = Path(__file__).parents[1]
    sources = sorted(p for p in root.rglob("*.py") if p.relative_to(root).parts[0] not in NOT_RUNNING)
    sources = [p for p in sources if p.name not in ("cli.py", "commands.py")]
    return _digest([__version__.encode(), *(p.read_bytes() for p in sources)])


@cache
def _world_bytes(name: str) -> bytes:
    world = load_world(name)
    parts = [world.walls, world.roughness, world.cylinders]
    return b"".join(part.tobytes() for part in parts) + repr(world.start).encode()


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()[:16]
