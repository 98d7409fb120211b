"""What the sensitivity study sweeps: one option at a time, around its default."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sonar_explore.config import ExplorationConfig
from sonar_explore.studies.jobs import Variant
from sonar_explore.studies.options import option

DEFAULT = Variant("default")


@dataclass(frozen=True)
class Sweep:
    """One option and the values it takes."""

    name: str
    """For people, with its symbol in the paper where it has one."""
    option: str
    unit: str
    values: tuple[Any, ...]
    """In the unit; the default is among them."""
    to_option: Callable[[Any], Any] = lambda value: value
    """From the unit to the option."""

    @property
    def slug(self) -> str:
        """For folders: the last part of the option's name and its parent's."""
        return "-".join(self.option.split(".")[-2:])

    @property
    def default(self) -> Any:
        """The value that is the default, in the unit."""
        now = option(ExplorationConfig(), self.option)
        return next(v for v in self.values if _same(self.to_option(v), now))

    def variant(self, value: Any) -> Variant:
        """The arm of one value; all sweeps share the arm of their defaults."""
        if value == self.default:
            return DEFAULT
        return Variant(f"{self.slug}-{value}", changes=((self.option, self.to_option(value)),))


def _same(first: Any, second: Any) -> bool:
    return bool(first == second) or math.isclose(float(first), float(second), rel_tol=1e-9)


def _cm(value: float) -> float:
    return value / 100.0


def _ratio(percent: float) -> float:
    return 1.0 + percent / 100.0


SWEEPS: tuple[Sweep, ...] = (
    Sweep("d1, to the link's line", "slam.association.line_distance_max_m", "cm", (5, 10, 20, 30, 40), _cm),
    Sweep("d2, to its nearest end", "slam.association.end_gap_max_m", "cm", (25, 50, 80, 120, 160), _cm),
    Sweep(
        "a1, angle to the link", "slam.association.angle_max_rad", "deg", (5, 10, 20, 30, 40), math.radians
    ),
    Sweep(
        "margin of the angle fit",
        "slam.link_graph.angle_margin_rad",
        "deg",
        (0.5, 1, 2, 4, 8),
        math.radians,
    ),
    Sweep(
        "margin of the distance fit", "slam.link_graph.distance_margin_m", "cm", (1.25, 2.5, 5, 10, 20), _cm
    ),
    Sweep("scan step", "simulator.scan_step_rad", "deg", (2, 4, 8), math.radians),
    Sweep("beam that SLAM assumes", "slam.features.beam_rad", "deg", (15, 20, 25, 30, 35), math.radians),
    Sweep("E_d - 1, unequal wheels", "simulator.noise.wheel_ratio", "%", (0, 0.15, 0.3, 0.6, 1.2), _ratio),
    Sweep("E_b - 1, wrong wheel base", "simulator.noise.base_ratio", "%", (0, 0.25, 0.5, 1, 2), _ratio),
    Sweep("spin left and right in turn", "alternate_spin", "", (False, True)),
)


def sweep_variants() -> tuple[Variant, ...]:
    """The default once, then every other value of every sweep."""
    others = [s.variant(v) for s in SWEEPS for v in s.values if v != s.default]
    return (DEFAULT, *others)
