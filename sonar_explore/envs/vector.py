"""Many environments at once: a few worker processes, each of which steps several of them one after the other.

Results are those of gymnasium's `SyncVectorEnv` with the same seeds and actions, byte for byte: that is what every
worker runs on its share.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import pickle
import signal
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import (
    CloudpickleWrapper,
    batch_space,
    create_shared_memory,
    read_from_shared_memory,
)
from numpy.typing import NDArray

from sonar_explore.cores import usable_cores
from sonar_explore.errors import SonarExploreError

Batch = dict[str, NDArray[Any]]
Info = dict[str, Any]

_LOOK_AFTER_PARENT_S = 1.0


class WorkersVectorEnv(VectorEnv[Batch, NDArray[Any], NDArray[Any]]):
    """Environments in a few processes, by default one for each usable core.

    `env_fns`: what makes each environment; observations are flat `Dict`s, all alike. `workers`: how many processes.
    `copy`: hand out fresh observations at each call, not those that the next call overwrites. `context`: how
    processes are started, as in `multiprocessing`. `autoreset_mode`: as in gymnasium's own vector environments.

    An error in an environment is raised here, with where it came from as a note, once all workers have answered;
    environments behind it in its worker were not stepped. The worker lives on.
    """

    def __init__(
        self,
        env_fns: Sequence[Callable[[], gym.Env[Any, Any]]],
        workers: int | None = None,
        copy: bool = True,
        context: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        self._workers: list[_Worker] = []
        workers = usable_cores() if workers is None else workers
        if workers < 1 or not env_fns:
            raise SonarExploreError(f"{len(env_fns)} environments in {workers} workers; at least one of each")
        autoreset_mode = AutoresetMode(autoreset_mode)
        first = env_fns[0]()
        self.num_envs = len(env_fns)
        self.metadata = {**first.metadata, "autoreset_mode": autoreset_mode}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        first.close()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._copy = copy
        processes: Any = multiprocessing.get_context(context)
        memory = create_shared_memory(self.single_observation_space, self.num_envs, processes)
        self._shared: Any = read_from_shared_memory(self.single_observation_space, memory, self.num_envs)
        ends = np.linspace(0, self.num_envs, min(workers, self.num_envs) + 1).round().astype(int)
        for begin, end in pairwise(ends):
            share = slice(int(begin), int(end))
            here, there = processes.Pipe()
            process = processes.Process(
                target=_work,
                name=f"environments-{share.start}-{share.stop - 1}",
                args=(
                    there,
                    [CloudpickleWrapper(make) for make in env_fns[share]],
                    autoreset_mode,
                    share,
                    memory,
                    self.num_envs,
                ),
                daemon=True,
            )
            process.start()
            there.close()
            self._workers.append(_Worker(process, here, share))
        spaces = (self.single_observation_space, self.single_action_space)
        if any(answer != spaces for answer in self._answers(self._workers)):
            raise RuntimeError("all environments need the same spaces")

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Batch, Info]:
        """Reset all environments, or those of `options["reset_mask"]`; an int seed counts on from the first."""
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        mask = _reset_mask(options, self.num_envs)
        asked = [w for w in self._workers if mask is None or mask[w.share].any()]
        for worker in asked:
            mine = options if mask is None else {**(options or {}), "reset_mask": mask[worker.share]}
            self._ask(worker, "reset", seed=seeds[worker.share], options=mine)
        infos: Info = {}

        def take(share: slice, told: list[tuple[int, Info]]) -> None:
            """What a worker tells of its environments."""
            self._put_together(infos, share, told)

        self._answers(asked, take)
        return {k: rows.copy() for k, rows in self._shared.items()} if self._copy else self._shared, infos

    def step(self, actions: NDArray[Any]) -> tuple[Batch, NDArray[Any], NDArray[Any], NDArray[Any], Info]:
        """One action for each environment, shape (num_envs, ...)."""
        if len(actions) != self.num_envs:
            raise ValueError(f"{len(actions)} actions for {self.num_envs} environments")
        for worker in self._workers:
            self._ask(worker, "step", actions[worker.share])
        observations: Batch = (
            {k: np.empty_like(v) for k, v in self._shared.items()} if self._copy else self._shared
        )
        rewards = np.zeros(self.num_envs)
        terminations, truncations = np.zeros((2, self.num_envs), dtype=bool)
        infos: Info = {}

        def take(share: slice, answer: Any) -> None:
            """What a worker's environments came to."""
            rewards[share], terminations[share], truncations[share], told = answer
            self._put_together(infos, share, told)
            if self._copy:
                for key, rows in observations.items():
                    rows[share] = self._shared[key][share]

        self._answers(self._workers, take)
        return observations, rewards, terminations, truncations, infos

    def render(self) -> tuple[Any, ...]:
        """What each environment shows."""
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each environment, or get an attribute."""
        for worker in self._workers:
            self._ask(worker, "call", name, *args, **kwargs)
        return tuple(result for answer in self._answers(self._workers) for result in answer)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment: to its own of a list or tuple, or all to one value."""
        each = list(values) if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"{len(each)} values for {self.num_envs} environments")
        for worker in self._workers:
            self._ask(worker, "set_attr", name, each[worker.share])
        self._answers(self._workers)

    @property  # type: ignore[misc] # gymnasium's own can be set, those of its vector environments cannot either
    def np_random(self) -> Any:
        """Each environment's generator, as it stands now."""
        return self.get_attr("np_random")

    @property
    def np_random_seed(self) -> Any:
        """Each environment's seed."""
        return self.get_attr("np_random_seed")

    def close_extras(self, timeout: float | None = 10.0, terminate: bool = False) -> None:
        """Let the workers close their environments and end; those that take longer are ended."""
        for worker in self._workers:
            with contextlib.suppress(OSError):
                worker.pipe.send(None)
            worker.pipe.close()
        for worker in self._workers:
            worker.process.join(0.0 if terminate else timeout)
            worker.process.terminate()
            worker.process.join()

    def __del__(self) -> None:
        with contextlib.suppress(Exception):  # the interpreter may be on its way out
            self.close(terminate=True)

    def _ask(self, worker: _Worker, method: str, /, *args: Any, **kwargs: Any) -> None:
        if self.closed:
            raise ClosedEnvironmentError(f"{method} after close")
        worker.ask(method, args, kwargs)

    def _put_together(self, infos: Info, share: slice, told: list[tuple[int, Info]]) -> None:
        for i, info in told:
            self._add_info(infos, info, share.start + i)

    def _answers(
        self, workers: list[_Worker], take: Callable[[slice, Any], None] = lambda share, answer: None
    ) -> list[Any]:
        """Of all of them, each taken while later ones still work; or the first error, once all have answered."""
        answers, errors = [], []
        for worker in workers:
            answer = worker.answer()
            if isinstance(answer, Exception):
                errors.append(answer)
            else:
                answers.append(answer)
                take(worker.share, answer)
        if errors:
            raise errors[0]
        return answers


class _Worker:
    """A worker as the parent sees it; `share`: which environments it steps."""

    def __init__(self, process: BaseProcess, pipe: Connection, share: slice) -> None:
        self.process, self.pipe, self.share = process, pipe, share
        self._owed = 1  # the spaces of its environments, once they are made

    def ask(self, method: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        """Have the environments do something; what an interrupted call did not wait for is passed over."""
        while self._owed:
            self.answer()
        with contextlib.suppress(OSError):  # a worker that is gone says so where its answer is waited for
            self.pipe.send((method, args, kwargs))
        self._owed = 1

    def answer(self) -> Any:
        """What it was asked for, or the exception."""
        try:
            answer = self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            answer = SonarExploreError(
                f"the worker of environments {self.share.start} to {self.share.stop - 1} ended "
                f"(exit code {self.process.exitcode})"
            )
        self._owed = 0
        return answer


class _Share(SyncVectorEnv):
    """A worker's environments; what each has to tell is left for the parent to put together, in its order."""

    def _add_info(self, vector_infos: Info, env_info: Info, env_num: int) -> Info:
        vector_infos.setdefault("told", []).append((env_num, env_info))
        return vector_infos


def _work(
    pipe: Connection,
    env_fns: Sequence[Callable[[], gym.Env[Any, Any]]],
    autoreset_mode: AutoresetMode,
    share: slice,
    memory: Any,
    num_envs: int,
) -> None:
    """A worker's life: make its environments, then do as it is asked until the pipe or the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    gc.freeze()  # what is here by now stays: not to be looked through time and again, nor closed with the parent's
    parent = multiprocessing.parent_process()
    try:
        envs = _Share(env_fns, copy=False, autoreset_mode=autoreset_mode)
    except Exception as error:
        pipe.send(_portable(error))
        return
    shared = read_from_shared_memory(envs.single_observation_space, memory, num_envs)
    pipe.send((envs.single_observation_space, envs.single_action_space))
    with contextlib.closing(envs), contextlib.suppress(EOFError, OSError):
        while True:
            while not pipe.poll(_LOOK_AFTER_PARENT_S):
                if parent is None or not parent.is_alive():
                    return
            request = pipe.recv()
            if request is None:
                return
            method, args, kwargs = request
            try:
                answer = getattr(envs, method)(*args, **kwargs)
                if method in ("reset", "step"):
                    observations, *rest, infos = answer
                    for key, rows in observations.items():
                        shared[key][share] = rows
                    answer = (*rest, infos["told"]) if rest else infos["told"]
                pipe.send(answer)
            except Exception as error:
                pipe.send(_portable(error))


def _portable(error: Exception) -> Exception:
    """The same with where it was raised as a note; another where it cannot be sent."""
    where = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(f"in a worker:\n{where}")
    return error


def _reset_mask(options: dict[str, Any] | None, num_envs: int) -> NDArray[np.bool_] | None:
    if options is None or "reset_mask" not in options:
        return None
    mask = options["reset_mask"]
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        raise TypeError(f"options['reset_mask'] is {mask!r}, no array of booleans")
    if mask.shape != (num_envs,) or not mask.any():
        raise ValueError(
            f"options['reset_mask'] is {mask}, not one boolean for each of {num_envs}, one of them True"
        )
    return mask


def exploration(
    num_envs: int = 1,
    workers: int | None = None,
    copy: bool = True,
    context: str | None = None,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    **kwargs: Any,
) -> WorkersVectorEnv:
    """`gymnasium.make_vec("sonar_explore/Exploration-v0", num_envs=16)`; further arguments are the environment's."""
    make = partial(gym.make, "sonar_explore:sonar_explore/Exploration-v0", **kwargs)
    return WorkersVectorEnv([make] * num_envs, workers, copy, context, autoreset_mode)
