"""Environments in workers are what gymnasium's SyncVectorEnv makes of them."""

import gc
import multiprocessing
import os
import subprocess
import sys
import time
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import sonar_explore  # noqa: F401 - registers the ids
from sonar_explore.envs.vector import WorkersVectorEnv
from sonar_explore.errors import SonarExploreError

ID = "sonar_explore/Exploration-v0"
pytestmark = pytest.mark.filterwarnings("error")


class Counter(gym.Env):
    """Counts its steps; wrong where the action is 1, gone where it is 2."""

    observation_space = gym.spaces.Dict({"count": gym.spaces.Box(0, 100, (1,), np.float32)})
    action_space = gym.spaces.Discrete(3)
    metadata = {"render_modes": ["ansi"], "render_fps": 1}  # noqa: RUF012 - as in the base class
    render_mode = "ansi"
    label = "none"

    def __init__(self, length=3):
        self.length = length

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(50))
        self.count = (options or {}).get("from", drawn)
        self.left = self.length
        return {"count": np.array([self.count], np.float32)}, self.told_besides()

    def step(self, action):
        if action == 1:
            raise SonarExploreError("one is wrong")
        if action == 2:
            os._exit(3)
        self.count += 1
        self.left -= 1
        return {"count": np.array([self.count], np.float32)}, 0.5, self.left == 0, False, self.told_besides()

    def told_besides(self):
        """Of changing keys and types: what the first of them is decides about the batch."""
        number = self.count if self.left % 2 else self.count + 0.5
        known = {
            "number": number,
            "row": np.arange(2.0),
            "text": str(number),
            "inside": {"left": self.left, "flag": True},
        }
        return {key: known[key] for key in list(known)[self.count % 4 :]}

    def pid(self):
        return os.getpid()

    def render(self):
        return f"{self.label} {self.count}"

    def told(self, *args, **kwargs):
        return args, kwargs

    def unsendable(self):
        return lambda: None


@pytest.fixture
def counters():
    envs = WorkersVectorEnv([Counter] * 5, workers=2)
    yield envs
    envs.close()


def same(a, b) -> None:
    """Equal to the byte: types, order of keys, dtypes, values."""
    assert type(a) is type(b)
    if isinstance(a, dict):
        assert list(a) == list(b)
        for key in a:
            same(a[key], b[key])
    elif isinstance(a, np.ndarray) and a.dtype == object:
        for one, other in zip(a, b, strict=True):
            same(one, other)
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    elif isinstance(a, list | tuple):
        for one, other in zip(a, b, strict=True):
            same(one, other)
    else:
        assert a == b


def decisions(envs: Any, steps: int) -> list:
    """What is seen with random decisions that the masks allow, the same in both."""
    rng = np.random.default_rng(2)
    seen: list[tuple] = [envs.reset(seed=7)]
    for _ in range(steps):
        masks = seen[-1][0]["action_mask"]
        seen.append(envs.step(np.array([rng.choice(np.flatnonzero(mask)) for mask in masks])))
    seen.append(envs.reset(seed=[5, None, 3]))
    seen.append((envs.render(), envs.call("action_masks"), envs.np_random_seed, envs.get_attr("end_reason")))
    envs.close()
    return seen


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_two_workers_give_what_one_process_gives_through_ends_and_new_beginnings(mode):
    args = {"world": "paper/corridor", "max_scans": 3, "render_mode": "ansi"}
    alone = gym.make_vec(ID, 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **args)
    shared = gym.make_vec(ID, 3, workers=2, autoreset_mode=mode, **args)
    assert isinstance(shared, WorkersVectorEnv) and shared.metadata == alone.metadata
    assert (shared.observation_space, shared.action_space) == (alone.observation_space, alone.action_space)
    expected = decisions(alone, 4)
    assert any(step[3].any() for step in expected[1:-2])
    same(decisions(shared, 4), expected)


@pytest.mark.parametrize("workers", [1, 2, 3, 9])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_any_number_of_workers_gives_the_same(workers, mode):
    def history(envs: Any) -> list:
        mask = np.array([False, False, True, True, False])
        seen: list = [envs.reset(seed=3)]
        for _ in range(6 if mode != AutoresetMode.DISABLED else 1):
            seen.append(envs.step(np.zeros(5, dtype=np.int64)))
        seen.append(envs.reset(options={"reset_mask": mask}))
        seen.append(envs.reset(seed=[9, 8, 7, 6, 5], options={"from": 20, "reset_mask": ~mask}))
        seen.append(envs.reset(options={"from": 30}))
        envs.set_attr("label", list("abcde"))
        seen.append(envs.render())
        envs.set_attr("label", "one for all")
        seen.append((envs.render(), envs.call("told", 1, more=2), envs.np_random_seed))
        envs.close()
        return seen

    envs = [partial(Counter, length) for length in (3, 2, 5, 4, 2)]
    same(
        history(WorkersVectorEnv(envs, workers, autoreset_mode=mode)),
        history(SyncVectorEnv(envs, autoreset_mode=mode)),
    )


def test_a_worker_steps_several_environments_and_there_are_no_more_than_environments(counters):
    pids = counters.call("pid")
    assert len(set(pids)) == 2 and os.getpid() not in pids
    many = WorkersVectorEnv([Counter] * 2, workers=5)
    assert len(set(many.call("pid"))) == 2
    many.close()


def test_what_is_handed_out_stays_as_it_is_unless_no_copy_is_wanted(counters):
    before, _ = counters.reset(seed=0)
    kept = before["count"].copy()
    after, *_ = counters.step([0] * 5)
    np.testing.assert_array_equal(before["count"], kept)
    np.testing.assert_array_equal(after["count"], kept + 1)
    bare = WorkersVectorEnv([Counter] * 3, workers=2, copy=False)
    first, _ = bare.reset(seed=0)
    assert bare.step([0] * 3)[0]["count"] is first["count"]
    bare.close()


def test_an_error_in_an_environment_is_raised_here_and_the_workers_live_on(counters):
    counters.reset(seed=0)
    with pytest.raises(SonarExploreError, match="one is wrong") as raised:
        counters.step([0, 0, 0, 0, 1])
    assert "in step" in "".join(raised.value.__notes__)
    with pytest.raises(Exception, match="pickle"):
        counters.call("unsendable")
    with pytest.raises(AttributeError):
        counters.get_attr("nothing_of_this_name")
    same(counters.reset(seed=1)[0], SyncVectorEnv([Counter] * 5).reset(seed=1)[0])


def test_a_worker_that_dies_is_named_and_the_rest_can_be_closed(counters):
    counters.reset(seed=0)
    for _ in range(2):
        with pytest.raises(SonarExploreError, match=r"environments 2 to 4 ended \(exit code 3\)"):
            counters.step([0, 0, 2, 0, 0])
    counters.close()
    assert not any(worker.process.is_alive() for worker in counters._workers)


def test_an_interrupted_call_leaves_nothing_behind_for_the_next(counters):
    counters.reset(seed=0)
    for worker in counters._workers:
        counters._ask(worker, "render")
    same(counters.reset(seed=1)[0], SyncVectorEnv([Counter] * 5).reset(seed=1)[0])


def test_workers_end_where_nobody_holds_their_environments_any_more():
    others = _working()  # of environments that other tests still hold
    envs = WorkersVectorEnv([Counter] * 2, workers=2)
    assert len(_working() - others) == 2
    del envs
    assert not _working() - others


def _working() -> set[int | None]:
    return {child.pid for child in multiprocessing.active_children() if child.name.startswith("environments")}


def test_after_close_there_is_nothing_to_ask(counters):
    counters.close()
    counters.close()
    for call in (counters.reset, lambda: counters.step([0] * 5), counters.render):
        with pytest.raises(ClosedEnvironmentError):
            call()


def test_workers_end_with_the_process_that_started_them():
    script = (
        "import os, test_vector as t\n"
        "if __name__ == '__main__':\n"
        "    envs = t.WorkersVectorEnv([t.Counter] * 2, workers=2)\n"
        "    print(*envs.call('pid'), flush=True)\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], cwd=os.path.dirname(__file__), capture_output=True, text=True
    )
    workers = [int(pid) for pid in run.stdout.split()]
    assert len(workers) == 2, run.stderr
    for _ in range(100):
        if not any(_alive(pid) for pid in workers):
            return
        time.sleep(0.1)
    raise AssertionError(f"{workers} still run")


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as stat:
        return " Z " not in stat.read()


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda envs: envs.step([0] * 4), "4 actions for 5"),
        (lambda envs: envs.reset(seed=[1, 2]), "2 seeds for 5"),
        (lambda envs: envs.set_attr("label", ["a"]), "1 values for 5"),
        (lambda envs: envs.reset(options={"reset_mask": np.zeros(5, bool)}), "one of them True"),
        (lambda envs: envs.reset(options={"reset_mask": np.ones(3, bool)}), "each of 5"),
    ],
)
def test_what_does_not_fit_the_number_of_environments_is_refused(counters, call, error):
    with pytest.raises(ValueError, match=error):
        call(counters)


def test_environments_of_different_spaces_and_none_at_all_are_refused():
    class Other(Counter):
        action_space = gym.spaces.Discrete(4)

    others = _working()
    for envs in ([Counter, Other], [Counter, Counter, Counter, Other]):
        with pytest.raises(RuntimeError):
            WorkersVectorEnv(envs, workers=2)
        gc.collect()
        assert not _working() - others
    for envs, workers in (([], 2), ([Counter], 0)):
        with pytest.raises(SonarExploreError, match="at least one of each"):
            WorkersVectorEnv(envs, workers)


def test_workers_can_be_started_afresh_instead_of_forked():
    make = partial(gym.make, "sonar_explore:sonar_explore/AmigoBot-v0", world="paper/corridor")
    seen = []
    for envs in (WorkersVectorEnv([make] * 2, 1, context="spawn"), SyncVectorEnv([make] * 2)):
        seen.append([envs.reset(seed=4), envs.step(np.zeros((2, 2), np.float32))])
        envs.close()
    same(*seen)
