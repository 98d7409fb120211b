"""Save and load `episode.json`: a file is there whole or not at all, one record gives one string of bytes."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec

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


def refuse_unwritable(*files: Path) -> None:
    """Refuse files that could not be written, before the work starts and before any of them is."""
    for file in files:
        try:
            if file.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            tempfile.TemporaryFile(dir=file.parent).close()
        except OSError as error:
            raise SonarExploreError(f"cannot write {file}: {error.strerror}") from error


def save_record(record: EpisodeRecord, path: Path) -> None:
    """Write the record as JSON, keys in the order of the fields."""
    write_atomically(path, msgspec.json.encode(record))


def load_record(path: Path) -> EpisodeRecord:
    """Read a record back; raises `SonarExploreError` with one line for a file that is none."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SonarExploreError(f"cannot read {path}: {error.strerror}") from error
    try:
        return msgspec.json.decode(content, type=EpisodeRecord)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SonarExploreError(f"{path} is not an episode record: {error}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
