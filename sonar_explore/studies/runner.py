"""Run the jobs of a study that are not done yet, in parallel processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.episode import begin_work, run_job
from sonar_explore.studies.jobs import Job, Outcome
from sonar_explore.studies.store import finished

T = TypeVar("T")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""A worker is one process on one core: libraries that start threads of their own are told so."""


@dataclass(frozen=True)
class Plan:
    """What is there, and what is left to do."""

    done: tuple[Outcome, ...]
    left: tuple[Job, ...]
    outdated: int
    """Episodes in the folder that other code or another configuration made; they are among `left`."""


def plan(jobs: Sequence[Job], folder: Path, *, with_record: bool) -> Plan:
    """Look into the folder."""
    found = [(job, *finished(job, folder, with_record=with_record)) for job in jobs]
    return Plan(
        done=tuple(outcome for _, outcome, current in found if outcome and current),
        left=tuple(job for job, _, current in found if not current),
        outdated=sum(outcome is not None and not current for _, outcome, current in found),
    )


def run_jobs(
    jobs: Sequence[Job],
    folder: Path,
    *,
    processes: int,
    keep_record: bool,
    on_done: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Run them all; Ctrl-C lets the episodes under way finish, and leaves what is done."""
    calls = [(job, folder, keep_record, job.fingerprint) for job in jobs]
    return in_processes(run_job, calls, processes=processes, on_done=on_done)


def in_processes(
    work: Callable[..., T],
    calls: Sequence[tuple[Any, ...]],
    *,
    processes: int,
    on_done: Callable[[T], None] = lambda result: None,
) -> list[T]:
    """What `work` returns for the arguments of each call, in the order in which they finish.

    Raises:
        SonarExploreError: where a worker process died, out of memory for example; run again to go on.
    """
    if not calls:
        return []
    if processes == 1:
        return [_told(work(*call), on_done) for call in calls]
    with _single_threaded(), _pool(min(processes, len(calls))) as pool:
        futures = [pool.submit(work, *call) for call in calls]
        try:
            return [_told(_result(future), on_done) for future in as_completed(futures)]
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _result(future: Future[T]) -> T:
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise SonarExploreError("a worker process died; what is done is kept: run again to go on") from error


def _told(result: T, on_done: Callable[[T], None]) -> T:
    on_done(result)
    return result


def _pool(processes: int) -> ProcessPoolExecutor:
    # spawn: no lock of the parent's threads is inherited, and the threads' variables are read anew
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=begin_work)


@contextmanager
def _single_threaded() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
