"""Save and load `episode.json`: a file is there whole or not at all, one record gives one string of bytes."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from sonar_explore import __version__
from sonar_explore.episodes.record import EpisodeRecord
from sonar_explore.errors import SonarExploreError


def write_atomically(path: Path, content: bytes) -> None:
    """Write beside `path` and rename onto it, so that no reader ever meets half a file."""
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise SonarExploreError(f"cannot write {path}: {error.strerror}") from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(temporary, 0o666 & ~_umask())  # mkstemp's 0600 would hide a report from everyone else
        os.replace(temporary, path)
    except BaseException as error:
        os.unlink(temporary)
        if isinstance(error, OSError):
            raise SonarExploreError(f"cannot write {path}: {error.strerror}") from error
        raise


@contextlib.contextmanager
def writable_folder(folder: Path) -> Iterator[None]:
    """Make sure that files can be written into `folder` before the work starts; undo it if the work fails."""
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise SonarExploreError(f"cannot write into {folder}: {error.strerror}") from error
        yield
    except BaseException:
        for path in missing:
            with contextlib.suppress(OSError):  # not there, or no longer empty
                path.rmdir()
        raise


@contextlib.contextmanager
def writable_files(*files: Path) -> Iterator[None]:
    """The same for files: their folders are made, and a file that cannot be written is refused before any is."""
    with contextlib.ExitStack() as folders:
        for file in files:
            if file.is_dir():
                raise SonarExploreError(f"cannot write {file}: {os.strerror(errno.EISDIR)}")
            folders.enter_context(writable_folder(file.parent))
        yield


def save_record(record: EpisodeRecord, path: Path) -> None:
    """Write the record as JSON, keys in the order of the fields."""
    write_atomically(path, msgspec.json.encode(record))


def load_record(path: Path) -> EpisodeRecord:
    """Read a record back; raises `SonarExploreError` with one line for a file that is none."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SonarExploreError(f"cannot read {path}: {error.strerror}") from error
    return decode_record(content, path)


def decode_record(content: bytes, path: Path) -> EpisodeRecord:
    """The record in the bytes of a file; one line says whether it is none, or one that is no longer read."""
    try:
        record = msgspec.json.decode(content, type=EpisodeRecord)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SonarExploreError(_why_no_record(content, path, error)) from error
    if not record.steps:
        raise SonarExploreError(f"{path} is an episode without a scan; every run has one at least")
    return record


class _AnyRecord(msgspec.Struct):
    """What records of all versions have."""

    version: str
    world: dict[str, Any]
    steps: list[Any]


def _why_no_record(content: bytes, path: Path, error: Exception) -> str:
    try:
        wrote = msgspec.json.decode(content, type=_AnyRecord).version
    except (msgspec.DecodeError, UnicodeDecodeError):
        return f"{path} is not an episode record: {error}"
    by = "an older state of the code, or changed by hand" if wrote == __version__ else f"version {wrote}"
    return f"{path} was written by {by}; {__version__} cannot read it ({error}); run the episode again"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
