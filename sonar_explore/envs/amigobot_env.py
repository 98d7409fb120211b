"""`sonar_explore/AmigoBot-v0`: control. Wheel speeds in, eight ranges, odometry and bumper out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sonar_explore.envs.load import draw_world, is_generator, load_world
from sonar_explore.envs.odometry import noise_preset
from sonar_explore.envs.rendering import top_view_ansi, top_view_rgb
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.envs.validation import MAX_COORDINATE_M
from sonar_explore.envs.world import World
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, wrap_angle

Observation = dict[str, Any]
Action = NDArray[np.float32]

CONTACT_PENALTY = 1.0
EXPLORED_ENOUGH = 0.99
COUNT_EVERY_M = 0.10


class AmigoBotEnv(gym.Env[Observation, Action]):
    """A robot with nothing but sonar drives about an unknown building, one control period at a time.

    ## Description
    The simulated AmigoBot holds a forward and a turn speed for one control period while its ring of eight discs
    fires in turn, one every 40 ms. There is no SLAM and no map here: what to make of eight ranges and an odometry
    that drifts is left to whoever drives. To decide about scan positions, with SLAM and map done, take
    `sonar_explore/Exploration-v0`.

    ## Action Space
    `Box(-1, 1, (2,), float32)`: forward speed and turn speed as shares of the robot's greatest, 0.5 m/s and
    50 deg/s; positive is forward and counter-clockwise. Values beyond 1 count as 1; NaN raises `SonarExploreError`.

    ## Observation Space
    A flat `Dict`.

    | key | shape, type | what |
    |---|---|---|
    | `sonar` | (8,), float32 | latest range of each disc [m], from left round the front to the right and the rear; 5 where nothing was heard. With the default period four of the eight are new at each step |
    | `odometry` | (3,), float32 | x, y [m], heading [rad] in (-pi, pi], in the odometry frame: the start is (0, 0, 0), and it drifts |
    | `bumper` | (1,), int8 | 1 if a touch stopped the body at any time in this period |

    ## Rewards
    Newly explored true area [m2] - 1 per touch. Area is reachable area that lies within 2 m and in line of sight
    of the true position, counted each time the robot has come 10 cm from where it was last counted
    (docs/metrics.md). A touch that lasts counts once. Driving in circles pays nothing, so time has no price of
    its own.

    ## Starting State
    The world's start pose, wheels at rest, after one round of all eight discs (0.32 s). What is in view of the
    start pays no reward. The seed fixes the odometry error, the air's temperature and all noise, and which world it
    is where the world is drawn anew.

    ## Episode End
    Terminated when 99 % of the reachable area is explored (`info["end_reason"]` is `explored`). A touch stops the
    body but ends nothing: the robot can turn and back away. Truncated by `gym.make`'s time limit, 5000 steps (at
    the default period 800 s) unless `max_episode_steps` says otherwise.

    ## Information
    `end_reason` (empty while the episode runs); `sim_time_s`; `path_length_m`, by the wheels; `contacts`; and
    `truth`: `pose` (3,) in the world frame, `explored_fraction` and the `world`'s name, for scoring and pictures
    alone.

    ## Arguments
    `world`: a shipped name, a file, one generated world such as `generated/office-17`, or a generator such as
    `generated/office`, which draws a new world at each reset. `noise`: odometry preset `paper`, `ideal`, `worn`, or
    None to take `config`'s. `config`: a `SimulatorConfig`. `control_period_s`: a multiple of the 40 ms between pings.
    `render_mode`: `rgb_array` or `ansi`, the true top view.

    ## Version History
    v0: first.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "ansi"], "render_fps": 6}  # noqa: RUF012 - as in the base class

    def __init__(
        self,
        world: str | World = "paper/rooms",
        noise: str | None = "paper",
        config: SimulatorConfig | None = None,
        control_period_s: float = 0.16,
        render_mode: str | None = None,
    ) -> None:
        self._generator = str(world) if is_generator(world) else None
        self._config = _simulator_config(config, noise)
        self._enter(world if isinstance(world, World) else load_world(world))
        self.render_mode = render_mode
        body = self.simulator.config.robot
        self._ticks = _ticks(control_period_s, body.ping_interval_s)
        self._speed_max = np.array([body.speed_max_m_s, body.turn_rate_max_rad_s])
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        farthest = np.array([MAX_COORDINATE_M, MAX_COORDINATE_M, np.pi], dtype=np.float32)
        self.observation_space = spaces.Dict(
            {
                "sonar": spaces.Box(0.0, body.range_max_m, (len(body.sonars),), np.float32),
                "odometry": spaces.Box(-farthest, farthest, dtype=np.float32),
                "bumper": spaces.Box(0, 1, (1,), np.int8),
            }
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Back to the start; every disc has fired once."""
        super().reset(seed=seed)
        if self._generator is not None:
            self._enter(draw_world(self._generator, self.np_random))
        self.simulator.reset(self.np_random)
        for _ in self.simulator.config.robot.sonars:
            self.simulator.tick(0.0, 0.0)
        self.scorer.reset()
        self._bumped = False
        self._explored_m2 = 0.0
        self._count()
        return self._observation(), self._info()

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the speeds for one control period."""
        if not hasattr(self, "_explored_m2"):
            raise ResetNeeded("Cannot call env.step() before calling env.reset()")
        if np.shape(action) != (2,) or not np.isfinite(action).all():
            raise SonarExploreError(f"action {action} is no pair of speeds")
        speed, turn_rate = (np.clip(action, -1.0, 1.0) * self._speed_max).tolist()
        explored_m2, contacts = self._explored_m2, self.simulator.contacts
        self._bumped = False
        for _ in range(self._ticks):
            self.simulator.tick(speed, turn_rate)
            self._bumped |= self.simulator.bumper
        self.simulator.true_trail.clear()
        if self.simulator.true_pose.distance_to(self._counted_at) >= COUNT_EVERY_M:
            self._count()
        touches = self.simulator.contacts - contacts
        reward = self._explored_m2 - explored_m2 - CONTACT_PENALTY * touches
        return self._observation(), reward, bool(self.end_reason), False, self._info()

    @property
    def end_reason(self) -> str:
        """`explored`; empty while the episode runs."""
        return "explored" if self._explored_fraction >= EXPLORED_ENOUGH else ""

    def render(self) -> NDArray[np.uint8] | str | None:
        """The truth from above, shape (rows, columns, 3), or as text."""
        true_pose = self.simulator.true_pose
        if self.render_mode == "rgb_array":
            return top_view_rgb(self.world, true_pose, self._echoes_in_world())
        return top_view_ansi(self.world, true_pose) if self.render_mode == "ansi" else None

    def _enter(self, world: World) -> None:
        """Put the robot into a world."""
        self.world = world
        self.scorer = Scorer(world)
        self.simulator = Simulator(world, self._config, np.random.default_rng(0))

    def _count(self) -> None:
        self._counted_at = self.simulator.true_pose
        self._explored_fraction = self.scorer.add_scan(self._counted_at.x, self._counted_at.y)
        self._explored_m2 = self._explored_fraction * self.scorer.reachable_area_m2

    def _echoes_in_world(self) -> Array:
        """Where the latest echoes seem to come from, on the axis of their disc, shape (n, 2), [m]."""
        body = self.simulator.config.robot
        heard = [
            (self.simulator.true_pose @ disc).transform(np.array([[echo, 0.0]]))
            for disc, echo in zip(body.sonars, self.simulator.ring_m, strict=True)
            if echo < body.range_max_m
        ]
        return np.vstack([np.zeros((0, 2)), *heard])

    def _observation(self) -> Observation:
        pose = self.simulator.pose_robot_in_odometry
        return {
            "sonar": self.simulator.ring_m.astype(np.float32),
            "odometry": np.array([pose.x, pose.y, wrap_angle(pose.heading)], dtype=np.float32),
            "bumper": np.array([self._bumped], dtype=np.int8),
        }

    def _info(self) -> dict[str, Any]:
        true_pose = self.simulator.true_pose
        return {
            "end_reason": self.end_reason,
            "sim_time_s": self.simulator.time_s,
            "path_length_m": self.simulator.driven_m,
            "contacts": self.simulator.contacts,
            "truth": {
                "pose": np.array([true_pose.x, true_pose.y, true_pose.heading]),
                "explored_fraction": self._explored_fraction,
                "world": self.world.name,
            },
        }


def _simulator_config(config: SimulatorConfig | None, noise: str | None) -> SimulatorConfig:
    config = SimulatorConfig() if config is None else config
    if not isinstance(config, SimulatorConfig):
        raise SonarExploreError(f"config is a {type(config).__name__}; give a SimulatorConfig")
    return config if noise is None else replace(config, noise=noise_preset(noise))


def _ticks(control_period_s: float, ping_interval_s: float) -> int:
    ticks = control_period_s / ping_interval_s
    if not (ticks >= 0.5 and abs(ticks - round(ticks)) < 1e-6):
        raise SonarExploreError(
            f"control_period_s is {control_period_s}; possible: whole multiples of {ping_interval_s} s"
        )
    return round(ticks)
