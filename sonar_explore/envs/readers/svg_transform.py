"""The `transform` attributes of SVG as matrices, shape (3, 3)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np

from sonar_explore.geometry import Array

_TRANSFORM = re.compile(r"[\s,]*(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^()]*)\)[\s,]*")


def parse_transform(text: str) -> Array:
    """The matrix (3, 3) of a `transform` attribute."""
    matrix, at = np.eye(3), 0
    while at < len(text):
        match = _TRANSFORM.match(text, at)
        if match is None:
            if not text[at:].strip(" ,\t\r\n"):
                break
            raise ValueError(f"no transform: {text[at : at + 40]!r}")
        at = match.end()
        try:
            numbers = [float(n) for n in re.split(r"[\s,]+", match.group(2).strip())]
            matrix = matrix @ _MATRICES[match.group(1)](*numbers)
        except (ValueError, TypeError):
            raise ValueError(f"no transform: {match.group()[:40]!r}") from None
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 1e9:
        raise ValueError(f"a transform out of all measure: {text[:40]!r}")
    return matrix


def _matrix(a: float, b: float, c: float, d: float, e: float, f: float) -> Array:
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


def translation(x: float, y: float = 0.0) -> Array:
    """A shift by x and y."""
    return _matrix(1, 0, 0, 1, x, y)


def _scale(x: float, y: float | None = None) -> Array:
    return _matrix(x, 0, 0, x if y is None else y, 0, 0)


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Array:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(translation(x, y) @ _matrix(c, s, -s, c, 0, 0) @ translation(-x, -y))


_MATRICES: dict[str, Callable[..., Array]] = {
    "matrix": _matrix,
    "translate": translation,
    "scale": _scale,
    "rotate": _rotation,
    "skewX": lambda degrees: _matrix(1, 0, math.tan(math.radians(degrees)), 1, 0, 0),
    "skewY": lambda degrees: _matrix(1, math.tan(math.radians(degrees)), 0, 1, 0, 0),
}
