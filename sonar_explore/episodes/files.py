"""Save and load `episode.json`: a file is there whole or not at all, one record gives one string of bytes."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

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
    try:
        record = msgspec.json.decode(content, type=EpisodeRecord)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise SonarExploreError(
            f"{path} is not an episode record{_other_version(content)}: {error}"
        ) from error
    if not record.steps:
        raise SonarExploreError(f"{path} is an episode without a scan; every run has one at least")
    return record


class _Version(msgspec.Struct):
    version: str


def _other_version(content: bytes) -> str:
    """What to say of a record that another version wrote."""
    with contextlib.suppress(msgspec.DecodeError, UnicodeDecodeError):
        wrote = msgspec.json.decode(content, type=_Version).version
        if wrote != __version__:
            return f" of version {__version__} but of {wrote}; run the episode again"
    return ""


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
