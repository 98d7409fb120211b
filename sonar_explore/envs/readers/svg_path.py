"""The path data of an SVG, its `d` attribute, as straight and curved pieces; and curves as few straight ones.

Every piece is a Bezier curve of 2, 3 or 4 control points, arcs too: so an affine transform of the control
points transforms the drawing, and only afterwards, in metres, is a curve made straight.
"""

from __future__ import annotations

import itertools
import math
import re

import numpy as np

from sonar_explore.geometry import Array

FLATNESS_M = 0.01
"""How far a straight piece may lie from its curve, [m]."""
MAX_PIECES_OF_CURVE = 64
_LARGEST = 1e9

_SEPARATORS = re.compile(r"[\s,]*")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

Point = tuple[float, float]
Curve = list[Point]
"""2 (straight), 3 or 4 control points."""


class PathSyntaxError(ValueError):
    """What is wrong with the path data, in a few words."""


class _Scanner:
    """Reads path data from left to right, letter by letter and number by number."""

    def __init__(self, data: str) -> None:
        self._data, self._at = data, 0

    def more(self) -> bool:
        """Whether anything but separators is left."""
        self._at = self._skip()
        return self._at < len(self._data)

    def command(self) -> str | None:
        """The letter here, None where there is a number: the last command goes on."""
        letter = self._data[self._at]
        if not letter.isalpha():
            return None
        self._at += 1
        if letter not in "MmLlHhVvCcSsQqTtAaZz":
            raise PathSyntaxError(f"unknown path command {letter!r}")
        return letter

    def number(self) -> float:
        """The next number, in the path's own units or, of an arc's turn, [deg]."""
        match = _NUMBER.match(self._data, self._skip())
        if match is None:
            raise PathSyntaxError(f"expected a number at {self._data[self._at : self._at + 12]!r}")
        self._at = match.end()
        value = float(match.group())
        if abs(value) > _LARGEST:
            raise PathSyntaxError(f"number {match.group()[:12]} is too large")
        return value

    def flag(self) -> bool:
        """0 or 1; editors write two flags and a number without spaces."""
        self._at = self._skip() + 1
        digit = self._data[self._at - 1 : self._at]
        if digit not in ("0", "1"):
            raise PathSyntaxError(f"expected the flag of an arc, 0 or 1, got {digit!r}")
        return digit == "1"

    def _skip(self) -> int:
        match = _SEPARATORS.match(self._data, self._at)
        return match.end() if match else self._at


def parse_path(data: str) -> list[list[Curve]]:
    """The pieces of each subpath, in the path's own units; a closed one ends where it began."""
    scanner, pen = _Scanner(data), _Pen()
    command = None
    while scanner.more():
        letter = scanner.command()
        if letter is None and command in (None, "Z", "z"):
            raise PathSyntaxError("numbers where a path command belongs")
        command = letter or {"M": "L", "m": "l"}.get(command or "", command)  # pairs after a move are lines
        if not pen.subpaths and command not in ("M", "m"):
            raise PathSyntaxError("a path begins with M")
        _draw(pen, scanner, command or "")
    return [pieces for pieces in pen.subpaths if pieces]


class _Pen:
    """Where the pen is, and what the shorthand commands remember."""

    def __init__(self) -> None:
        self.subpaths: list[list[Curve]] = []
        self.at: Point = (0.0, 0.0)
        self.began: Point = (0.0, 0.0)
        self.control: tuple[str, Point] = ("", (0.0, 0.0))

    def move(self, to: Point) -> None:
        """Begin a subpath there."""
        self.subpaths.append([])
        self.at = self.began = to
        self.control = ("", to)

    def draw(self, curve: Curve, kind: str = "") -> None:
        """Add a piece that begins where the pen is; its kind says whose control point may be mirrored next."""
        self.subpaths[-1].append(curve)
        self.control = (kind, curve[-2])
        self.at = curve[-1]

    def close(self) -> None:
        """A straight piece back to where the subpath began, and a new subpath from there."""
        if self.at != self.began:
            self.draw([self.at, self.began])
        self.move(self.began)

    def mirrored(self, kind: str) -> Point:
        """The last control point mirrored about the pen, where the last piece was of that kind."""
        last, (x, y) = self.control
        return (2 * self.at[0] - x, 2 * self.at[1] - y) if last == kind else self.at


def _draw(pen: _Pen, scanner: _Scanner, command: str) -> None:
    x0, y0 = pen.at if command.islower() else (0.0, 0.0)

    def point() -> Point:
        """The next two numbers, relative to the pen where the command is."""
        x = x0 + scanner.number()
        return x, y0 + scanner.number()

    match command.upper():
        case "M":
            pen.move(point())
        case "L":
            pen.draw([pen.at, point()])
        case "H":
            pen.draw([pen.at, (x0 + scanner.number(), pen.at[1])])
        case "V":
            pen.draw([pen.at, (pen.at[0], y0 + scanner.number())])
        case "C":
            pen.draw([pen.at, point(), point(), point()], "cubic")
        case "S":
            pen.draw([pen.at, pen.mirrored("cubic"), point(), point()], "cubic")
        case "Q":
            pen.draw([pen.at, point(), point()], "quadratic")
        case "T":
            pen.draw([pen.at, pen.mirrored("quadratic"), point()], "quadratic")
        case "A":
            rx, ry, turn = scanner.number(), scanner.number(), math.radians(scanner.number())
            large, sweep = scanner.flag(), scanner.flag()
            for curve in arc(pen.at, abs(rx), abs(ry), turn, large, sweep, point()):
                pen.draw(curve)
        case "Z":
            pen.close()


def arc(
    begin: Point, rx: float, ry: float, turn_rad: float, large: bool, sweep: bool, end: Point
) -> list[Curve]:
    """An elliptic arc as cubic curves of a quarter turn at most (SVG 1.1, appendix F.6)."""
    if begin == end:
        return []
    if rx < 1e-9 or ry < 1e-9:
        return [[begin, end]]
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    dx, dy = (begin[0] - end[0]) / 2, (begin[1] - end[1]) / 2
    x, y = (c * dx + s * dy) / rx, (c * dy - s * dx) / ry  # in axes where the ellipse is the unit circle
    half_chord = math.hypot(x, y)
    grown = max(1.0, half_chord)  # too small an ellipse grows until it reaches
    rx, ry, x, y = rx * grown, ry * grown, x / grown, y / grown
    sag = math.sqrt(max(0.0, 1.0 / max(x * x + y * y, 1e-300) - 1.0)) * (-1.0 if large == sweep else 1.0)
    cx, cy = sag * y, -sag * x
    first, last = math.atan2(y - cy, x - cx), math.atan2(-y - cy, -x - cx)
    angle = (last - first) % math.tau if sweep else -((first - last) % math.tau)
    count = max(1, math.ceil(abs(angle) / (math.pi / 2) - 1e-9))
    middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2

    def place(u: float, v: float) -> Point:
        """A point of the unit circle back on the ellipse."""
        u, v = rx * (u + cx), ry * (v + cy)
        return c * u - s * v + middle[0], s * u + c * v + middle[1]

    step = angle / count
    handle = 4.0 / 3.0 * math.tan(step / 4)
    curves: list[Curve] = []
    for k in range(count):
        a, b = first + k * step, first + (k + 1) * step
        (ca, sa), (cb, sb) = (math.cos(a), math.sin(a)), (math.cos(b), math.sin(b))
        inner = [place(ca - handle * sa, sa + handle * ca), place(cb + handle * sb, sb - handle * cb)]
        curves.append([place(ca, sa), *inner, place(cb, sb)])
    curves[0][0], curves[-1][-1] = begin, end
    return curves


def flatten(curve: Array) -> Array:
    """The points of a straight chain within FLATNESS_M of a curve given in metres, without its first, (n, 2).

    A curve of degree k strays from its chord, cut into n, by k (k - 1) |second difference| / (8 n^2) at most.
    """
    degree = len(curve) - 1
    if degree == 1:
        return curve[1:]
    bend = float(np.hypot(*np.diff(curve, n=2, axis=0).T).max())
    pieces = math.ceil(math.sqrt(degree * (degree - 1) * bend / (8 * FLATNESS_M)))
    t = np.linspace(0.0, 1.0, min(max(pieces, 1), MAX_PIECES_OF_CURVE) + 1)[1:, None]
    points = [curve[i] for i in range(degree + 1)]
    while len(points) > 1:  # de Casteljau
        points = [(1 - t) * a + t * b for a, b in itertools.pairwise(points)]
    return np.asarray(points[0])
