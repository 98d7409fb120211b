"""Distributions over seeds as inline SVG: every mark is an episode and leads to its page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from sonar_explore.reports.charts import ticks

WIDTH = 640
LEFT, RIGHT, TOP, BOTTOM = 74, 22, 10, 40  # margins of the plot, [units]
LANE = 74  # height of one arm, [units]
DOT = 3.2  # radius of an episode's mark, [units]
CELL = 15  # side of an episode's square, [units]
CELLS_A_ROW = 50


@dataclass(frozen=True)
class Mark:
    """One episode."""

    seed: int
    value: float | None
    """None where the episode has none: it is left out of a strip."""
    success: bool
    note: str
    """What its tooltip says after the seed."""
    href: str | None


@dataclass(frozen=True)
class Lane:
    """One arm."""

    label: str
    style: str
    """Class in the style sheet."""
    marks: Sequence[Mark]


@dataclass(frozen=True)
class Interval:
    """A median and its confidence interval, drawn above a lane's dots."""

    value: float
    low: float
    high: float


def strip(
    title: str, lanes: Sequence[Lane], intervals: Sequence[Interval | None], limit: float | None
) -> Markup:
    """Every episode as a dot on a logarithmic axis [m], arm by arm, with the median and its interval."""
    values = [m.value for lane in lanes for m in lane.marks if m.value is not None]
    axis = _LogAxis.over([*values, *([limit] if limit else [])])
    height = TOP + LANE * len(lanes) + BOTTOM
    parts = [f'<svg class="strip" viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(title)}">']
    parts += [_tick(axis, value, height) for value in axis.ticks()]
    if limit:
        x = axis.x(limit)
        parts.append(f'<line class="limit" x1="{x:g}" x2="{x:g}" y1="{TOP - 4}" y2="{height - BOTTOM}"/>')
    for row, (lane, interval) in enumerate(zip(lanes, intervals, strict=True)):
        middle = TOP + LANE * (row + 0.5)
        parts.append(f'<g class="{lane.style}">')
        parts.append(f'<text class="lane" x="4" y="{middle + 4:g}">{escape(lane.label)}</text>')
        parts += _dots(lane, axis, middle)
        parts.append(_whisker(interval, axis, TOP + LANE * (row + 1) - 7) if interval else "")
        parts.append("</g>")
    centre = (LEFT + WIDTH - RIGHT) / 2
    parts.append(
        f'<text class="axis" x="{centre:g}" y="{height - 5}" text-anchor="middle">{escape(title)}</text></svg>'
    )
    return Markup("".join(parts))


def seed_squares(lanes: Sequence[Lane]) -> Markup:
    """Every seed a square, arm under arm: filled for a success, hollow with a cross for a failure."""
    count = max((len(lane.marks) for lane in lanes), default=0)
    across = min(count, CELLS_A_ROW)
    rows = math.ceil(count / CELLS_A_ROW)
    block = rows * CELL + 12
    width, height = LEFT + max(across, 20) * CELL + 8, block * len(lanes) + 4
    parts = [
        f'<svg class="squares" viewBox="0 0 {width} {height}" style="max-width:{1.4 * width:g}px" role="img"'
        ' aria-label="Success by seed">'
    ]
    for index, lane in enumerate(lanes):
        top = 4 + index * block
        parts.append(
            f'<g class="{lane.style}"><text class="lane" x="4" y="{top + 12}">{escape(lane.label)}</text>'
        )
        for place, mark in enumerate(lane.marks):
            row, column = divmod(place, CELLS_A_ROW)
            parts.append(_square(mark, LEFT + column * CELL, top + row * CELL))
        parts.append("</g>")
    return Markup("".join([*parts, "</svg>"]))


@dataclass(frozen=True)
class _LogAxis:
    """A logarithmic x axis from `low` to `high`."""

    low: float
    high: float

    @staticmethod
    def over(values: Sequence[float]) -> _LogAxis:
        """The axis on which all of these have their place, with room to spare."""
        positive = [v for v in values if v > 0] or [0.1]
        low, high = min(positive), max(positive)
        return _LogAxis(max(0.001, 0.8 * low), max(1.3 * high, 2.0 * low))

    def x(self, value: float) -> float:
        """Place of a value, [units]; what is below the axis stands at its beginning."""
        share = math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)
        return round(LEFT + share * (WIDTH - LEFT - RIGHT), 1)

    def ticks(self) -> list[float]:
        """1, 2 and 5 times the powers of ten that lie on it."""
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        values = [round(m * 10.0**p, 6) for p in powers for m in (1, 2, 5)]
        return [v for v in values if self.low <= v <= self.high]


def _tick(axis: _LogAxis, value: float, height: int) -> str:
    x = axis.x(value)
    return (
        f'<line class="rule" x1="{x:g}" x2="{x:g}" y1="{TOP}" y2="{height - BOTTOM}"/>'
        f'<text class="tick" x="{x:g}" y="{height - BOTTOM + 15}" text-anchor="middle">{value:g}</text>'
    )


def _dots(lane: Lane, axis: _LogAxis, middle: float) -> list[str]:
    """Side by side where they would cover one another."""
    placed: list[tuple[float, float]] = []
    dots = []
    for mark in sorted((m for m in lane.marks if m.value is not None), key=lambda m: m.value or 0.0):
        x = axis.x(mark.value or 0.0)
        offset = _free_offset(x, placed)
        placed.append((x, offset))
        place = f'cx="{x:g}" cy="{middle - 6 + offset:g}" r="{DOT}"'
        shape = f'<circle class="{_kind(mark)}" {place}>{_title(mark)}</circle>'
        dots.append(_linked(shape, mark))
    return dots


def _free_offset(x: float, placed: Sequence[tuple[float, float]]) -> float:
    near = [(px, py) for px, py in placed[-60:] if x - px < 2 * DOT]
    room = LANE / 2 - 12
    offsets = [k * s * DOT for k in range(int(room / DOT) + 1) for s in (1, -1)]
    gaps = [(min((math.hypot(x - px, o - py) for px, py in near), default=99.0), o) for o in offsets]
    return next((o for gap, o in gaps if gap >= 2 * DOT), max(gaps)[1])


def _whisker(interval: Interval, axis: _LogAxis, y: float) -> str:
    low, middle, high = axis.x(interval.low), axis.x(interval.value), axis.x(interval.high)
    return (
        f'<g class="median"><line x1="{low:g}" x2="{high:g}" y1="{y:g}" y2="{y:g}"/>'
        f'<path d="M{middle:g} {y - 5:g}l4.5 5l-4.5 5l-4.5 -5Z"/>'
        f"<title>median {interval.value:.3f} m, 95 % from {interval.low:.3f} to {interval.high:.3f}</title></g>"
    )


def _square(mark: Mark, x: float, y: float) -> str:
    side = CELL - 3
    place = f'x="{x:g}" y="{y:g}" width="{side}" height="{side}" rx="2"'
    shape = f'<rect class="{_kind(mark)}" {place}>{_title(mark)}</rect>'
    if not mark.success:
        arm = side - 6
        shape += f'<path class="cross" d="M{x + 3:g} {y + 3:g}l{arm} {arm}m0 -{arm}l-{arm} {arm}"/>'
    return _linked(shape, mark)


def _kind(mark: Mark) -> str:
    return "success" if mark.success else "failure"


def _title(mark: Mark) -> str:
    return f"<title>seed {mark.seed}: {escape(mark.note)}</title>"


def _linked(shape: str, mark: Mark) -> str:
    return f'<a href="{escape(mark.href)}">{shape}</a>' if mark.href else shape


@dataclass(frozen=True)
class Spot:
    """One value of a sweep: a figure with its interval."""

    label: str
    value: float
    low: float
    high: float
    is_default: bool


def small_multiple(title: str, x_label: str, spots: Sequence[Spot], top: float | None, style: str) -> Markup:
    """Values of one option side by side, evenly spaced; the default is filled. `top` None fits the values."""
    width, height, left, bottom, right, head = 300, 156, 52, 40, 10, 10
    values = ticks(top or max((s.high for s in spots), default=1.0), 4)
    highest = values[-1]
    step = (width - left - right) / max(1, len(spots))

    def y(value: float) -> float:
        """Place of a value on the y axis, [units]; rising values go up."""
        return round(height - bottom - min(value, highest) / highest * (height - head - bottom), 1)

    parts = [
        f'<svg class="multiple {style}" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title)}">'
    ]
    for value in values:
        text = f"{100 * value:.0f} %" if top else f"{value:g}"
        parts.append(
            f'<line class="rule" x1="{left}" x2="{width - right}" y1="{y(value):g}" y2="{y(value):g}"/>'
            f'<text class="tick" x="{left - 5}" y="{y(value) + 4:g}" text-anchor="end">{text}</text>'
        )
    xs = [round(left + step * (i + 0.5), 1) for i in range(len(spots))]
    line = " ".join(f"{x:g},{y(s.value):g}" for x, s in zip(xs, spots, strict=True))
    parts.append(f'<polyline points="{line}"/>')
    for x, spot in zip(xs, spots, strict=True):
        kind = "default" if spot.is_default else "other"
        parts.append(
            f'<line class="error" x1="{x:g}" x2="{x:g}" y1="{y(spot.low):g}" y2="{y(spot.high):g}"/>'
            f'<circle class="{kind}" cx="{x:g}" cy="{y(spot.value):g}" r="4"/>'
            f'<text class="tick" x="{x:g}" y="{height - bottom + 18}" text-anchor="middle">{escape(spot.label)}</text>'
        )
    middle = (left + width - right) / 2
    parts.append(
        f'<text class="axis" x="{middle:g}" y="{height - 4}" text-anchor="middle">{escape(x_label)}</text></svg>'
    )
    return Markup("".join(parts))
