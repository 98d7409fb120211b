"""How odometry drifts: two systematic errors and a random walk (READING section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonar_explore.errors import unknown_name
from sonar_explore.geometry import Array


@dataclass(frozen=True)
class OdometryNoise:
    """Size of the errors; each episode draws its own sign and magnitude of the systematic ones."""

    wheel_ratio: float = 1.003
    """E_d: diameter of one wheel over the other's. Straight drives bend: 0.75 degrees per metre at the default."""
    base_ratio: float = 1.005
    """E_b: true over assumed turning. A full turn is wrong by 360 (E_b - 1) degrees: 1.8 at the default."""
    turn_sigma_rad: float = math.radians(1.0)
    """Standard deviation of the heading after a full turn on the spot, [rad]; variance grows with the turn."""
    drift_sigma_rad: float = math.radians(0.5)
    """Standard deviation of the heading after a metre, [rad]; variance grows with the distance."""
    distance_sigma_m: float = 0.02
    """Standard deviation of the distance after a metre, [m]; variance grows with the distance."""


NOISE_PRESETS: dict[str, OdometryNoise] = {
    "ideal": OdometryNoise(1.0, 1.0, 0.0, 0.0, 0.0),
    "paper": OdometryNoise(),
    "worn": OdometryNoise(1.01, 1.01, math.radians(2.0), math.radians(1.0), 0.04),
}


def noise_preset(name: str) -> OdometryNoise:
    """The preset of this name: `ideal`, `paper` or `worn`."""
    if name not in NOISE_PRESETS:
        raise unknown_name("noise", name, NOISE_PRESETS)
    return NOISE_PRESETS[name]


def noise_name(noise: OdometryNoise) -> str:
    """The name of these errors; `custom` where no preset has them."""
    return next((name for name, preset in NOISE_PRESETS.items() if preset == noise), "custom")


class OdometryError:
    """The error of one robot on one day: its systematic part stays the same all episode."""

    def __init__(self, noise: OdometryNoise, wheel_base_m: float, rng: np.random.Generator) -> None:
        draw = rng.choice((-1.0, 1.0), size=2) * rng.uniform(0.5, 1.5, size=2)
        e_d = 1.0 + draw[0] * (noise.wheel_ratio - 1.0)
        self._noise = noise
        self._rng = rng
        self.curvature_rad_m = 2.0 * (e_d - 1.0) / ((e_d + 1.0) * wheel_base_m)
        """Bend of a straight drive, [rad/m]."""
        self.turn_scale = 1.0 + draw[1] * (noise.base_ratio - 1.0)
        """E_b of this episode: true over measured turning."""

    def true_motion(self, forward_m: float, turn_rad: float) -> tuple[float, float]:
        """What the robot does when its odometry says (forward, turn): (forward, turn), [m, rad]."""
        n = self._noise
        z_forward, z_turn = self._rng.standard_normal(), self._rng.standard_normal()
        distance = abs(forward_m)
        full_turns = abs(turn_rad) / (2.0 * math.pi)
        heading_sigma = math.sqrt(n.turn_sigma_rad**2 * full_turns + n.drift_sigma_rad**2 * distance)
        return (
            forward_m + n.distance_sigma_m * math.sqrt(distance) * z_forward,
            turn_rad * self.turn_scale + self.curvature_rad_m * forward_m + heading_sigma * z_turn,
        )

    @property
    def as_kernels_take_it(self) -> tuple[float, ...]:
        """Bend, scale of turns, and the noise: of a metre's length, variances of a full turn and of a metre's drift."""
        n = self._noise
        return (
            *(self.curvature_rad_m, self.turn_scale, n.distance_sigma_m),
            *(n.turn_sigma_rad**2, n.drift_sigma_rad**2),
        )

    def true_turns(self, turn_rad: float, count: int) -> Array:
        """The same for `count` turns on the spot in a row, shape (count,), [rad]; they shift nothing."""
        z = self._rng.standard_normal((count, 2))  # as many and in the order that single motions would draw
        return self.true_turns_by(np.full(count, turn_rad), z[:, 1])

    def true_turns_by(self, turns_rad: Array, z: Array) -> Array:
        """The same for several turns with these draws for the headings, shape (n,) all."""
        heading_sigma = np.sqrt(self._noise.turn_sigma_rad**2 * (np.abs(turns_rad) / (2.0 * math.pi)))
        return turns_rad * self.turn_scale + heading_sigma * z


def running_sum(start: float, steps: Array) -> Array:
    """start, start + steps[0], ... added one by one, shape (n + 1,)."""
    return np.cumsum(np.concatenate([[start], steps]))
