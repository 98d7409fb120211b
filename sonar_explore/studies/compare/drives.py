"""Recorded drives: what a robot measured on its way, and the truth beside it for scoring alone.

Accuracy is compared on the same measurements, not on separate drives: a SLAM that errs drives elsewhere and meets
other walls. The drive is an exploration with the pose known (`truth`), so that it is a good one for all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonar_explore.agents import make_agent
from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.load import load_world
from sonar_explore.envs.simulator import Simulator
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan


@dataclass(frozen=True, eq=False)
class Drive:
    """One exploration as its robot measured it, and as it truly was."""

    world: World
    log: tuple[Pose | Scan, ...]
    """In order of time: the scans, and `pose_robot_in_odometry` after each of them and after every tick."""
    true_poses: tuple[Pose, ...]
    """`pose_robot_in_world` when each scan began."""
    turn_ratios: Array
    """True over measured turning in each scan, shape (scans,): how a scan is smeared."""

    @property
    def scans(self) -> tuple[Scan, ...]:
        """In order."""
        return tuple(entry for entry in self.log if isinstance(entry, Scan))


def record_drive(
    world: str | World, noise: str = "paper", seed: int = 0, config: ExplorationConfig | None = None
) -> Drive:
    """Explore with the pose known, and keep what was measured; the seed fixes everything."""
    place = world if isinstance(world, World) else load_world(world)
    env = ExplorationEnv(place, "truth", noise, config)
    env.simulator = recorder = _Recorder(place, env.config.simulator, np.random.default_rng(0))
    env.reset(seed=seed)
    agent = make_agent("frontier")
    while not env.end_reason:
        env.step(np.int64(agent.choose(env.situation).chosen))
    return Drive(place, tuple(recorder.log), tuple(recorder.true_poses), np.array(recorder.turn_ratios))


class _Recorder(Simulator):
    """Notes down what it lets the robot measure."""

    def reset(self, rng: np.random.Generator) -> None:
        """A new drive, with nothing noted down."""
        super().reset(rng)
        self.log: list[Pose | Scan] = []
        self.true_poses: list[Pose] = []
        self.turn_ratios: list[float] = []

    def tick(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        """Drive for one tick [m/s], [rad/s]; the odometry after it is noted down."""
        super().tick(speed_m_s, turn_rate_rad_s)
        self.log.append(self.pose_robot_in_odometry)

    def scan(self, direction: int) -> Scan:
        """A full turn, noted down with the true pose at which it began."""
        return self._noted(super().scan, direction)

    def ring_scan(self, direction: int) -> Scan:
        """A turn of the ring, noted down likewise."""
        return self._noted(super().ring_scan, direction)

    def _noted(self, take: Callable[[int], Scan], direction: int) -> Scan:
        began = self.true_pose
        scan = take(direction)
        self.log += [scan, self.pose_robot_in_odometry]
        self.true_poses.append(began)
        measured = self.pose_robot_in_odometry.heading - scan.pose_robot_in_odometry.heading
        self.turn_ratios.append((self.true_pose.heading - began.heading) / measured)
        return scan
