"""SVG drawn in any editor: every line is a wall, every circle a column, and what is called `start` the start.

The scale is the root's `data-metres-per-unit`, or its width in mm, cm or m over the width of its viewBox. The
world's origin is the lower left corner of the page, y up. A stroke's width counts for nothing: the wall is the
line down its middle.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sonar_explore.envs.readers.lines import world_of_lines
from sonar_explore.envs.readers.source import ReadOptions, read_bytes
from sonar_explore.envs.readers.svg_elements import (
    LENGTH,
    MAX_ELEMENTS,
    METRES,
    USER_UNITS,
    Element,
    length,
    parse_xml,
)
from sonar_explore.envs.readers.svg_path import Curve, PathSyntaxError, arc, flatten, parse_path
from sonar_explore.envs.readers.svg_transform import parse_transform, translation
from sonar_explore.envs.validation import MAX_CYLINDERS, MAX_WALLS
from sonar_explore.envs.world import World
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose

MAX_BYTES = 4 * 2**20
START_ID = "start"

_UNDRAWN = {"defs", "symbol", "clipPath", "mask", "pattern", "marker", "metadata", "title", "desc", "style"}


@dataclass
class _Drawing:
    """What has been drawn so far, in metres."""

    walls: list[Array] = field(default_factory=list)
    cylinders: list[tuple[float, float, float]] = field(default_factory=list)
    start: Pose | None = None
    count: int = 0


def read_svg(path: Path, options: ReadOptions) -> World:
    """The world in an SVG file."""
    root = parse_xml(path, read_bytes(path, MAX_BYTES))
    if root.tag != "svg":
        raise SonarExploreError(f"{path.name}: no SVG: the outermost element is <{root.tag[:40]}>")
    drawing = _Drawing()
    try:
        page = _page_to_metres(root, options.resolution_m)
        for element, matrix in _drawn(root, page):
            _add(drawing, element, matrix)
    except ValueError as error:
        raise SonarExploreError(f"{path.name}: {error}") from None
    if not drawing.walls:
        raise SonarExploreError(f"{path.name}: no lines, rectangles, polygons or paths to make walls of")
    cylinders = np.array(drawing.cylinders, dtype=float).reshape(-1, 3)
    start = options.start or drawing.start
    return world_of_lines(path, f"Drawing {path.name}", np.concatenate(drawing.walls), cylinders, start)


def _page_to_metres(root: Element, metres_per_unit: float | None) -> Array:
    """The matrix (3, 3) from the user units of the root to metres, y up, the page's lower left corner at 0."""
    width, height = root.attributes.get("width", ""), root.attributes.get("height", "")
    box = [_number(n, "viewBox") for n in re.split(r"[\s,]+", root.attributes.get("viewBox", "")) if n]
    if len(box) != 4:
        size = [length(t, USER_UNITS, "the page") if LENGTH.fullmatch(t) else 0.0 for t in (width, height)]
        box = [0.0, 0.0, *size]
    said = root.attributes.get("data-metres-per-unit", "")
    match = LENGTH.fullmatch(width)
    if metres_per_unit is None and said:
        metres_per_unit = _number(said, "data-metres-per-unit")
    elif metres_per_unit is None and match and match.group(2) in METRES and box[2] > 0.0:
        metres_per_unit = float(match.group(1)) * METRES[match.group(2)] / box[2]
    if metres_per_unit is None:
        raise ValueError(
            'no scale: give <svg> data-metres-per-unit="0.01" or a width in mm, cm or m, '
            "or say FILE?resolution=0.01"
        )
    if not 0.0 < metres_per_unit <= 1e6:
        raise ValueError(f"{metres_per_unit} metres per unit; it must be above 0")
    x, y, _, rows = box
    k = metres_per_unit
    return np.array([[k, 0.0, -k * x], [0.0, -k, k * (y + rows)], [0.0, 0.0, 1.0]])


def _number(text: str, attribute: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{attribute} of <svg> holds no number: {text[:40]!r}") from None


def _drawn(root: Element, page: Array) -> Iterator[tuple[Element, Array]]:
    """Every element that is drawn, with the matrix from its own units to metres; clones (`use`) as well."""
    named = {e.attributes["id"]: e for e in _all(root) if "id" in e.attributes}
    pending: list[tuple[Element, Array, int]] = [(root, page, 0)]
    count = 0
    while pending:
        element, outer, cloned = pending.pop()
        count += 1
        if count > MAX_ELEMENTS:
            raise ValueError(f"more than {MAX_ELEMENTS} elements, clones counted")
        if element.hidden or (element.tag in _UNDRAWN and not cloned):
            continue
        matrix = (
            outer if element is root else outer @ parse_transform(element.attributes.get("transform", ""))
        )
        yield element, matrix
        pending += [(child, matrix, 0) for child in reversed(element.children)]
        if element.tag == "use" and cloned < 8:
            original = named.get(element.attributes.get("href", "").removeprefix("#"))
            if original is not None:
                shift = translation(element.number("x"), element.number("y"))
                pending.append((original, matrix @ shift, cloned + 1))


def _all(root: Element) -> Iterator[Element]:
    pending = [root]
    while pending:
        element = pending.pop()
        yield element
        pending += element.children


def _add(drawing: _Drawing, element: Element, matrix: Array) -> None:
    if element.tag == "circle" and element.attributes.get("id") != START_ID:
        radius = element.number("r") * math.sqrt(abs(float(np.linalg.det(matrix[:2, :2]))))
        x, y = _apply(matrix, [(element.number("cx"), element.number("cy"))])[0].tolist()
        if radius > 0.0:
            drawing.cylinders.append((x, y, radius))
        if len(drawing.cylinders) > MAX_CYLINDERS:
            raise ValueError(f"more than {MAX_CYLINDERS} circles")
        return
    for curves in _outlines(element):
        chain = np.vstack([_apply(matrix, curves[0][:1]), *(flatten(_apply(matrix, c)) for c in curves)])
        if element.attributes.get("id") == START_ID:
            drawing.start = _start(element, chain)
            return
        drawing.walls.append(np.hstack([chain[:-1], chain[1:]]))
        drawing.count += len(chain)
        if drawing.count > 2 * MAX_WALLS:
            raise ValueError(f"more than {MAX_WALLS} walls")


def _apply(matrix: Array, points: Curve) -> Array:
    return np.asarray(np.array(points, dtype=float) @ matrix[:2, :2].T + matrix[:2, 2])


def _start(element: Element, chain: Array) -> Pose:
    """A line points where the robot looks; any other mark is where it stands, `data-heading-deg` where it looks."""
    (x1, y1), (x2, y2) = chain[0].tolist(), chain[-1].tolist()
    if element.tag in ("line", "polyline", "path") and math.hypot(x2 - x1, y2 - y1) > 1e-6:
        return Pose(x1, y1, math.atan2(y2 - y1, x2 - x1))
    x, y = ((chain.min(axis=0) + chain.max(axis=0)) / 2).tolist()
    return Pose(x, y, math.radians(float(element.attributes.get("data-heading-deg", "0"))))


def _outlines(element: Element) -> list[list[Curve]]:
    """The lines of a shape, in its own units."""
    match element.tag:
        case "line":
            ends = [
                (element.number("x1"), element.number("y1")),
                (element.number("x2"), element.number("y2")),
            ]
            return [[ends]]
        case "polyline" | "polygon":
            return _polyline(element)
        case "rect":
            return _rectangle(element)
        case "circle" | "ellipse":
            return _ellipse(element)
        case "path":
            try:
                return parse_path(element.attributes.get("d", ""))
            except PathSyntaxError as error:
                name = element.attributes.get("id", "without an id")
                raise ValueError(f"path {name[:40]}: {error}") from None
    return []


def _polyline(element: Element) -> list[list[Curve]]:
    text = element.attributes.get("points", "").strip()
    numbers = [float(n) for n in re.split(r"[\s,]+", text) if n]
    points = list(zip(numbers[0::2], numbers[1::2], strict=False))
    if element.tag == "polygon" and points:
        points.append(points[0])
    if len(points) < 2:
        return []
    return [[[a, b] for a, b in itertools.pairwise(points)]]


def _rectangle(element: Element) -> list[list[Curve]]:
    x, y, width, height = (element.number(name) for name in ("x", "y", "width", "height"))
    if width <= 0.0 or height <= 0.0:
        return []
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
    return [[[a, b] for a, b in itertools.pairwise(corners)]]


def _ellipse(element: Element) -> list[list[Curve]]:
    x, y, r = element.number("cx"), element.number("cy"), element.number("r")
    rx, ry = element.number("rx", r), element.number("ry", r)
    if rx <= 0.0 or ry <= 0.0:
        return []
    left, right = (x - rx, y), (x + rx, y)
    return [[*arc(left, rx, ry, 0.0, False, True, right), *arc(right, rx, ry, 0.0, False, True, left)]]
