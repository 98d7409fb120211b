"""What a first run compiles: each kernel once, and on two cores; and what runs where nothing is compiled."""

import json
import subprocess
import sys
from mmap import mmap
from pathlib import Path

import pytest

from sonar_explore import compile_beside

pytest.importorskip("numba")

MADE_WITH_OTHERS = {
    "sonar_explore.planning.echoes:nearest_danger",
    "sonar_explore.slam.joint.joint_steps:added",
    "sonar_explore.slam.joint.landmarks:looked",
}
"""Called from Python too, after a kernel that contains it has been compiled."""

EPISODES = """
import json, sys
from sonar_explore.compile_beside import spelled
from sonar_explore.episodes.run import run_episode
for slam in sys.argv[1:]:
    run_episode("paper/corridor", slam=slam, seed=0)
found = {}
for module in [name for name in sys.modules if name.startswith("sonar_explore.")]:
    for name, kernel in vars(sys.modules[module]).items():
        if hasattr(kernel, "signatures") and kernel.py_func.__module__ == module:
            found[f"{module}:{name}"] = [spelled(types) for types in kernel.signatures]
print(json.dumps(found))
"""

TWO_KERNELS = """
import json, os, sys
from pathlib import Path
import numpy as np
from sonar_explore import compile_beside
from sonar_explore.planning.candidates import _apart, _none_near
compile_beside.KERNELS, compile_beside.usable_cores = Path(sys.argv[1]), lambda: 2
places = np.zeros((2, 2))
with compile_beside.compiling_beside() as beside:
    _apart(places, 1.0, np.zeros(1, dtype=np.int64))
    (process,) = beside.processes
    process.join(60)
    assert not process.is_alive()
_none_near(places, places, 1.0)
print(sum(_apart.stats.cache_hits.values()), sum(_none_near.stats.cache_hits.values()))
"""

TWO_SCANS = """
import hashlib, msgspec
from sonar_explore.config import ExplorationConfig
from sonar_explore.episodes.run import run_episode
for slam in ("chain", "smoothed"):
    record = run_episode("paper/corridor", slam=slam, seed=1, config=ExplorationConfig(max_scans=2))
    summary = msgspec.structs.replace(record.summary, wall_time_s=0.0)
    print(hashlib.sha256(msgspec.json.encode(msgspec.structs.replace(record, summary=summary))).hexdigest())
"""


def run_python(code: str, *arguments: str, **environment: str) -> str:
    import os

    run = [sys.executable, "-c", code, *arguments]
    return subprocess.run(
        run, capture_output=True, text=True, check=True, env={**os.environ, **environment}
    ).stdout


def kernels_of_episodes(*slams: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = json.loads(run_python(EPISODES, *slams))
    return found


def test_an_episode_compiles_each_kernel_for_one_set_of_types_and_the_list_has_them():
    kernels_of_episodes("chain")  # once all is compiled, only what is called from Python is loaded
    found = kernels_of_episodes("chain")
    called = {name: types for name, types in found.items() if types}
    listed = json.loads(compile_beside.KERNELS.read_text())
    assert {name: types for name, types in called.items() if len(types) > 1} == {}
    of_the_run = {name for name in called if ".pings." in name} | MADE_WITH_OTHERS
    stale = "python benchmarks/kernel_types.py writes the list anew"
    assert called.keys() - listed.keys() == of_the_run, stale
    assert listed.keys() <= found.keys(), stale
    assert {name: listed[name] for name in called.keys() - of_the_run} == {
        name: types[0] for name, types in called.items() if name not in of_the_run
    }, stale


def test_what_the_second_process_compiles_is_found_by_the_first(tmp_path: Path):
    listed = json.loads(compile_beside.KERNELS.read_text())
    both = {name: types for name, types in listed.items() if name.endswith((":_apart", ":_none_near"))}
    assert len(both) == 2
    (tmp_path / "two.json").write_text(json.dumps(both))
    hits = run_python(TWO_KERNELS, str(tmp_path / "two.json"), NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert hits.split() == ["0", "1"]


def test_the_same_lines_interpreted_give_the_same_episodes():
    assert run_python(TWO_SCANS, NUMBA_DISABLE_JIT="1") == run_python(TWO_SCANS)


def test_the_others_begin_each_kernel_once_from_the_last_on_and_the_leg_waits_for_what_it_contains():
    leg = compile_beside.HAS_IT_WITHIN
    assert leg in json.loads(compile_beside.KERNELS.read_text())
    for heard, order in ((0, ["b:b", "a:a", leg]), (1, ["b:b", leg, "a:a"])):
        begun = mmap(-1, 4)
        begun[3] = heard
        assert [compile_beside._next(["a:a", leg, "b:b"], begun) for _ in range(4)] == [*order, None]
