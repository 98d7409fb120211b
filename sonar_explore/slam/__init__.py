"""SLAM by feature chains and link graphs: section III of the paper, one file for each of its parts.

What goes beyond it stands in folders: `turn/`, what the eight discs agree on; `joint/` and `smoothing/`, the
estimates behind `chain` and `smoothed`; `baselines/`, what others would pick.
"""

from __future__ import annotations

from sonar_explore.errors import unknown_name
from sonar_explore.geometry import Pose
from sonar_explore.slam.base import ScanEntry, ScanUpdate, ScoredAssociation, Slam, SlamConfig
from sonar_explore.slam.baselines.grid_pf import GridParticleSlam
from sonar_explore.slam.baselines.scan_match import ScanMatchSlam
from sonar_explore.slam.chains import Chain, ChainMap, Link
from sonar_explore.slam.features import Feature, FeatureKind
from sonar_explore.slam.joint.joint import JointSlam
from sonar_explore.slam.slam import ChainSlam, DeadReckoning, KnownPose
from sonar_explore.slam.smoothing.smoothed import SmoothedSlam

__all__ = [
    "SLAMS",
    "Chain",
    "ChainMap",
    "ChainSlam",
    "Feature",
    "FeatureKind",
    "Link",
    "ScanEntry",
    "ScanUpdate",
    "ScoredAssociation",
    "Slam",
    "SlamConfig",
    "make_slam",
]

SLAMS: dict[str, type[ChainSlam]] = {
    "chain": ChainSlam,
    "grid-pf": GridParticleSlam,
    "literal": ChainSlam,
    "off": DeadReckoning,
    "scan-match": ScanMatchSlam,
    "smoothed": SmoothedSlam,
    "truth": KnownPose,
}


def make_slam(name: str, start: Pose, config: SlamConfig | None = None) -> Slam:
    """Make the SLAM of this name.

    `chain` corrects the pose, `smoothed` all poses and chains, `off` trusts the odometry, `truth` is told every pose.
    `grid-pf` and `scan-match` are the methods of others, to compare with.
    `literal` is `chain` to the paper's letter: it takes no configuration.
    """
    if name not in SLAMS:
        raise unknown_name("slam", name, SLAMS)
    if name == "literal":
        config = SlamConfig()
    config = config or SlamConfig.robust()
    if name == "chain" and config.joint.enabled and config.odometry.enabled and config.reference.refined:
        return JointSlam(start, config)
    return SLAMS[name](start, config)
