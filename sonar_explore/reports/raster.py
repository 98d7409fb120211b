"""The occupancy grid as a tiny indexed PNG, so that it can stand inside the page."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np

from sonar_explore.episodes.record import GridRecord
from sonar_explore.errors import SonarExploreError

# unknown, free, occupied: red, green, blue each
PALETTE = bytes((0, 0, 0, 120, 150, 185, 70, 75, 85))
SOLID = bytes((255, 255, 255, 232, 237, 243, 188, 190, 194))


def grid_states(grid: GridRecord) -> np.ndarray:
    """States as uint8, shape (rows, columns), row 0 the lowest y."""
    try:
        raw = zlib.decompress(base64.b64decode(grid.states, validate=True))
        states = np.frombuffer(raw, np.uint8).reshape(grid.shape)
    except (ValueError, zlib.error) as error:
        raise SonarExploreError(f"the record's grid cannot be unpacked: {error}") from error
    return np.minimum(states, 2)


def grid_png(grid: GridRecord, opacity: bytes | None = None) -> str:
    """A `data:` address of the grid, highest y first as pictures have it.

    Args:
        opacity: of each state, 0 to 255: the page shows through; None for solid shades, which cover what is below.
    """
    rows = grid_states(grid)[::-1]
    height, width = rows.shape
    lines = b"".join(b"\0" + row.tobytes() for row in rows)
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        _chunk(*part)
        for part in (
            (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
            (b"PLTE", SOLID if opacity is None else PALETTE),
            *([] if opacity is None else [(b"tRNS", opacity)]),
            (b"IDAT", zlib.compress(lines, 9)),
            (b"IEND", b""),
        )
    )
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
