"""CPU time of the parts of one episode, per scan.

`python benchmarks/where_time_goes.py paper/rooms chain` runs seed 2 to warm up, then seed 1. Times are of the process,
so that other work on the machine counts little; parts stand within others as they are indented.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from sonar_explore import explorer
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.simulator import Simulator
from sonar_explore.episodes.run import run_episode
from sonar_explore.explorer import Explorer
from sonar_explore.mapping.occupancy import OccupancyMapper
from sonar_explore.mapping.sectors import Sectors
from sonar_explore.planning import paths, surroundings
from sonar_explore.planning.candidates import CandidateFinder
from sonar_explore.planning.cheapest import Search
from sonar_explore.planning.driving import Driver
from sonar_explore.slam import slam as slam_module
from sonar_explore.slam.slam import ChainSlam
from sonar_explore.slam.smoothing.smoothed import SmoothedSlam
from sonar_explore.slam.smoothing.smoothing import Smoother

PARTS: tuple[tuple[str, Any, str], ...] = (
    ("a decision, or the reset", ExplorationEnv, "_look"),
    ("  the scan (simulator)", Simulator, "scan"),
    ("  SLAM, `chain` part", ChainSlam, "update"),
    ("    features of eight discs", slam_module, "extract"),
    ("  SLAM, all of `smoothed`", SmoothedSlam, "update"),
    ("    least squares", Smoother, "solve"),
    ("  evidence of the scan", surroundings, "look_of"),
    ("  what there is to decide from", Explorer, "situation"),
    ("    candidates", CandidateFinder, "find"),
    ("    frontiers", explorer, "find_frontiers"),
    ("the drive, planning included", Explorer, "go_to"),
    ("  driving", Driver, "follow"),
    ("    the robot by itself", Simulator, "drive_leg"),
    ("drawing the map (in both)", OccupancyMapper, "draw"),
    ("  cells of changed scans", Sectors, "put"),
    ("safe paths, before any is looked for (in both)", paths.SafePaths, "__init__"),
    ("  room", paths, "clearance"),
    ("cheapest costs of ways (in both)", Search, "_spread"),
)


def measured(holder: Any, name: str, spent: dict[Any, list[float]]) -> None:
    """Let a function add up its time and its calls."""
    function: Callable[..., Any] = getattr(holder, name)

    def timed(*args: Any, **kwargs: Any) -> Any:
        began = time.process_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent[holder, name][0] += time.process_time() - began
            spent[holder, name][1] += 1

    setattr(holder, name, timed)


def main(world: str, slam: str) -> None:
    """Print milliseconds and calls per scan."""
    run_episode(world, slam=slam, seed=2)
    began = time.process_time()
    scans = run_episode(world, slam=slam, seed=1).summary.scans
    whole = time.process_time() - began
    print(
        f"{world}, {slam}, seed 1: {scans} scans, {whole:.2f} s of CPU time, {1e3 * whole / scans:.1f} ms a scan"
    )
    spent: dict[Any, list[float]] = defaultdict(lambda: [0.0, 0])
    for _, holder, name in PARTS:
        measured(holder, name, spent)
    run_episode(world, slam=slam, seed=1)
    for title, holder, name in PARTS:
        seconds, calls = spent[holder, name]
        if calls:
            print(f"{title:48s} {1e3 * seconds / scans:7.2f} ms  {calls / scans:6.2f} calls")


if __name__ == "__main__":
    main(*sys.argv[1:3])
