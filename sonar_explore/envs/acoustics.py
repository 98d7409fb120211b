"""The physics of a ping: echo sources, their amplitude, and the first echo (READING section 2).

A sonar hears the *first* echo above a threshold, not the strongest. Walls are mirrors: a plane answers from
the foot of the normal alone, whatever the heading, and only inside its visibility half-angle. Concave right
angles answer like planes, convex edges and free ends weakly. Where no direct echo is heard, mirror images of
the sonar are searched: the long ghosts. After Kuc & Siegel 1987, Barshan & Kuc 1990, Leonard &
Durrant-Whyte 1992; ray following with a detection threshold after Wilkes, Dudek et al. 1990.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonar_explore.beam import Beam
from sonar_explore.envs.pings import Ear, fire_all
from sonar_explore.envs.scene import Scene
from sonar_explore.geometry import Array


@dataclass(frozen=True)
class SonarPhysics:
    """What is not geometry: mirrors, noise and faults of a ping."""

    beam: Beam = field(default_factory=Beam)
    """What is heard how widely."""
    roughness: float = 0.0
    """Least diffuse share of any wall's echo, 0 to 1; worlds may have rougher ones."""
    range_max_m: float = 5.0
    """Reported where nothing is heard, [m]."""
    ghost_order: int = 3
    """Most reflections of a ghost, at its mirrors and at its source: 1 turns ghosts off, 3 is two mirrors."""
    bounce_loss: float = 0.8
    """Share of the amplitude left by each bounce off a mirror (0.7 to 0.9)."""
    sigma_m: float = 0.005
    """Standard deviation of the range at no distance, [m]."""
    sigma_per_m: float = 0.004
    """Its growth with range, [m/m]."""
    quantum_m: float = 0.001
    """Ranges are whole multiples of this, [m]."""
    dropout: float = 0.005
    """Probability that an echo goes unheard."""
    temperature_error_k: float = 3.0
    """Standard deviation of the air's temperature from the one assumed: a common scale error, [K]."""

    @cached_property
    def ear(self) -> Ear:
        """Mirrors, what each leaves, the range and the beam, as the kernels take them."""
        return Ear.of(self.ghost_order - 1, self.bounce_loss, self.range_max_m, self.beam)

    @cached_property
    def plain_ear(self) -> tuple[float, ...]:
        """The same without names (as `Scene.plain`)."""
        return tuple(self.ear)


def echoes(scene: Scene, discs: Array, physics: SonarPhysics) -> tuple[Array, NDArray[np.int64]]:
    """First echo of each ping, without noise.

    Args:
        scene: the world, prepared for pings.
        discs: where each ping is fired from and to: x, y [m], heading [rad]; shape (n, 3), world frame.

    Returns:
        Distance from disc to source, shape (n,), [m], `range_max_m` where nothing is heard; and the kind of
        source, shape (n,) (`sonar_explore.envs.pings`: `PLANE` and so on, `GHOST` added once per mirror).
    """
    ranges = np.empty(len(discs))
    kinds = np.empty(len(discs), dtype=np.int64)
    fire_all(discs, *scene.plain, physics.plain_ear, ranges, kinds)
    return ranges, kinds


def measured(ranges: Array, scale: float, physics: SonarPhysics, rng: np.random.Generator) -> Array:
    """Ranges as the electronics report them: scaled, noisy, quantised, now and then unheard; shape (n,), [m]."""
    return measured_by(ranges, scale, physics, rng.standard_normal(len(ranges)), rng.random(len(ranges)))


def measured_by(ranges: Array, scale: float, physics: SonarPhysics, z: Array, chance: Array) -> Array:
    """`measured` with these draws, shape (n,) each: standard normal for the noise, 0 to 1 for what goes unheard."""
    noisy = ranges * scale + (physics.sigma_m + physics.sigma_per_m * ranges) * z
    lost = (chance < physics.dropout) | (ranges >= physics.range_max_m)
    quantised = np.round(noisy / physics.quantum_m) * physics.quantum_m
    return np.where(lost, physics.range_max_m, np.clip(quantised, 0.0, physics.range_max_m))


def measured_once(range_m: float, scale: float, physics: SonarPhysics, rng: np.random.Generator) -> float:
    """`measured` for a single ping: the same draws and the same number, without arrays, [m]."""
    noisy = range_m * scale + (physics.sigma_m + physics.sigma_per_m * range_m) * rng.standard_normal()
    if rng.random() < physics.dropout or range_m >= physics.range_max_m:
        return physics.range_max_m
    return min(max(round(noisy / physics.quantum_m) * physics.quantum_m, 0.0), physics.range_max_m)


def temperature_scale(physics: SonarPhysics, rng: np.random.Generator) -> float:
    """Range scale of an episode: the assumed over the true speed of sound, c = 331.3 sqrt(1 + T/273.15) m/s."""
    assumed_c = 20.0
    true_c = assumed_c + physics.temperature_error_k * rng.standard_normal()
    return math.sqrt((1.0 + assumed_c / 273.15) / (1.0 + true_c / 273.15))
