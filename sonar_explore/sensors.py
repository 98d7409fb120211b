"""Sonars by name: what the simulator makes of one, and what SLAM should know of it.

`nxt` is fitted to recorded scans of a hobby sensor (docs/real_sonar.md says how, and what remains different). The
other two are those of recordings without known walls: their beams are taken for the AmigoBot's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from sonar_explore.beam import Beam
from sonar_explore.envs.acoustics import SonarPhysics
from sonar_explore.errors import unknown_name
from sonar_explore.slam import SlamConfig

SCAN_STEP_RAD = math.radians(4.0)  # section IV: 90 readings a turn


@dataclass(frozen=True)
class Sensor:
    """One kind of sonar."""

    about: str
    sonar: SonarPhysics = field(default_factory=SonarPhysics)
    """As the simulator has it."""
    scan_step_rad: float = SCAN_STEP_RAD
    """Turn between two readings, [rad]."""
    slam: SlamConfig = field(default_factory=SlamConfig.robust)
    """What SLAM takes for granted of it."""


def _nxt() -> Sensor:
    """Numbers from `sonar-explore real-sonar`: plateaus on known walls, and how far features lie off them."""
    s, heard = 24.7, 26.1  # degrees: where the amplitude falls to 1/e, where a plane 1 m away is just heard
    beam = Beam(math.radians(s), math.exp(-((heard / s) ** 2)))
    sonar = SonarPhysics(
        beam=beam,
        roughness=0.2,
        range_max_m=2.55,
        sigma_m=0.005,
        sigma_per_m=0.0,
        quantum_m=0.01,
    )
    robust, angle = SlamConfig.robust(), math.radians(5.0)
    slam = replace(
        robust,
        features=replace(
            robust.features,
            beam=beam,
            width_min_rad=math.radians(20.0),
            beam_check=False,  # real plateaus differ far more in width than the pattern says
            beam_bearing=False,
        ),
        reference=replace(robust.reference, foot_sigma_m=0.03, direction_sigma_rad=angle),
        odometry=replace(robust.odometry, bearing_rad=angle, normal_m=0.03),
        joint=replace(robust.joint, bearing_rad=angle, range_m=0.03),
        smoothing=replace(robust.smoothing, bearing_rad=angle, range_m=0.03),
    )
    return Sensor("Lego NXT on a motor, 40 kHz, 24 degrees by its maker", sonar, math.radians(2.0), slam)


def _far_hearing(about: str, reliable_m: float) -> Sensor:
    """A sensor that hears plateaus farther than the AmigoBot's 2 m, and with no walls known to fit its beam to."""
    robust = SlamConfig.robust()
    features = replace(robust.features, range_max_m=reliable_m, beam_check=False, beam_bearing=False)
    return Sensor(about, slam=replace(robust, features=features))


SENSORS: dict[str, Sensor] = {
    "amigobot": Sensor("SensComp disc, 49.4 kHz: the simulator's own"),
    "nxt": _nxt(),
    "maxbotix": _far_hearing("MaxBotix MB1433, turned by hand", 4.5),
    "pioneer": _far_hearing("SensComp discs of a Pioneer", 4.5),
}


def sensor_name(sonar: SonarPhysics) -> str:
    """The first sensor that sounds like this; `custom` where none does."""
    return next((name for name, sensor in SENSORS.items() if sensor.sonar == sonar), "custom")


def sensor_preset(name: str) -> Sensor:
    """The sensor of this name."""
    if name not in SENSORS:
        raise unknown_name("sensor", name, SENSORS)
    return SENSORS[name]
