"""`sonar_explore/Exploration-v0`: decisions. Choose the next scan position; the robot goes there and scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import draw_world, is_generator, load_world
from sonar_explore.envs.rendering import render_ansi, render_rgb
from sonar_explore.envs.simulator import Simulator
from sonar_explore.envs.validation import MAX_COORDINATE_M
from sonar_explore.envs.world import World
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.errors import SonarExploreError
from sonar_explore.explorer import Explorer, Situation, Trip
from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.mapping.grid import GridFrame, window
from sonar_explore.robot import Robot
from sonar_explore.slam import ScanUpdate, make_slam

Observation = dict[str, Any]

CONTACT_PENALTY = 10.0
TRAVEL_PENALTY_PER_M = 0.1

_FAR = MAX_COORDINATE_M  # finite bounds: infinite ones cannot be normalised
CANDIDATE_COLUMNS = ("x", "y", "path_length_m", "new_area_m2", "expected_chains", "certainty", "missing_link")
CHAIN_COLUMNS = ("x1", "y1", "x2", "y2", "root_probability", "dangling", "links")


class ExplorationEnv(gym.Env[Observation, np.int64]):
    """A robot with nothing but sonar explores an unknown building, one scan position at a time.

    ## Description
    Each step drives the simulated AmigoBot along a safe path to a candidate scan position, turns it once on the
    spot with one sonar, corrects the pose (SLAM), redraws the occupancy grid and offers the next candidates.
    The robot's mind never sees the truth; rewards and `info["truth"]` do.

    ## Action Space
    `Discrete(max_candidates)`: index of a candidate. Only those with `action_mask` 1 are possible; another index
    raises `SonarExploreError`. The mask is also `info["action_mask"]` and `action_masks()`. It is never all 0:
    where nothing is left, action 0 is possible and ends the episode (a first scan can show all of a small room).

    ## Observation Space
    A flat `Dict`; map frame throughout (the world's frame: the map is placed by the start pose).

    | key | shape, type | what |
    |---|---|---|
    | `map` | `map_shape`, uint8 | 0 unknown, 1 free, 2 occupied; 5 cm cells, row 0 the lowest y, the start in the middle |
    | `pose` | (3,), float32 | believed x, y [m], heading [rad], wrapped |
    | `chains` | (`max_chains`, 7), float32 | x1 y1 x2 y2 of the root [m], P(root), dangling 0/1, number of links; the newest chains, oldest of them first |
    | `chains_mask` | (`max_chains`,), int8 | 1 where there is a chain |
    | `candidates` | (`max_candidates`, 7), float32 | x y [m], path [m], new area [m2], chains expected to answer, their certainty 0..2, missing link 0/1 |
    | `action_mask` | (`max_candidates`,), int8 | 1 where the action is possible |

    ## Rewards
    Newly explored true area [m2] - 0.1 per metre driven - 10 per contact. Area is what exploration is for, travel
    breaks ties, and nothing is worth a collision.

    ## Starting State
    The robot stands at the world's start pose and has taken its first scan. The seed fixes the odometry error,
    the air's temperature and all noise, and which world it is where the world is drawn anew.

    ## Episode End
    Terminated when no candidate is left (`info["end_reason"]` is `explored`, or `stuck` where a place that was put
    aside is all that is left). Truncated after `max_scans` scans (`scan_limit`).

    ## Information
    `action_mask`; `end_reason` (empty while the episode runs); `sim_time_s`; `path_length_m`; `contacts`; and
    `truth`: `pose` (3,), `explored_fraction` and the `world`'s name, for scoring and pictures alone.

    ## Arguments
    `world`: a shipped name, a file, one generated world such as `generated/office-17`, or a generator such as
    `generated/office`, which draws a new world at each reset. `slam`: `chain`, `literal`, `smoothed`,
    `grid-pf`, `scan-match`, `off` or `truth`. `noise`: odometry preset `paper`, `ideal`, `worn`, or None to take
    `config`'s. `config`: an `ExplorationConfig`. `max_scans`: None to take `config`'s. `max_candidates`: how many are
    offered at most. It, `max_chains` and `map_shape` are sizes of the observation, the same for every world that is drawn;
    a map holds at least what one scan clears, and what lies beyond it is not shown. `render_mode`: `rgb_array` or `ansi`.

    ## Version History
    v0: first.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "ansi"], "render_fps": 2}  # noqa: RUF012 - as in the base class

    def __init__(
        self,
        world: str | Path | World = "paper/rooms",
        slam: str = "chain",
        noise: str | None = "paper",
        config: ExplorationConfig | None = None,
        max_candidates: int = 32,
        max_chains: int = 64,
        map_shape: tuple[int, int] = (480, 640),
        render_mode: str | None = None,
        max_scans: int | None = None,
    ) -> None:
        config = ExplorationConfig() if config is None else config
        _check(config, max_candidates, max_chains, map_shape)
        config = config if max_scans is None else replace(config, max_scans=max_scans)
        config = config if noise is None else config.with_noise(noise)
        most = min(max_candidates, config.candidates.most)
        self.config = replace(config, candidates=replace(config.candidates, most=most))
        self._generator = str(world) if is_generator(world) else None
        self._map_shape = map_shape
        self.slam_name = slam
        self._enter(world if isinstance(world, World) else load_world(world))
        make_slam(slam, self.world.start, self.config.slam)
        self.render_mode = render_mode
        self._max_chains = max_chains
        self.action_space = spaces.Discrete(max_candidates)
        self.observation_space = spaces.Dict(
            {
                "map": spaces.Box(0, 2, map_shape, np.uint8),
                "pose": spaces.Box(-_FAR, _FAR, (3,), np.float32),
                "chains": spaces.Box(-_FAR, _FAR, (max_chains, len(CHAIN_COLUMNS)), np.float32),
                "chains_mask": spaces.Box(0, 1, (max_chains,), np.int8),
                "candidates": spaces.Box(-_FAR, _FAR, (max_candidates, len(CANDIDATE_COLUMNS)), np.float32),
                "action_mask": spaces.Box(0, 1, (max_candidates,), np.int8),
            }
        )
        self.overhear: Callable[[Robot], Robot] = _directly
        """What stands between robot and mind from the next reset on: a recorder of measurements."""
        self.situation: Situation
        """What a scripted policy decides from."""
        self.update: ScanUpdate
        """What the last scan did to the belief."""
        self.trip: Trip | None
        """How the last drive went; None before the first."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Back to the start; the first scan is taken."""
        super().reset(seed=seed)
        if self._generator is not None:
            self._enter(draw_world(self._generator, self.np_random))
        self.simulator.reset(self.np_random)
        self.slam = make_slam(self.slam_name, self.world.start, self.config.slam)
        known_pose = partial(_true_pose, self.simulator) if self.slam_name == "truth" else None
        robot = self.overhear(self.simulator)
        self.explorer = Explorer(robot, self.slam, self.config, known_pose)
        self.scorer.reset()
        self.scans = 0
        self.trip = None
        self.true_trail: list[Pose] = []
        self._look()
        return self._observation(), self._info()

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go to a candidate and scan there."""
        self._require_reset("step")
        candidates = self.situation.candidates
        if not candidates:
            return self._observation(), 0.0, True, False, self._info()
        if not 0 <= int(action) < len(candidates):
            raise SonarExploreError(
                f"action {int(action)} is not possible now; there are {len(candidates)} candidates (see action_mask)"
            )
        driven, contacts, explored = self.simulator.driven_m, self.simulator.contacts, self.explored_fraction
        self.simulator.true_trail.clear()
        self.trip = self.explorer.go_to(candidates[int(action)])
        self.true_trail = list(self.simulator.true_trail)
        self._look()
        reward = (
            (self.explored_fraction - explored) * self.scorer.reachable_area_m2
            - TRAVEL_PENALTY_PER_M * (self.simulator.driven_m - driven)
            - CONTACT_PENALTY * (self.simulator.contacts - contacts)
        )
        terminated = not self.situation.candidates
        truncated = not terminated and self.scans >= self.config.max_scans
        return self._observation(), float(reward), terminated, truncated, self._info()

    def action_masks(self) -> NDArray[np.int8]:
        """Which actions are possible, shape (max_candidates,)."""
        self._require_reset("action_masks")
        mask = np.zeros(int(self.action_space.n), dtype=np.int8)  # type: ignore[attr-defined]
        mask[: max(1, len(self.situation.candidates))] = 1
        return mask

    @property
    def end_reason(self) -> str:
        """`explored`, `stuck` or `scan_limit`; empty while the episode runs."""
        if not self.situation.candidates:
            return "stuck" if self.explorer.gave_up else "explored"
        return "scan_limit" if self.scans >= self.config.max_scans else ""

    def render(self) -> NDArray[np.uint8] | str | None:
        """The map as a picture of what the observation shows, shape (rows, columns, 3), or as text."""
        self._require_reset("render")
        if self.render_mode == "rgb_array":
            return render_rgb(self.situation, self._frame)
        return render_ansi(self.situation) if self.render_mode == "ansi" else None

    def _require_reset(self, method: str) -> None:
        if not hasattr(self, "situation"):
            raise ResetNeeded(f"Cannot call env.{method}() before calling env.reset()")

    def _enter(self, world: World) -> None:
        """Put the robot into a world."""
        self.world = world
        self.scorer = Scorer(world)
        self.simulator = Simulator(world, self.config.simulator, np.random.default_rng(0))
        res, (rows, columns) = self.config.mapping.resolution_m, self._map_shape
        x0 = (round(world.start.x / res) - columns // 2) * res
        y0 = (round(world.start.y / res) - rows // 2) * res
        self._frame = GridFrame(x0, y0, res, self._map_shape)

    def _look(self) -> None:
        self.true_scan_pose: Pose = self.simulator.true_pose
        self.update = self.explorer.look()
        self.explored_fraction = self.scorer.add_scan(self.true_scan_pose.x, self.true_scan_pose.y)
        self.situation = self.explorer.situation()
        self.scans += 1

    def _observation(self) -> Observation:
        s = self.situation
        chains = s.chains[-self._max_chains :]
        chain_rows = np.zeros((self._max_chains, len(CHAIN_COLUMNS)), dtype=np.float32)
        chain_rows[: len(chains)] = np.array(
            [(*c.root.segment.as_row(), c.root_probability, c.dangling, len(c.placed)) for c in chains]
        ).reshape(-1, len(CHAIN_COLUMNS))
        candidate_rows = np.zeros((int(self.action_space.n), len(CANDIDATE_COLUMNS)), dtype=np.float32)  # type: ignore[attr-defined]
        candidate_rows[: len(s.candidates)] = np.array(
            [
                (c.x, c.y, c.path_length_m, c.new_area_m2, len(c.chains), c.certainty, bool(c.missing_links))
                for c in s.candidates[: len(candidate_rows)]
            ]
        ).reshape(-1, len(CANDIDATE_COLUMNS))
        return {
            "map": window(s.grid.frame, s.grid.states, self._frame),
            "pose": np.array([s.pose.x, s.pose.y, wrap_angle(s.pose.heading)], dtype=np.float32),
            "chains": chain_rows,
            "chains_mask": (np.arange(self._max_chains) < len(chains)).astype(np.int8),
            "candidates": candidate_rows,
            "action_mask": self.action_masks(),
        }

    def _info(self) -> dict[str, Any]:
        true_pose = self.simulator.true_pose
        return {
            "action_mask": self.action_masks(),
            "end_reason": self.end_reason,
            "sim_time_s": self.simulator.time_s,
            "path_length_m": self.simulator.driven_m,
            "contacts": self.simulator.contacts,
            "truth": {
                "pose": np.array([true_pose.x, true_pose.y, true_pose.heading]),
                "explored_fraction": float(self.explored_fraction),
                "world": self.world.name,
            },
        }


def _check(
    config: ExplorationConfig, max_candidates: int, max_chains: int, map_shape: tuple[int, int]
) -> None:
    """Refuse in one line what an observation cannot be made with."""
    if not isinstance(config, ExplorationConfig):
        raise SonarExploreError(f"config is a {type(config).__name__}; give an ExplorationConfig")
    for name, size in (("max_candidates", max_candidates), ("max_chains", max_chains)):
        if size < 1:
            raise SonarExploreError(f"{name} is {size}; at least 1 is possible")
    least = 2 * round(config.mapping.free_range_m / config.mapping.resolution_m)
    if np.shape(map_shape) != (2,) or min(map_shape) < least:
        raise SonarExploreError(
            f"map_shape is {map_shape}; give (rows, columns), at least {least} x {least} cells: one scan clears as much"
        )


# functions, not lambdas: an environment can be pickled and copied in the middle of an episode
def _directly(robot: Robot) -> Robot:
    return robot


def _true_pose(simulator: Simulator) -> Pose:
    return simulator.true_pose
