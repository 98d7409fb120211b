"""Everything that can be chosen about an exploration, in one frozen tree with defaults that run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.simulator import SimulatorConfig
from sonar_explore.mapping.occupancy import MappingConfig
from sonar_explore.planning.candidates import CandidateConfig
from sonar_explore.planning.driving import DrivingConfig
from sonar_explore.planning.paths import PlanningConfig
from sonar_explore.slam import SlamConfig


@dataclass(frozen=True)
class ExplorationConfig:
    """The robot's world on one side, its mind on the other; written into every record."""

    simulator: SimulatorConfig = field(default_factory=SimulatorConfig)
    slam: SlamConfig = field(default_factory=SlamConfig.robust)
    mapping: MappingConfig = field(default_factory=MappingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    candidates: CandidateConfig = field(default_factory=CandidateConfig)
    driving: DrivingConfig = field(default_factory=DrivingConfig)
    alternate_spin: bool = True
    """Scans turn left and right in turn: always the same way, a wrong wheel base adds up scan by scan."""
    max_scans: int = 400
    """An episode that has not ended by itself ends here."""

    def with_noise(self, preset: str) -> ExplorationConfig:
        """The same with the odometry errors of a preset."""
        return replace(self, simulator=replace(self.simulator, noise=noise_preset(preset)))
