"""Everything that can be chosen about an exploration, in one frozen tree with defaults that run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from sonar_explore.checks import check_numbers
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import SimulatorConfig
from sonar_explore.errors import SonarExploreError, unknown_name
from sonar_explore.mapping.looks import MappingConfig
from sonar_explore.planning.candidates import CandidateConfig
from sonar_explore.planning.driving import DrivingConfig
from sonar_explore.planning.paths import PlanningConfig
from sonar_explore.sensors import sensor_preset
from sonar_explore.slam import SlamConfig

SCANS = ("turn", "ring")
MAY_BE_ZERO = (
    *(
        "wall_margin_m",
        "continuation_rad",
        "pivot_m",
        "pivot_turn_rad",
        "trim_m",
        "sure_m",
        "still_m",
        "far_still_m",
    ),
    *("goes_on_m", "far_wall_m", "on_line_m"),
    *("point_weight", "core_weight", "fresh_scans", "fresh_weight", "body_weight"),
    *("margin_m", "comfort_weight", "blind_weight", "speck_m2", "unknown_credit_m", "escape_m"),
    *("least_room_m", "chain_grows_m", "least_area_m2", "area_per_m", "enough_m2", "apart_m"),
    *("brake_m", "side_m", "glance_rad"),
)
MAY_BE_NEGATIVE = ("daring_margin_m",)


@dataclass(frozen=True)
class ExplorationConfig:
    """The robot's world on one side, its mind on the other; written into every record."""

    simulator: SimulatorConfig = field(default_factory=SimulatorConfig)
    slam: SlamConfig = field(default_factory=SlamConfig.robust)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    driving: DrivingConfig = field(default_factory=DrivingConfig)
    scan: str = "turn"
    """`turn`, the paper's: a full turn with one sonar kept; or `ring`: a short turn with all of them."""
    alternate_spin: bool = True
    """Scans turn left and right in turn: always the same way, a wrong wheel base adds up scan by scan."""
    ring_in_the_open: bool = True
    """Where the last scan heard nothing and no wall is known to be near, the next one is a ring scan: a full turn loses
    five times as much of the heading there, and nothing is heard to find it again."""
    max_scans: int = 400
    """An episode that has not ended by itself ends here."""

    def __post_init__(self) -> None:
        if self.scan not in SCANS:
            raise unknown_name("scan", self.scan, SCANS)
        if not self.max_scans >= 1:
            raise SonarExploreError(f"max_scans is {self.max_scans}; at least 1 is possible")
        for part in ("mapping", "planning", "candidates", "driving"):
            check_numbers(getattr(self, part), part, or_zero=MAY_BE_ZERO, or_negative=MAY_BE_NEGATIVE)

    def with_sensor(self, name: str) -> ExplorationConfig:
        """The same robot with another sonar (`sonar_explore.sensors`), and SLAM told of it."""
        sensor = sensor_preset(name)
        simulator = replace(
            self.simulator,
            robot=replace(self.simulator.robot, range_max_m=sensor.sonar.range_max_m),
            sonar=sensor.sonar,
            scan_step_rad=sensor.scan_step_rad,
        )
        return replace(self, simulator=simulator, slam=sensor.slam)

    def with_noise(self, preset: str) -> ExplorationConfig:
        """The same with the odometry errors of a preset."""
        return replace(self, simulator=replace(self.simulator, noise=noise_preset(preset)))
