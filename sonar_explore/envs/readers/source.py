"""What every reader begins with: the bytes of a file, and what its caller says that the file leaves open."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Pose

MAX_FILE_BYTES = 64 * 2**20


@dataclass(frozen=True)
class ReadOptions:
    """What a caller may say about a file that the file leaves open."""

    start: Pose | None = None
    """`pose_robot_in_world`; None takes the file's own, or the roomiest place."""
    resolution_m: float | None = None
    """Metres per pixel of an image, or per user unit of an SVG."""


def why_undecoded(error: Exception, kind: str) -> str:
    """What a decoder objects to, in one line: the text, that it is none of this kind, or what it says.

    >>> why_undecoded(UnicodeDecodeError("utf-8", b"\\xff", 0, 1, "invalid start byte"), "TOML")
    'no TOML, for it is no text in UTF-8: invalid start byte (at byte 1)'
    """
    if isinstance(error, UnicodeDecodeError):
        return f"no {kind}, for it is no text in UTF-8: {error.reason} (at byte {error.start + 1})"
    said = " ".join(str(error).split())
    return said if isinstance(error, msgspec.ValidationError) else f"no {kind}: {said}"


def read_bytes(path: Path, limit: int = MAX_FILE_BYTES) -> bytes:
    """The bytes of a world file; the errors of the file system in one line."""
    try:
        if path.exists() and not path.is_file():
            raise SonarExploreError(f"cannot read the world file {str(path)!r}: it is no plain file")
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except FileNotFoundError:
        raise SonarExploreError(f"no world file {str(path)!r}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SonarExploreError(f"cannot read the world file {str(path)!r}: {reason}") from None
    if len(data) > limit:
        raise SonarExploreError(f"{path.name}: the file is larger than {limit / 2**20:g} MiB")
    if not data.strip():
        raise SonarExploreError(f"{path.name}: the world file is empty")
    return data
