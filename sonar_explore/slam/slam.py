"""The paper's SLAM: feature chains and link graphs, scan by scan (section III)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import Association, associate
from sonar_explore.slam.base import ScanEntry, ScanUpdate, SlamConfig
from sonar_explore.slam.chains import ChainMap, Link
from sonar_explore.slam.dual import Merge, merge_dual_associations, surviving
from sonar_explore.slam.features import Feature, FeatureKind
from sonar_explore.slam.link_graph import LinkGraphs, fit_link_graphs
from sonar_explore.slam.localization import Correction, localize
from sonar_explore.slam.odometry_filter import OdometryFilter
from sonar_explore.slam.probability import RootCertainty
from sonar_explore.slam.reference import reference_line
from sonar_explore.slam.residuals import Residuals, residuals_to_lines
from sonar_explore.slam.scored import weighed
from sonar_explore.slam.turn.agreement import Extraction, extract
from sonar_explore.slam.turn.discs import TurnError
from sonar_explore.slam.turn.heard import full_turn
from sonar_explore.slam.turn.points import Point
from sonar_explore.slam.turning import follows_the_wall


class ChainSlam:
    """Corrects the pose at every scan against the roots of the chains that the scan meets again."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        self.config = config
        self.robot = robot or AmigoBot()
        self.pose = start
        self.chains = ChainMap()
        self._entries: list[ScanEntry] = []
        self._scans: tuple[ScanEntry, ...] | None = None
        """The same as somebody saw them last, while they are as they were."""
        self._certainty: RootCertainty | None = None
        self._odometry: Pose | None = None
        self._filter = OdometryFilter(config.odometry)
        self._placed: Pose | None = None
        self._smear = 0.0
        """The error of the turn of the last scan that its features are already free of."""
        self._turn_rad = 0.0
        """The full turn of the last scan, signed, by its odometry."""
        self._turn_heard: TurnError | None = None
        self._points: tuple[Point, ...] = ()
        """Of the last scan, as far as the error of its turn was known before it."""

    @property
    def scans(self) -> tuple[ScanEntry, ...]:
        """Every scan so far, in order, at the poses now believed."""
        if self._scans is None:
            self._scans = tuple(self._entries)
        return self._scans

    def predict(self, pose_robot_in_odometry: Pose) -> Pose:
        """Carry the belief along with the odometry since the last call; the first call sets the reference.

        A scan ends a full turn from where it began. Whether the next odometry counts that turn or not,
        only the heading's count of turns differs.
        """
        if self._odometry is not None:
            self.pose = self._filter.moved(self.pose, self._odometry, pose_robot_in_odometry)
        self._odometry = pose_robot_in_odometry
        return self.pose

    def predict_along(self, odometry: Array) -> Array:
        """`predict` at each of these readings, the pose after each: x y [m] heading [rad], shape (n, 3) both, n > 0."""
        if self._odometry is None:
            return np.array([self.predict(Pose(*row)).as_row() for row in odometry.tolist()])
        poses = self._filter.moved_along(self.pose, self._odometry, odometry)
        self.pose, self._odometry = Pose(*poses[-1].tolist()), Pose(*odometry[-1].tolist())
        return poses

    @property
    def belief(self) -> Array | None:
        """What `odometry_filter.carried` goes on from, for who steers by it; None where no filter carries the pose."""
        if self._odometry is None or not self.config.odometry.enabled:
            return None
        return self._filter.belief(self.pose)

    def place(self, pose_robot_in_map: Pose) -> None:
        """Say from outside where the robot stands when the next scan begins: that scan is mapped there."""
        if not all(map(math.isfinite, (pose_robot_in_map.x, pose_robot_in_map.y, pose_robot_in_map.heading))):
            raise SonarExploreError("a placed pose must be finite")
        turns = math.tau * round((self.pose.heading - pose_robot_in_map.heading) / math.tau)
        self.pose = replace(pose_robot_in_map, heading=pose_robot_in_map.heading + turns)
        self._placed = self.pose

    def update(self, scan: Scan) -> ScanUpdate:
        """One scan, through section III in its order."""
        config, index = self.config, len(self._entries)
        self._smear = self._filter.turn_error
        extraction = extract(scan, config.features, config.agreement, self._smear)
        self._points = extraction.points
        predicted, features = self._turned(self._predicted_at(scan), scan, extraction)
        associations = associate(predicted, features, self.chains, config.association)
        reference = self._reference(predicted, features, associations)
        residuals = residuals_to_lines(predicted, features, associations, self.chains, reference)
        believable = self._believable(associations, residuals) & follows_the_wall(
            predicted, features, associations, self.chains, self._poses_of, config.turning
        )
        associations = tuple(compress(associations, believable.tolist()))
        residuals = residuals.only(believable)
        graphs = fit_link_graphs(associations, residuals, config.link_graph)
        correction = self._correct(predicted, features, graphs, residuals)
        self.pose = correction.applied_to(predicted)
        merges = merge_dual_associations(self.chains, graphs.kept)
        links = self._links(index, features)
        self._grow_chains(links, graphs.kept, merges)
        new_chains = self._root_new_chains(links, graphs.kept, residuals.root_probability[graphs.final])
        self._entries.append(ScanEntry(self.pose, scan, features))
        self._scans = None
        return ScanUpdate(
            index=index,
            predicted_pose=predicted,
            pose=self.pose,
            features=features,
            link_graphs=graphs,
            residuals=residuals,
            shapes=config.probability,
            correction=correction,
            new_chains=new_chains,
            merges=merges,
            dangling=self.chains.dangling,
        )

    def _turned(
        self, predicted: Pose, scan: Scan, extraction: Extraction
    ) -> tuple[Pose, tuple[Feature, ...]]:
        """Where the scan began, and its features, in the light of what they say of the turn itself."""
        self._turn_heard, self._turn_rad = extraction.turn, turn_of(scan)
        self._filter.begin_scan(self._turn_rad)
        if extraction.turn is None or not self.config.odometry.enabled:
            return predicted, extraction.features()
        predicted, error = self._learn_turn(predicted, extraction.turn)
        self._smear += error
        return predicted, extraction.features(error)

    def _learn_turn(self, predicted: Pose, turn: TurnError) -> tuple[Pose, float]:
        """The pose, and the error of this turn beyond what is known already."""
        return self._filter.heard_turn(predicted, turn)

    def _reference(
        self, predicted: Pose, features: Sequence[Feature], associations: Sequence[Association]
    ) -> Array:
        """The line of each association's chain that corrections refer to, shape (n, 4), [m], map frame."""
        lines = [reference_line(self.chains[a.chain], self.config.reference) for a in associations]
        return np.array([line.as_row() for line in lines]).reshape(-1, 4)

    def _believable(self, associations: Sequence[Association], residuals: Residuals) -> NDArray[np.bool_]:
        """Which associations the odometry allows, shape (n,)."""
        return self._filter.believable(residuals)

    def _poses_of(self, scans: NDArray[np.intp]) -> Array:
        """Where these scans are believed to have begun, x, y [m], heading [rad], as rows."""
        return np.array([self._entries[k].pose.as_row() for k in scans.tolist()])

    def _predicted_at(self, scan: Scan) -> Pose:
        """Where the scan began: by odometry, or as placed."""
        self.predict(scan.pose_robot_in_odometry)
        if self._placed is not None:
            self.pose, self._placed = self._placed, None
        return self.pose

    def _correct(
        self, predicted: Pose, features: Sequence[Feature], graphs: LinkGraphs, residuals: Residuals
    ) -> Correction:
        """III.F: nothing to correct by, or no consensus: no correction."""
        several, survivors = len(graphs.associations) > 1, len(graphs.kept)
        if several and survivors < self.config.localization.min_consensus:
            return Correction()
        kept = residuals.only(graphs.final)
        if self.config.odometry.enabled:
            sweeps = np.array([features[a.feature].sweep_rad for a in graphs.kept])
            corrected = self._filter.corrected(predicted, kept, sweeps)
            return Correction(
                corrected.x - predicted.x, corrected.y - predicted.y, corrected.heading - predicted.heading
            )
        _, weights = weighed(graphs, residuals, self.config.probability)
        return localize(kept, weights.only(graphs.final), self.config.localization)

    def _links(self, index: int, features: Sequence[Feature]) -> dict[int, Link]:
        """The walls of this scan by feature index, placed by the corrected pose."""
        return {
            i: Link(feature.segment.transformed(self.pose), index, i, feature)
            for i, feature in enumerate(features)
            if feature.kind is FeatureKind.WALL
        }

    def _grow_chains(
        self, links: dict[int, Link], kept: Sequence[Association], merges: Sequence[Merge]
    ) -> None:
        """III.C: features of the final link graph become links, once in each chain."""
        for feature, chain in sorted({(a.feature, surviving(a.chain, merges)) for a in kept}):
            self.chains.add_link(chain, links[feature])

    def _root_new_chains(
        self, links: dict[int, Link], kept: Sequence[Association], kept_root_probability: Array
    ) -> tuple[int, ...]:
        """III.A, III.E: every other wall becomes a root.

        The first scan that hears a wall at all is the first scan: before it there is nothing to be unsure of.
        """
        if not links:
            return ()
        self._certainty = (
            self._certainty.after(kept_root_probability) if self._certainty else RootCertainty.of_first_scan()
        )
        associated = {a.feature for a in kept}
        return tuple(
            self.chains.add_root(link, self._certainty.probability, dangling=self._certainty.dangling)
            for feature, link in links.items()
            if feature not in associated
        )


class DeadReckoning(ChainSlam):
    """`off`: the same chains on the same associations, and no correction."""

    def _learn_turn(self, predicted: Pose, turn: TurnError) -> tuple[Pose, float]:
        return predicted, 0.0

    def _correct(
        self, predicted: Pose, features: Sequence[Feature], graphs: LinkGraphs, residuals: Residuals
    ) -> Correction:
        return Correction()


class KnownPose(DeadReckoning):
    """`truth`: somebody outside says before every scan where the robot stands."""

    def _predicted_at(self, scan: Scan) -> Pose:
        if self._placed is None:
            raise SonarExploreError("slam 'truth' is told every pose: call place() before each update()")
        return super()._predicted_at(scan)


def turn_of(scan: Scan) -> float:
    """The full turn of a scan, signed, [rad]: one step more than from its first reading to its last."""
    return float(full_turn(np.asarray(scan.headings_rad, dtype=float), scan.bearings_rad))
