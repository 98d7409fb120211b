"""What the rest of the program sees of SLAM: its configuration, its protocol and what an update says."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from sonar_explore.checks import check_numbers
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import AssociationConfig
from sonar_explore.slam.baselines.particles import ParticleConfig
from sonar_explore.slam.baselines.scan_matching import ScanMatchConfig
from sonar_explore.slam.chains import ChainMap
from sonar_explore.slam.dual import Merge
from sonar_explore.slam.features import Feature, FeatureConfig
from sonar_explore.slam.joint.joint_filter import JointConfig
from sonar_explore.slam.link_graph import LinkGraphConfig, LinkGraphs
from sonar_explore.slam.localization import Correction, LocalizationConfig
from sonar_explore.slam.odometry_filter import FilterConfig
from sonar_explore.slam.probability import ProbabilityConfig
from sonar_explore.slam.reference import ReferenceConfig
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.scored import ScoredAssociation, scored
from sonar_explore.slam.smoothing.loop_closing import LoopConfig
from sonar_explore.slam.smoothing.point_matching import MatchingConfig
from sonar_explore.slam.smoothing.smoothing import SmoothingConfig
from sonar_explore.slam.turn.agreement import AgreementConfig
from sonar_explore.slam.turning import TurningConfig


@dataclass(frozen=True)
class SlamConfig:
    """Every number of section III that is a choice; the defaults are the paper's or READING's.

    `SlamConfig.robust()` is the one to explore with.
    """

    features: FeatureConfig = field(default_factory=FeatureConfig)
    agreement: AgreementConfig = field(default_factory=AgreementConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    link_graph: LinkGraphConfig = field(default_factory=LinkGraphConfig)
    probability: ProbabilityConfig = field(default_factory=ProbabilityConfig)
    localization: LocalizationConfig = field(default_factory=LocalizationConfig)
    turning: TurningConfig = field(default_factory=TurningConfig)
    reference: ReferenceConfig = field(default_factory=ReferenceConfig)
    odometry: FilterConfig = field(default_factory=FilterConfig)
    joint: JointConfig = field(default_factory=JointConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    loops: LoopConfig = field(default_factory=LoopConfig)
    smoothing: SmoothingConfig = field(default_factory=SmoothingConfig)
    particles: ParticleConfig = field(default_factory=ParticleConfig)
    scan_match: ScanMatchConfig = field(default_factory=ScanMatchConfig)

    @classmethod
    def robust(cls) -> SlamConfig:
        """Beyond the paper, each departure a named option (docs/departures.md says what each one brings).

        Walls are told from edges, corners and hidden ends by the beam pattern; corrections refer to a line through
        all links of a chain; the odometry has a say in what is believable and in how far to correct; pose, wheels,
        chains and points are one estimate.
        """
        return cls(
            features=FeatureConfig(beam_check=True, beam_bearing=True, corner_on_wall=True),
            agreement=AgreementConfig(enabled=True),
            association=AssociationConfig(end_gap_max_m=1.2, facing=True),
            localization=LocalizationConfig(min_consensus=2),
            turning=TurningConfig(enabled=True),
            reference=ReferenceConfig(refined=True),
            odometry=FilterConfig(enabled=True),
            joint=JointConfig(enabled=True),
        )

    def __post_init__(self) -> None:
        check_numbers(self, "slam")
        if self.features.range_min_m >= self.features.range_max_m:
            raise SonarExploreError("slam.features.range_min_m must be less than range_max_m")


@dataclass(frozen=True, eq=False)
class ScanEntry:
    """One scan so far, at the pose now believed."""

    pose: Pose
    """`pose_robot_in_map` when the scan began."""
    scan: Scan
    features: tuple[Feature, ...]


@dataclass(frozen=True, eq=False)
class ScanUpdate:
    """What one scan did to the belief."""

    index: int
    """Of the scan, from 0."""
    predicted_pose: Pose
    """`pose_robot_in_map` before the correction."""
    pose: Pose
    """After it."""
    features: tuple[Feature, ...]
    link_graphs: LinkGraphs
    """The initial graph, the fits and the winner (figures 6 to 9)."""
    residuals: Residuals
    """Of every edge of the initial graph, before the correction."""
    shapes: ProbabilityConfig
    """Of the curves that its associations are scored by."""
    correction: Correction
    new_chains: tuple[int, ...]
    """Ids of the chains that this scan rooted."""
    merges: tuple[Merge, ...]
    dangling: tuple[int, ...]
    """Ids of the chains that dangle after this scan."""

    @cached_property
    def associations(self) -> tuple[ScoredAssociation, ...]:
        """Every edge of the initial link graph, scored when somebody looks."""
        return scored(self.link_graphs, self.residuals, self.shapes)


class Slam(Protocol):
    """Measurements in, belief out."""

    @property
    def pose(self) -> Pose:
        """`pose_robot_in_map`; the heading runs on through full turns."""
        ...

    @property
    def chains(self) -> ChainMap:
        """All feature chains."""
        ...

    @property
    def scans(self) -> tuple[ScanEntry, ...]:
        """Every scan so far, in order."""
        ...

    def predict(self, pose_robot_in_odometry: Pose) -> Pose:
        """Carry the belief along with the odometry since the last call."""
        ...

    def predict_along(self, odometry: Array) -> Array:
        """`predict` at each of these readings: x y [m] heading [rad], shape (n, 3) both."""
        ...

    @property
    def belief(self) -> Array | None:
        """What `odometry_filter.carried` goes on from; None where the belief is carried in another way."""
        ...

    def place(self, pose_robot_in_map: Pose) -> None:
        """Say from outside where the robot stands when the next scan begins."""
        ...

    def update(self, scan: Scan) -> ScanUpdate:
        """Take one scan: extract, associate, correct, grow the chains."""
        ...
