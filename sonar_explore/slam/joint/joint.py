"""`chain`: the paper's chains and link graph in front, one estimate of pose and chains behind (beyond the paper)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonar_explore.amigobot import AmigoBot
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.slam.association import Association
from sonar_explore.slam.base import ScanUpdate, SlamConfig
from sonar_explore.slam.features import Feature
from sonar_explore.slam.joint.joint_filter import JointFilter
from sonar_explore.slam.link_graph import LinkGraphs
from sonar_explore.slam.localization import Correction
from sonar_explore.slam.reference import reference_line
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.slam import ChainSlam


class JointSlam(ChainSlam):
    """Corrects the pose by chains whose lines are estimated together with it, and by points."""

    def __init__(self, start: Pose, config: SlamConfig, robot: AmigoBot | None = None) -> None:
        super().__init__(start, config, robot)
        self._filter: JointFilter = JointFilter(config.odometry, config.joint)
        self._known = 0.0
        """The error of the turns that the points of the last scan are free of."""

    def update(self, scan: Scan) -> ScanUpdate:
        """Section III, and what became of the chains for the filter."""
        self._known = self._filter.turn_error
        update = super().update(scan)
        for merge in update.merges:
            self._filter.drop_wall(merge.absorbed)
        for chain in update.new_chains:
            self._filter.add_wall(chain, self.pose, self.chains[chain].root.feature, update.index)
        self._filter.forget(update.index)
        return update

    def _reference(
        self, predicted: Pose, features: Sequence[Feature], associations: Sequence[Association]
    ) -> Array:
        """The lines of the chains as the filter has them, beside the links, shape (n, 4)."""
        self._predicted, self._features = predicted, features
        rows = np.empty((len(associations), 4))
        for i, a in enumerate(associations):
            x1, y1, x2, y2 = self.chains.segments[self.chains.row(a.chain, a.link)].tolist()
            line = self._filter.line(a.chain, (0.5 * (x1 + x2), 0.5 * (y1 + y2)))
            if line is None:
                line = reference_line(self.chains[a.chain], self.config.reference)
                self._filter.adopt(a.chain, line, len(self._entries))
            rows[i] = line.as_row()
        return rows

    def _believable(self, associations: Sequence[Association], residuals: Residuals) -> NDArray[np.bool_]:
        walls = [self._features[a.feature] for a in associations]
        return self._filter.walls_believable(self._predicted, walls, [a.chain for a in associations])

    def _correct(
        self, predicted: Pose, features: Sequence[Feature], graphs: LinkGraphs, residuals: Residuals
    ) -> Correction:
        """By the walls of the final graph, each to one chain, and by the points.

        A wall that two chains hold is measured once: that the two are one line is a measurement of its own.
        """
        pose, index = predicted, len(self._entries)
        if len(graphs.associations) <= 1 or len(graphs.kept) >= self.config.localization.min_consensus:
            chains: dict[int, list[int]] = {}
            for a in graphs.kept:
                chains.setdefault(a.feature, []).append(a.chain)
            surest = {f: sorted(c, key=self._by_certainty) for f, c in chains.items()}
            same = sorted({(c[0], other) for c in surest.values() for other in c[1:]})
            walls = [self._features[f] for f in surest]
            pose = self._filter.by_walls(pose, walls, [c[0] for c in surest.values()], same, index)
        pose = self._filter.by_points(pose, self._points, index, self._smear - self._known)
        return Correction(pose.x - predicted.x, pose.y - predicted.y, pose.heading - predicted.heading)

    def _by_certainty(self, chain: int) -> tuple[float, int]:
        """The order in which a merge keeps them."""
        return -self.chains.root_probability(chain), chain
