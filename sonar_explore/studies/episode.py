"""Run one job: what a worker process does."""

from __future__ import annotations

import gc
import signal
import time
import traceback
from pathlib import Path

from sonar_explore import __version__
from sonar_explore.cores import COLLECT_EVERY
from sonar_explore.episodes.record import EpisodeRecord, StepRecord
from sonar_explore.episodes.run import run_episode
from sonar_explore.studies.jobs import Job, Outcome
from sonar_explore.studies.store import record_path, report_path, save_outcome, save_record_packed


def begin_work() -> None:
    """In a worker process: Ctrl-C is the parent's to handle, it lets the episodes under way finish; garbage is looked
    for as seldom as by the command."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(COLLECT_EVERY)


def run_job(job: Job, folder: Path, keep_record: bool, fingerprint: str) -> Outcome:
    """Run the episode and write what it leaves; the outcome's file comes last and says that all is there.

    An exception is an outcome too: a study of a thousand episodes must not end at one. The fingerprint is the parent's,
    taken when the study began: files that change meanwhile are not what runs.
    """
    path = folder / job.path
    path.parent.mkdir(parents=True, exist_ok=True)
    summary, error = None, None
    clock = _Clock()
    try:
        record = _run(job, clock)
        summary = record.summary
        if keep_record:
            _keep(record, path)
    except Exception as raised:
        error = one_line(raised)
    laps = tuple(clock.laps)
    outcome = Outcome(job.world, job.variant.name, job.seed, fingerprint, __version__, summary, error, laps)
    save_outcome(outcome, path)
    return outcome


def _run(job: Job, clock: _Clock) -> EpisodeRecord:
    return run_episode(
        job.world, slam=job.variant.slam, noise=None, seed=job.seed, config=job.config, on_step=clock
    )


class _Clock:
    """Notes the processor time of each step of an episode, [s]."""

    def __init__(self) -> None:
        self.laps: list[float] = []
        self._last = time.process_time()

    def __call__(self, _: StepRecord) -> None:
        now = time.process_time()
        self.laps.append(round(now - self._last, 4))
        self._last = now


def _keep(record: EpisodeRecord, path: Path) -> None:
    from sonar_explore.reports.episode import write_packed_report

    save_record_packed(record, record_path(path))
    write_packed_report(record, report_path(path))


def one_line(error: Exception) -> str:
    """Type, message and place."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return " ".join(f"{type(error).__name__}: {error}{place}".split())
