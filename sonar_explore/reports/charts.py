"""Small line charts as inline SVG; colours come from the page's style sheet, fonts from the system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from sonar_explore.episodes.record import EpisodeRecord, Pose3
from sonar_explore.geometry import wrap_angle

WIDTH, HEIGHT = 420, 240
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 16, 42  # margins of the plot, [units]


@dataclass(frozen=True)
class Line:
    """One curve of a chart."""

    label: str
    style: str
    """Class in the style sheet."""
    y: Sequence[float]


@dataclass(frozen=True)
class Chart:
    """Curves over a common x."""

    title: str
    x_label: str
    x: Sequence[float]
    lines: Sequence[Line]
    y_top: float | None = None
    """Top of the y axis; None to fit the curves."""

    def svg(self) -> Markup:
        """The chart; its cursor carries the x of every scan for the script."""
        x_ticks = ticks(max(self.x, default=0.0), 6, whole=self.x_label == "scan")
        highest = max((v for line in self.lines for v in line.y), default=0.0)
        y_ticks = ticks(self.y_top or highest, 5)
        plot = _Plot(max(x_ticks[-1], max(self.x, default=0.0)), y_ticks[-1])
        cursor = " ".join(f"{plot.x(x):g}" for x in self.x)
        parts = [
            f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img"',
            f' aria-label="{escape(self.title)}">',
            *(plot.horizontal(y) for y in y_ticks),
            *(plot.vertical(x) for x in x_ticks),
            f'<text class="axis" x="{(LEFT + WIDTH - RIGHT) / 2:g}" y="{HEIGHT - 6}" text-anchor="middle">'
            f"{escape(self.x_label)}</text>",
            f'<line class="cursor" y1="{TOP}" y2="{HEIGHT - BOTTOM}" data-x="{cursor}" visibility="hidden"/>',
            *(plot.curve(self.x, line) for line in self.lines),
            "</svg>",
        ]
        return Markup("".join(parts))


@dataclass(frozen=True)
class _Plot:
    """The axes of a chart: from values to places in its box."""

    x_top: float
    y_top: float

    def x(self, value: float) -> float:
        """Place of a value on the x axis, [units]."""
        return round(LEFT + value / self.x_top * (WIDTH - LEFT - RIGHT), 1)

    def y(self, value: float) -> float:
        """Place of a value on the y axis, [units]; rising values go up."""
        return round(HEIGHT - BOTTOM - value / self.y_top * (HEIGHT - TOP - BOTTOM), 1)

    def horizontal(self, value: float) -> str:
        """The rule across the plot at a value of y, and the figure beside it."""
        y = self.y(value)
        return (
            f'<line class="rule" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:g}" y2="{y:g}"/>'
            f'<text class="tick" x="{LEFT - 7}" y="{y + 4:g}" text-anchor="end">{value:g}</text>'
        )

    def vertical(self, value: float) -> str:
        """The figure below the plot at a value of x."""
        return (
            f'<text class="tick" x="{self.x(value):g}" y="{HEIGHT - BOTTOM + 17}" text-anchor="middle">'
            f"{value:g}</text>"
        )

    def curve(self, xs: Sequence[float], line: Line) -> str:
        """A curve with a dot at each of its values."""
        places = [(self.x(x), self.y(y)) for x, y in zip(xs, line.y, strict=True)]
        points = " ".join(f"{x:g},{y:g}" for x, y in places)
        dots = "".join(f'<circle cx="{x:g}" cy="{y:g}" r="2.4"/>' for x, y in places)
        return f'<g class="curve {line.style}"><polyline points="{points}"/>{dots}</g>'


def ticks(top: float, most: int, *, whole: bool = False) -> list[float]:
    """0 and round steps up to the first that is not below `top`, about `most` of them at the most."""
    if not math.isfinite(top) or top <= 0:
        top = 1.0
    power = 10.0 ** math.floor(math.log10(top / most))
    step = next(m * power for m in (1, 2, 2.5, 5, 10, 20) if m * power * most >= top)
    if whole:
        step = max(1.0, math.ceil(step))
    return [round(k * step, 10) for k in range(math.ceil(round(top / step, 9)) + 1)]


def episode_charts(record: EpisodeRecord) -> list[Chart]:
    """Position error, heading error, explored fraction."""
    steps = record.steps
    scans = [float(step.index) for step in steps]
    predicted = [_errors(step.predicted_pose, step.true_pose) for step in steps]
    believed = [_errors(step.pose, step.true_pose) for step in steps]
    return [
        Chart(
            "Position error [m]",
            "scan",
            scans,
            [
                Line("predicted", "predicted", [e[0] for e in predicted]),
                Line("corrected", "believed", [e[0] for e in believed]),
            ],
        ),
        Chart(
            "Heading error [deg]",
            "scan",
            scans,
            [
                Line("predicted", "predicted", [e[1] for e in predicted]),
                Line("corrected", "believed", [e[1] for e in believed]),
            ],
        ),
        Chart(
            "Explored [%]",
            "path length [m]",
            [step.path_length_m for step in steps],
            [Line("explored", "explored", [100 * step.explored_fraction for step in steps])],
            y_top=100.0,
        ),
    ]


def _errors(pose: Pose3, truth: Pose3) -> tuple[float, float]:
    """(position [m], heading [deg])"""
    return math.dist(pose[:2], truth[:2]), abs(math.degrees(wrap_angle(pose[2] - truth[2])))
