"""What a process costs: import, `--help`, the first run with nothing compiled, memory, many environments at once."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import psutil
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

from sonar_explore.envs.exploration_env import ExplorationEnv
from sonar_explore.envs.vector import WorkersVectorEnv

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


def run_corridor(**environment: str) -> None:
    with tempfile.TemporaryDirectory() as out:
        python("-m", "sonar_explore.cli", "run", "paper/corridor", "--out", out, **environment)


def bench_interpreter(benchmark):
    benchmark.pedantic(lambda: python("-c", "pass"), rounds=5, warmup_rounds=1)


def bench_import(benchmark):
    benchmark.pedantic(lambda: python("-c", "import sonar_explore"), rounds=5, warmup_rounds=1)


def bench_help(benchmark):
    benchmark.pedantic(lambda: python("-m", "sonar_explore.cli", "--help"), rounds=5, warmup_rounds=1)


def bench_first_run(benchmark):
    """As the command does it, with an empty cache: everything is compiled, by two processes."""

    def first() -> None:
        with tempfile.TemporaryDirectory() as cache:
            run_corridor(NUMBA_CACHE_DIR=cache)

    benchmark.pedantic(first, rounds=1)


def bench_second_run(benchmark):
    """The same, compiled before."""
    benchmark.pedantic(run_corridor, rounds=3, warmup_rounds=1)


def bench_memory(benchmark, figure):
    first, another = (
        int(n) / 2**20 for n in benchmark.pedantic(lambda: python("-c", MEMORY), rounds=1).split()
    )
    figure(
        f"memory: first environment and libraries {first:.0f} MB over the interpreter's, one more {another:.1f} MB"
    )


def decide_in(environments: VectorEnv, steps: int) -> float:
    """Seconds that a number of decisions takes in all environments at once."""
    _, info = environments.reset(seed=0)
    began = time.perf_counter()
    for _ in range(steps):
        _, _, _, _, info = environments.step(np.argmax(info["action_mask"], axis=1))
    return time.perf_counter() - began


def decisions_a_second(made: Callable[..., VectorEnv], environments: int) -> float:
    """Of so many environments, 40 decisions each, once those very decisions have been taken: all is loaded."""
    several = made([lambda: ExplorationEnv("paper/rooms")] * environments)
    decide_in(several, 40)
    span = decide_in(several, 40)
    several.close()
    return 40 * environments / span


def bench_sixteen_environments(benchmark, figure):
    """16 environments in one process; as registered, in a worker for each core; in gymnasium's AsyncVectorEnv, sixteen
    processes; and by halves in two that know nothing of each other, which is what the machine can do."""

    def all_four() -> tuple[float, float, float, float]:
        alone = decisions_a_second(SyncVectorEnv, 16)
        workers = decisions_a_second(WorkersVectorEnv, 16)
        each = decisions_a_second(AsyncVectorEnv, 16)
        with ProcessPoolExecutor(2) as pool:
            apart = sum(pool.map(decisions_a_second, [SyncVectorEnv] * 2, [8, 8]))
        return alone, workers, each, apart

    alone, workers, each, apart = benchmark.pedantic(all_four, rounds=1)
    figure(
        f"16 environments x 40 decisions: {alone:.0f} a second in one process, {workers:.0f} in a worker for each core "
        f"({workers / alone:.2f} times), {each:.0f} in sixteen ({each / alone:.2f} times), {apart:.0f} in two on their "
        f"own ({apart / alone:.2f} times), {psutil.cpu_count()} cores"
    )


GROWTH = """
import os, psutil
from sonar_explore.envs.exploration_env import ExplorationEnv
import numpy as np
process, env, seen = psutil.Process(os.getpid()), ExplorationEnv("paper/corridor"), []
env.reset(seed=0)
for step in range(10_000):
    if env.end_reason: env.reset()
    env.step(np.flatnonzero(env.action_masks())[0])
    if step in (999, 9_999): seen.append(process.memory_info().rss)
print(*seen)
"""


def bench_growth(benchmark, figure):
    """Memory over 10,000 decisions."""
    first, last = (int(n) / 2**20 for n in benchmark.pedantic(lambda: python("-c", GROWTH), rounds=1).split())
    figure(f"memory after 1,000 decisions {first:.0f} MB, after 10,000 {last:.0f} MB")
