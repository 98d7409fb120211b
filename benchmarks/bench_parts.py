"""One core, warm: scans, ticks, SLAM updates, decisions, an episode; and ir-sim's lidar in the same building."""

from __future__ import annotations

import functools
import itertools
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from worlds import building, scan_discs

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.acoustics import SonarPhysics, echoes
from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.load import load_world
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.simulator import Simulator, SimulatorConfig
from sonar_explore.episodes.run import run_episode
from sonar_explore.geometry import Pose, Segment
from sonar_explore.mapping.frontiers import find_frontiers
from sonar_explore.mapping.looks import look_of
from sonar_explore.mapping.occupancy import OccupancyMapper
from sonar_explore.slam import Feature, FeatureKind, Link, make_slam


@pytest.mark.parametrize("walls", [100, 1000])
def bench_scan(benchmark, figure, walls):
    """90 pings with the full physics: sources, occlusion, edges, corners, ghosts by two mirrors."""
    world, side = building(walls)
    scene, turns, physics = Scene.of(world, 5.0), scan_discs(side, 200), SonarPhysics()
    for turn in turns:
        echoes(scene, turn, physics)
    benchmark.pedantic(lambda: [echoes(scene, turn, physics) for turn in turns], rounds=15)
    figure(
        f"scans in a world of {len(scene.things.walls)} walls: {200 / benchmark.stats.stats.median:,.0f} a second"
    )


def bench_simulated_scan(benchmark):
    """A scan as the robot takes it: odometry errors, pings, noise."""
    robot = Simulator(load_world("paper/rooms"), SimulatorConfig(), np.random.default_rng(0))
    robot.scan(1)
    benchmark(robot.scan, 1)


def bench_tick(benchmark):
    """Drive for 40 ms, look out for walls, fire one disc."""
    robot = Simulator(load_world("paper/rooms"), SimulatorConfig(), np.random.default_rng(0))
    benchmark.pedantic(lambda: [robot.tick(0.1, 0.7) for _ in range(200)], rounds=15, warmup_rounds=1)
    benchmark.extra_info["ticks a round"] = 200


@pytest.mark.parametrize("links", [100, 10_000])
def bench_slam_update(benchmark, links):
    """`ChainSlam.update` of scans in one room, on a map with this many links, most of them elsewhere."""
    world = load_world("paper/rooms")
    robot = Simulator(world, SimulatorConfig(), np.random.default_rng(0))
    scans = []
    for _ in range(40):
        scans.append(robot.scan(1))
        for _ in range(5):
            robot.tick(0.05, 0.0)

    def mapped():
        slam = make_slam("chain", world.start, ExplorationConfig().slam)
        rng = np.random.default_rng(0)
        for x, y, angle in rng.uniform((20, 20, -1.5), (220, 220, 1.5), (links, 3)):
            half = 0.3
            c, s = half * np.cos(angle), half * np.sin(angle)
            piece = Segment(x - c, y - s, x + c, y + s)
            slam.chains.add_root(Link(piece, 0, 0, Feature(FeatureKind.WALL, 0.0, 1.0, 0.35, piece, ())), 1.0)
        slam.update(scans[0])
        return (slam,), {}

    benchmark.pedantic(lambda slam: [slam.update(scan) for scan in scans[1:]], setup=mapped, rounds=7)
    benchmark.extra_info["updates a round"] = len(scans) - 1


@pytest.mark.parametrize("slam", ["chain", "smoothed"])
def bench_decision(benchmark, slam):
    """A step of Exploration-v0: drive, scan, SLAM, map, candidates; and frontiers, for a policy that asks."""
    env = ExplorationEnv("paper/rooms", slam=slam)
    seeds = itertools.count()

    def step() -> None:
        if env.end_reason:
            env.reset(seed=next(seeds))
        env.step(np.flatnonzero(env.action_masks())[0])
        _ = env.situation.frontiers

    env.reset(seed=next(seeds))
    benchmark.pedantic(step, rounds=60, warmup_rounds=5)


@pytest.mark.parametrize("slam", ["chain", "smoothed"])
def bench_episode(benchmark, figure, slam):
    """`paper/rooms`, frontier policy, seed 1, recorded."""
    record = benchmark.pedantic(
        lambda: run_episode("paper/rooms", slam=slam, seed=1), rounds=3, warmup_rounds=1
    )
    simulated_s, took_s = record.summary.sim_time_s, benchmark.stats.stats.median
    figure(
        f"{slam}: a simulated minute takes {60e3 * took_s / simulated_s:.0f} ms, {simulated_s / took_s:,.0f} times life"
    )


def bench_frontiers(benchmark):
    """Frontiers of a finished map, distances to walls known."""
    grid = explored().grid
    assert grid.to_walls_m.any()
    benchmark.pedantic(lambda: find_frontiers(grid, 0.18, 0.15), rounds=50, warmup_rounds=2)


def bench_rebuild(benchmark):
    """The grid of 200 scans after all of them have moved a little."""
    scans = explored().scans
    entries = [scans[i % len(scans)] for i in range(200)]
    mapping = ExplorationConfig().mapping
    looks = [look_of(e.scan, e.features, mapping) for e in entries]
    mapper, trails = OccupancyMapper(mapping, 0.18, 2.0), [np.zeros((1, 2))] * 200
    shifts = itertools.cycle((0.0, 0.01))

    def rebuild() -> None:
        by = next(shifts)
        poses = [Pose(e.pose.x + by, e.pose.y, e.pose.heading) for e in entries]
        mapper.draw(poses, looks, trails, np.zeros((0, 4)))

    benchmark.pedantic(rebuild, rounds=10, warmup_rounds=2)


@functools.cache
def explored() -> SimpleNamespace:
    """Grid and scans at the end of an episode in `paper/rooms`."""
    env = ExplorationEnv("paper/rooms")
    env.reset(seed=1)
    while not env.end_reason:
        env.step(np.flatnonzero(env.action_masks())[0])
    return SimpleNamespace(grid=env.situation.grid, scans=env.slam.scans)


@pytest.mark.parametrize("walls", [100])
def bench_irsim_lidar(benchmark, figure, walls):
    """ir-sim's 2-D lidar, 90 rays over a full turn, 5 m, in the same building: ideal rays, no physics."""
    irsim = pytest.importorskip("irsim")
    world, side = building(walls)
    lines = "\n".join(
        f"  - shape: {{name: linestring, vertices: [[{a:.3f}, {b:.3f}], [{c:.3f}, {d:.3f}]]}}\n    state: [0, 0, 0]"
        for a, b, c, d in world.walls
    )
    text = f"""world: {{height: {side}, width: {side}, step_time: 0.1}}
robot:
  - kinematics: {{name: diff}}
    shape: {{name: circle, radius: 0.18}}
    state: [{world.start.x}, {world.start.y}, 0]
    sensors:
      - {{type: lidar2d, range_min: 0, range_max: 5, angle_range: 6.2832, number: 90, noise: false}}
obstacle:
{lines}
"""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "building.yaml")
        path.write_text(text)
        env = irsim.make(str(path), display=False, save_ani=False)
    robot = env.robot
    sensor = robot.sensors[0]
    benchmark.pedantic(lambda: [sensor.step(robot.state) for _ in range(20)], rounds=10, warmup_rounds=1)
    theirs = 20 / benchmark.stats.stats.median
    scene, turns = Scene.of(world, 5.0), scan_discs(side, 200)
    spans = []
    for _ in range(10):
        began = time.perf_counter()
        for turn in turns:
            echoes(scene, turn, SonarPhysics())
        spans.append(time.perf_counter() - began)
    ours = 200 / float(np.median(spans))
    figure(
        f"ir-sim: {theirs:,.0f} scans of 90 ideal rays a second; ours: {ours:,.0f}, {ours / theirs:.1f} times"
    )
