"""A study's folder: one small file for each finished episode, so that a study can be stopped and taken up again.

Beside the outcome (1 kB) a study may keep the whole record as `.json.gz` (50 to 180 kB) and the episode's page
packed into a page that unpacks itself (80 to 240 kB): 1000 episodes of the paper's worlds take about 260 MB.
"""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import msgspec

from sonar_explore.episodes.files import decode_record, write_atomically
from sonar_explore.episodes.record import EpisodeRecord
from sonar_explore.errors import SonarExploreError
from sonar_explore.studies.jobs import Job, Outcome


def record_path(outcome_path: Path) -> Path:
    """Where the whole record of an episode lies."""
    return outcome_path.with_suffix(".record.json.gz")


def report_path(outcome_path: Path) -> Path:
    """Where the page of an episode lies."""
    return outcome_path.with_suffix(".html")


def load_outcome(path: Path) -> Outcome | None:
    """None where there is none, or none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Outcome)
    except (OSError, msgspec.DecodeError):
        return None


def save_outcome(outcome: Outcome, path: Path) -> None:
    """Whole or not at all."""
    write_atomically(path, msgspec.json.encode(outcome))


def save_record_packed(record: EpisodeRecord, path: Path) -> None:
    """The record as `.json.gz`; the same record gives the same bytes."""
    write_atomically(path, gzip.compress(msgspec.json.encode(record), 6, mtime=0))


def load_record_packed(path: Path) -> EpisodeRecord:
    """A record kept by `save_record_packed`."""
    try:
        content = gzip.decompress(path.read_bytes())
    except (OSError, EOFError, zlib.error) as error:
        raise SonarExploreError(f"{path} is not a packed episode record: {error}") from error
    return decode_record(content, path)


def finished(job: Job, folder: Path, *, with_record: bool) -> tuple[Outcome | None, bool]:
    """(the outcome if it is there, whether this code and configuration made it)"""
    path = folder / job.path
    outcome = load_outcome(path)
    if outcome is None or (with_record and outcome.summary and not record_path(path).exists()):
        return None, False
    return outcome, outcome.fingerprint == job.fingerprint
