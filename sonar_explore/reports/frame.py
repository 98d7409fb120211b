"""From metres in the map frame, y up, to the units of a picture, y down."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sonar_explore.episodes.record import EpisodeRecord, Point

# largest picture, [units]; style sheet and script scale text and marks to the screen
WIDTH, HEIGHT = 1000.0, 760.0
MARGIN = 0.04  # around everything that is drawn, as a part of the longer side
FOOT = 26.0  # below it, for the scale bar, [units]


@dataclass(frozen=True)
class Frame:
    """Where the map lies in the picture."""

    left: float
    """x of the picture's left side, [m]."""
    top: float
    """y of its upper side, [m]."""
    scale: float
    """[units/m]"""
    width: float
    """[units]"""
    height: float
    """[units]"""

    def x(self, x_m: float) -> float:
        """[units]"""
        return round((x_m - self.left) * self.scale, 1)

    def y(self, y_m: float) -> float:
        """[units]"""
        return round((self.top - y_m) * self.scale, 1)

    def points(self, points: Iterable[Point]) -> str:
        """The `points` of a polyline."""
        return " ".join(f"{self.x(x):g},{self.y(y):g}" for x, y in points)

    def length(self, metres: float) -> float:
        """[units]"""
        return round(metres * self.scale, 1)


def frame_of(record: EpisodeRecord) -> Frame:
    """The frame that holds the walls, the scan positions and every feature."""
    return frame_around(_everything(record))


def frame_around(everything: Iterable[Point]) -> Frame:
    """The frame that holds the points and a margin; those that are not finite do not count."""
    points = [point for point in everything if all(map(math.isfinite, point))]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    margin = MARGIN * max(max(xs) - min(xs), max(ys) - min(ys), 1.0)
    left, right = min(xs) - margin, max(xs) + margin
    bottom, top = min(ys) - margin, max(ys) + margin
    scale = min(WIDTH / (right - left), HEIGHT / (top - bottom))
    return Frame(left, top, scale, round((right - left) * scale, 1), round((top - bottom) * scale + FOOT, 1))


def scale_bar(frame: Frame) -> int | float:
    """A round length that is about an eighth of the picture's width, [m]."""
    target = WIDTH / 8 / frame.scale
    power = 10 ** math.floor(math.log10(target))
    length = max((m * power for m in (1, 2, 5) if m * power <= target), default=power)
    return int(length) if length >= 1 else length


def _everything(record: EpisodeRecord) -> Iterable[Point]:
    yield record.world.start[:2]
    for x1, y1, x2, y2 in record.world.walls:
        yield from ((x1, y1), (x2, y2))
    for x, y, radius in record.world.cylinders:
        yield from ((x - radius, y - radius), (x + radius, y + radius))
    for step in record.steps:
        yield from (pose[:2] for pose in (step.pose, step.true_pose, step.predicted_pose))
        for feature in step.features:
            yield from (feature.segment[:2], feature.segment[2:])
    for chain in record.chains:
        for link in chain.links:
            yield from (link[:2], link[2:])
