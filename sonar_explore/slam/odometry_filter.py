"""How far the odometry can be trusted (beyond the paper): an extended Kalman filter beside the link graph.

The paper corrects by what the associations say and asks the odometry nothing. Here the odometry has a say: it bounds
which associations are believable at all, and shares the correction with the associations that the link graph
kept, each by its variance. The state is the error of the pose, of two constants of the wheels (a wrong wheel base
scales every turn, unequal wheels bend every drive) and of the turn of the scan at hand. A robot is wrong in its own
way, the same way all day (READING section 3), so the constants are learned on the way, and the smear of the scan
with them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.geometry import Array, Pose
from sonar_explore.slam.kalman import OWN, SIZE, believed, learned_of_turn, learned_of_walls, spread
from sonar_explore.slam.motion import own_part
from sonar_explore.slam.residuals import Residuals
from sonar_explore.slam.turn.discs import TurnError

SUMS = 6  # where they begin in a belief
SPREAD_EVERY_M = 0.05  # the covariance is carried along in bits of this length


@dataclass(frozen=True)
class FilterConfig:
    """Standard deviations, of the size of the `paper` preset and of what features were measured to have."""

    enabled: bool = False
    """The paper asks the odometry nothing."""
    turn_error: float = 0.007
    """Relative error of turns before anything is learned."""
    bend_rad_m: float = math.radians(1.0)
    """Bend of a straight drive before anything is learned, [rad/m]."""
    turn_rad: float = math.radians(1.5)
    """Random heading error of a full turn, [rad]."""
    drift_rad: float = math.radians(0.7)
    """Random heading error of a metre, [rad]."""
    distance_m: float = 0.03
    """Random distance error of a metre, [m]."""
    bearing_rad: float = math.radians(2.0)
    """Angle between a feature that one disc heard and the line it belongs to, [rad]."""
    bearing_least_rad: float = math.radians(0.4)
    """The same, however many discs heard it, [rad]."""
    normal_m: float = 0.02
    """Distance between a feature and the line it belongs to, [m]."""
    gate_share: float = 0.997
    """Of true associations are believable: angle and distance together are no farther off than expected."""
    rival: float = 4.0
    """Where a wall may be of several lines, those that fit it worse than the best by more, in squared standard
    deviations, are not its: the sides of a bay are metres long, and a few degrees of heading tell them apart."""
    huber_sigmas: float = 1.0
    """Associations farther off than this count less the farther they are."""
    least_heading_rad: float = math.radians(0.5)
    """The map is never surer than this, [rad]."""
    least_position_m: float = 0.01
    """Nor than this, [m]."""


def squared_gate(share: float) -> float:
    """How far off two numbers together may be for so many of the true ones to pass, in squared standard deviations:
    chi-squared, two degrees."""
    return -2.0 * math.log(1.0 - share)


class OdometryFilter:
    """Covariance of the pose, and the two constants of the wheels."""

    def __init__(self, config: FilterConfig) -> None:
        self.config = config
        least = config.least_position_m, config.least_position_m, config.least_heading_rad
        self._floor, self._huber = np.array(least) ** 2, config.huber_sigmas**2
        self._sigmas = config.bearing_rad**2, config.bearing_least_rad**2, config.normal_m**2
        self.turn_error = 0.0
        """True over measured turn, less one."""
        self.bend_rad_m = 0.0
        """Bend of a straight drive, [rad/m]."""
        self.own_error = 0.0
        """Of the turn of the last scan: what it has beyond `turn_error`."""
        self._forward_m = self._turn_rad = self._turned_rad = self._heading_rad = 0.0
        self._own_rad = self._own_left_rad = 0.0
        self._walk = np.array([config.distance_m, config.turn_rad, config.drift_rad]) ** 2
        self._transition = np.eye(SIZE)
        """What motions made of an error of the state, for who keeps what correlates with it."""
        self.covariance: Array = np.diag([0.0, 0.0, 0.0, config.turn_error**2, config.bend_rad_m**2, 0.0])
        """Of x, y [m], heading [rad], turn error, bend [rad/m] and own turn error, shape (6, 6)."""

    def moved(self, pose: Pose, before: Pose, after: Pose) -> Pose:
        """Carry a pose along with a short bit of odometry, and the uncertainty with it."""
        turn = after.heading - before.heading
        if not self.config.enabled:
            return pose @ (before.inverse() @ after)
        # the same sums as before.inverse() @ after, without the objects: this runs 25 times a simulated second
        c, s = math.cos(before.heading), math.sin(before.heading)
        x = -c * before.x - s * before.y + c * after.x + s * after.y
        y = s * before.x - c * before.y - s * after.x + c * after.y
        own = own_part(turn, self._own_left_rad)
        self._own_left_rad -= own
        self._own_rad += own
        self._forward_m += x
        self._turn_rad += turn
        self._turned_rad += abs(turn - own)
        self._heading_rad = pose.heading
        if abs(self._forward_m) > SPREAD_EVERY_M:
            self._spread()
        c, s = math.cos(pose.heading), math.sin(pose.heading)
        heading = turn * (1.0 + self.turn_error) + own * self.own_error + x * self.bend_rad_m
        return Pose(pose.x + c * x - s * y, pose.y + s * x + c * y, pose.heading + heading)

    def moved_along(self, pose: Pose, before: Pose, after: Array) -> Array:
        """`moved` from each reading of the odometry to the next, in one call; the pose after each: x y [m] heading
        [rad], shape (n, 3) both."""
        if not self.config.enabled:
            found = []
            for here in (Pose(*row) for row in after.tolist()):
                pose = self.moved(pose, before, here)
                found.append(pose.as_row())
                before = here
            return np.array(found)
        odometry = np.concatenate([[before.as_row()], after])
        belief = self.belief(pose)
        poses, spreads = np.empty((len(after), 3)), np.empty((len(after), 5))
        bits = spreads[: _carried_along(odometry, belief, poses, spreads)]
        self._spread_by(bits)
        self._forward_m, self._turn_rad, self._turned_rad, self._own_rad, self._own_left_rad = belief[
            SUMS:
        ].tolist()
        self._heading_rad = float(poses[-2, 2]) if len(poses) > 1 else pose.heading
        return poses

    def belief(self, pose: Pose) -> Array:
        """All that `carried` needs to go on from here."""
        return np.array(
            [
                *(pose.x, pose.y, pose.heading, self.turn_error, self.own_error, self.bend_rad_m),
                *(self._forward_m, self._turn_rad, self._turned_rad, self._own_rad, self._own_left_rad),
            ]
        )

    def begin_scan(self, turn_rad: float) -> None:
        """The robot turned by so much, by its odometry, while it took the scan at hand: signed, [rad]."""
        self._spread()
        self._own_left_rad, self.own_error = turn_rad, 0.0
        self.covariance[OWN, :] = self.covariance[:, OWN] = 0.0
        self.covariance[OWN, OWN] = self.config.turn_rad**2 * abs(turn_rad) / math.tau / turn_rad**2

    def heard_turn(self, pose: Pose, turn: TurnError) -> tuple[Pose, float]:
        """Learn from what the discs say of the turn.

        Returns:
            The pose, and the relative error of this turn beyond what the headings of the scan had of it.
        """
        before = self.turn_error
        pose = self._changed(
            pose, learned_of_turn(self.covariance, turn.relative, turn.sigma**2, self._huber, self._floor)
        )
        return pose, self.turn_error - before + self.own_error

    def restart(self, turn_error: float, bend_rad_m: float, own_error: float) -> None:
        """Take the pose for sure and the wheels as given: somebody else keeps their uncertainty."""
        self._spread()
        self.turn_error, self.bend_rad_m, self.own_error = turn_error, bend_rad_m, own_error
        own = self.covariance[OWN, OWN]
        self.covariance = np.zeros((SIZE, SIZE))
        self.covariance[OWN, OWN] = own

    def believable(
        self,
        residuals: Residuals,
        relative: Array | None = None,
        features: NDArray[np.intp] | None = None,
        sure_m: float = math.inf,
    ) -> NDArray[np.bool_]:
        """Which associations the odometry allows, shape (n,).

        Args:
            relative: what the filter does not know of: covariance of the heading, and of the place along the normal,
                relative to each line when the filter was restarted, shape (n, 2, 2), [rad] and [m].
            features: which wall of the scan each is of, shape (n,): a wall that meets one line much better than
                another is not of both, even where alone it might be of the other. None where that is not asked.
            sure_m: where `relative` is less sure of the place than this, nothing is believable, [m].
        """
        n = len(residuals.adr_rad)
        if not self.config.enabled or not n:
            return np.ones(n, dtype=bool)
        self._spread()
        if relative is None:
            relative = np.zeros((n, 2, 2))
        if features is None:
            features = np.arange(n)
        limit = squared_gate(self.config.gate_share)
        off = residuals.adr_rad, residuals.ndr_m, residuals.normals, residuals.discs, features
        found: NDArray[np.bool_] = believed(
            self.covariance, relative, *off, self._sigmas, limit, self.config.rival, sure_m**2
        )
        return found

    def corrected(self, pose: Pose, residuals: Residuals, sweeps_rad: Array) -> Pose:
        """The pose after the kept associations: heading by ADR, position by NDR.

        Args:
            sweeps_rad: how far the robot had turned in its scan when each feature was heard, signed, shape (n,),
                [rad]: an error of the turns shows in ADR the more, the later.
        """
        if not len(residuals.adr_rad):
            return pose
        self._spread()
        heard = residuals.adr_rad, residuals.ndr_m, residuals.normals, residuals.discs, sweeps_rad
        change = learned_of_walls(self.covariance, *heard, self._sigmas, self._huber, self._floor)
        return self._changed(pose, change)

    def _changed(self, pose: Pose, change: Array) -> Pose:
        """After an update that says by how much the state is to change."""
        x, y, heading, turn_error, bend_rad_m, own_error = change.tolist()
        self.turn_error += turn_error
        self.bend_rad_m += bend_rad_m
        self.own_error += own_error
        return Pose(pose.x + x, pose.y + y, pose.heading + heading)

    def _spread(self) -> None:
        """Let the covariance grow by the motion since the last call."""
        bit = self._forward_m, self._turn_rad, self._turned_rad, self._own_rad
        self._forward_m = self._turn_rad = self._turned_rad = self._own_rad = 0.0
        if any(bit[:3]):
            self._spread_by(np.array([[*bit, self._heading_rad]]))

    def _spread_by(self, bits: Array) -> None:
        if len(bits):
            spread(self.covariance, self._transition, bits, self._walk)


@lean_kernel
def _carried_along(odometry, belief, poses, spreads):  # type: ignore[no-untyped-def]
    """The poses, and the sums and the heading whenever the covariance must spread; how often it must."""
    spread = 0
    for i in range(len(poses)):
        if carried(odometry[i], odometry[i + 1], belief, spreads[spread]):
            spread += 1
        poses[i, 0], poses[i, 1], poses[i, 2] = belief[0], belief[1], belief[2]
    return spread


@inner_kernel
def carried(before, after, belief, spread):  # type: ignore[no-untyped-def]
    """Move a belief, shape (11,), by a short bit of odometry; whether the covariance must spread, and by which sums.

    It holds x, y [m], heading [rad], turn error, own error, bend [rad/m]; and since the last spread: metres forward,
    turn, turn but for the own part, own part; and how much of the own turn is left [rad].
    """
    turn = after[2] - before[2]
    c, s = math.cos(before[2]), math.sin(before[2])
    x = -c * before[0] - s * before[1] + c * after[0] + s * after[1]
    y = s * before[0] - c * before[1] - s * after[0] + c * after[1]
    own = min(max(turn, min(0.0, belief[10])), max(0.0, belief[10]))
    belief[10] -= own
    belief[9] += own
    belief[6] += x
    belief[7] += turn
    belief[8] += abs(turn - own)
    spreads = abs(belief[6]) > SPREAD_EVERY_M
    if spreads:
        spread[0], spread[1], spread[2], spread[3] = belief[6], belief[7], belief[8], belief[9]
        spread[4] = belief[2]
        belief[6], belief[7], belief[8], belief[9] = 0.0, 0.0, 0.0, 0.0
    c, s = math.cos(belief[2]), math.sin(belief[2])
    belief[0], belief[1] = belief[0] + c * x - s * y, belief[1] + s * x + c * y
    belief[2] += turn * (1.0 + belief[3]) + own * belief[4] + x * belief[5]
    return spreads
