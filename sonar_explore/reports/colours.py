"""Which colour each chain is drawn in: chains that lie side by side get colours that look apart."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sonar_explore.episodes.record import ChainRecord, Segment4
from sonar_explore.geometry import Array

CHAIN_COLOURS = 9  # classes c0 .. c8 of the style sheet, a ring of hues
SAMPLE_M = 0.25  # between points along a link, from which chains' distances are taken
SPREAD = (1.0, 2.5)  # the same hue, the hue beside it: this much nearer is as bad; others never clash


def chain_colours(chains: Sequence[ChainRecord]) -> dict[int, int]:
    """Chain id -> colour, 0 to `CHAIN_COLOURS` - 1: in order of the ids, the one whose likes are farthest away."""
    colours: dict[int, int] = {}
    drawn: list[tuple[int, Array]] = []
    used = [0] * CHAIN_COLOURS
    for chain in sorted(chains, key=lambda chain: chain.id):
        points = _sampled(chain.links)
        nearest = [math.inf] * CHAIN_COLOURS
        for colour, others in drawn:
            nearest[colour] = min(nearest[colour], _gap(points, others))
        apart = [
            min(nearest[(k + turn) % CHAIN_COLOURS] * SPREAD[abs(turn)] for turn in (-1, 0, 1))
            for k in range(CHAIN_COLOURS)
        ]
        best = max(range(CHAIN_COLOURS), key=lambda k: (apart[k], -used[k], -k))
        colours[chain.id] = best
        used[best] += 1
        drawn.append((best, points))
    return colours


def _sampled(links: Sequence[Segment4]) -> Array:
    """Points along the links, shape (n, 2), [m]."""
    points = [np.empty((0, 2))]
    for x1, y1, x2, y2 in links:
        n = 2 + int(math.hypot(x2 - x1, y2 - y1) / SAMPLE_M)
        points.append(np.linspace((x1, y1), (x2, y2), n))
    return np.concatenate(points)


def _gap(a: Array, b: Array) -> float:
    """Distance of the nearest two points, [m]; inf where there are none."""
    apart = np.square(a[:, None] - b[None]).sum(axis=2)
    return math.sqrt(apart.min(initial=math.inf))
