"""What a process costs: import, `--help`, the first run with nothing compiled, memory, many environments at once."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
import time

import numpy as np
import psutil

from sonar_explore.envs.exploration_env import ExplorationEnv

FIRST_RUN = "from sonar_explore.episodes.run import run_episode; run_episode('paper/corridor', seed=0)"
MEMORY = """
import os, psutil
process = psutil.Process(os.getpid())
before = process.memory_info().rss
from sonar_explore.envs.exploration_env import ExplorationEnv
import numpy as np
env = ExplorationEnv("paper/rooms")
env.reset(seed=0)
for _ in range(20):
    if env.end_reason: env.reset()
    env.step(np.flatnonzero(env.action_masks())[0])
first = process.memory_info().rss
other = ExplorationEnv("paper/rooms"); other.reset(seed=0); other.step(np.flatnonzero(other.action_masks())[0])
print(first - before, process.memory_info().rss - first)
"""


def python(*arguments: str, **environment: str) -> str:
    run = [sys.executable, *arguments]
    return subprocess.run(
        run, check=True, capture_output=True, text=True, env={**os.environ, **environment}
    ).stdout


def bench_interpreter(benchmark):
    benchmark.pedantic(lambda: python("-c", "pass"), rounds=5, warmup_rounds=1)


def bench_import(benchmark):
    benchmark.pedantic(lambda: python("-c", "import sonar_explore"), rounds=5, warmup_rounds=1)


def bench_help(benchmark):
    benchmark.pedantic(lambda: python("-m", "sonar_explore.cli", "--help"), rounds=5, warmup_rounds=1)


def bench_first_run(benchmark):
    """A short episode with an empty cache: everything is compiled."""

    def first() -> None:
        with tempfile.TemporaryDirectory() as cache:
            python("-c", FIRST_RUN, NUMBA_CACHE_DIR=cache)

    benchmark.pedantic(first, rounds=1)


def bench_second_run(benchmark):
    """The same, compiled before."""
    benchmark.pedantic(lambda: python("-c", FIRST_RUN), rounds=3, warmup_rounds=1)


def bench_memory(benchmark, figure):
    first, another = (
        int(n) / 2**20 for n in benchmark.pedantic(lambda: python("-c", MEMORY), rounds=1).split()
    )
    figure(
        f"memory: first environment and libraries {first:.0f} MB over the interpreter's, one more {another:.1f} MB"
    )


def decide(seed: int, steps: int = 15) -> None:
    env = ExplorationEnv("paper/rooms")
    env.reset(seed=seed)
    for _ in range(steps):
        if env.end_reason:
            env.reset()
        env.step(np.flatnonzero(env.action_masks())[0])


def bench_sixteen_environments(benchmark, figure):
    """16 environments, 15 decisions each: one process, then two."""

    def both() -> tuple[float, float]:
        began = time.perf_counter()
        for seed in range(16):
            decide(seed)
        alone = time.perf_counter() - began
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            pool.map(decide, [0, 1], chunksize=1)  # warm
            began = time.perf_counter()
            pool.map(decide, range(16), chunksize=1)
            return alone, time.perf_counter() - began

    decide(0)
    alone, shared = benchmark.pedantic(both, rounds=1)
    figure(
        f"16 environments x 15 decisions: {240 / alone:.0f} a second in one process, {240 / shared:.0f} in two: "
        f"{alone / shared:.2f} times on {psutil.cpu_count()} cores"
    )
