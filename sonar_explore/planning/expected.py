"""Which chains should answer a scan at a place: those on which the foot of the normal lies, near and in sight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.geometry import Array, Segment
from sonar_explore.mapping.evidence import others
from sonar_explore.mapping.grid import OCCUPIED, Mask
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.slam.chains import Chain


class ChainRows(NamedTuple):
    """Chains as rows of arrays, in their order."""

    ids: list[int]
    spans: Array
    """Unit vector x y along the root, distance of its links across, their extent along, shape (n, 5), [m]."""
    directions: Array
    """Of the roots, shape (n,), [rad]."""
    certain: Array
    """P(root), 0 of dangling ones, shape (n,)."""
    dangling: Mask
    """Shape (n,)."""


class ChainSpans:
    """The rows of each chain, kept while the chain stays as it is."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Chain, tuple[float, ...]]] = {}
        self._chains: tuple[Chain, ...] = ()
        self._table: Array = np.zeros((0, 8))
        self._rows = _as_rows((), self._table)

    def of(self, chains: Sequence[Chain]) -> ChainRows:
        """Not to be written to: they are those of before where no chain has changed."""
        before = len(self._chains)
        changed = [*others(chains, self._chains), *range(before, len(chains))]
        if changed or len(chains) < before:
            table = np.empty((len(chains), 8))
            table[:before] = self._table[: len(chains)]
            if changed:
                table[changed] = [self._row_of(chains[i]) for i in changed]
            self._chains, self._table = tuple(chains), table
            self._rows = _as_rows(chains, table)
        return self._rows

    def _row_of(self, chain: Chain) -> tuple[float, ...]:
        known = self._known.get(chain.id)
        if known is None or known[0] is not chain:
            known = self._known[chain.id] = (chain, _row(chain))
        return known[1]


def _as_rows(chains: Sequence[Chain], table: Array) -> ChainRows:
    spans, directions, certain = table[:, :5].copy(), table[:, 5].copy(), table[:, 6].copy()
    return ChainRows([chain.id for chain in chains], spans, directions, certain, table[:, 7] > 0.0)


def _row(chain: Chain) -> tuple[float, ...]:
    direction = Segment(*chain.ends[chain.root_index].tolist()).direction
    c, s = math.cos(direction), math.sin(direction)
    ends = chain.ends.reshape(-1, 2)
    reach, across = (ends @ np.array([c, s])).tolist(), ends @ np.array([-s, c])
    span = c, s, float(across.sum()) / len(across), min(reach), max(reach)
    return *span, direction, 0.0 if chain.dangling else chain.root_probability, float(chain.dangling)


def expected_chains(
    places: Array, spans: Array, grid: OccupancyGrid, near_m: float, far_m: float, grows_m: float = 0.0
) -> Mask:
    """Which chains should answer at which places, shape (n places, n chains).

    A wall answers only where the foot of the normal lies on it (READING section 2), or up to `grows_m` beyond its
    links, within reliable range and in line of sight on the map.
    """
    out = np.zeros((len(places), len(spans)), dtype=bool)
    frame = grid.frame
    corner = frame.x0, frame.y0, frame.resolution_m
    _expect(places, spans, (near_m, far_m, grows_m), grid.states, corner, out)
    return out


def links_met(
    places: Array,
    spans: Array,
    dangling: Mask,
    grid: OccupancyGrid,
    near_m: float,
    far_m: float,
    grows_m: float,
) -> Mask:
    """At which places both a chain that dangles should answer and one that does not, shape (n places,)."""
    out = np.zeros(len(places), dtype=bool)
    frame = grid.frame
    corner = frame.x0, frame.y0, frame.resolution_m
    _meet(places, spans, dangling, (near_m, far_m, grows_m), grid.states, corner, out)
    return out


@kernel
def _expect(places, spans, limits, states, corner, out):  # type: ignore[no-untyped-def]
    for k in range(len(spans)):
        for i in range(len(places)):
            out[i, k] = _answers(places[i, 0], places[i, 1], spans[k], limits, states, corner)


@kernel
def _meet(places, spans, dangling, limits, states, corner, out):  # type: ignore[no-untyped-def]
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        links, known = False, False
        for k in range(len(spans)):
            if dangling[k] and not links:
                links = _answers(x, y, spans[k], limits, states, corner)
        for k in range(len(spans) if links else 0):
            if not (dangling[k] or known):
                known = _answers(x, y, spans[k], limits, states, corner)
        out[i] = known


@inner_kernel
def _answers(x, y, span, limits, states, corner):  # type: ignore[no-untyped-def]
    """Whether the foot of the normal lies on the chain, so near and in sight."""
    near, far, grows = limits
    x0, y0, resolution = corner
    cos, sin = span[0], span[1]
    foot = x * cos + y * sin
    if foot < span[3] - grows or foot > span[4] + grows:
        return False
    offset = span[2] - (y * cos - x * sin)
    if not (near <= abs(offset) <= far):
        return False
    return _in_sight(states, x0, y0, resolution, x, y, x - offset * sin, y + offset * cos)


@inner_kernel
def _in_sight(states, x0, y0, resolution, x, y, fx, fy):  # type: ignore[no-untyped-def]
    """Whether no occupied cell stands more than 15 cm before the foot."""
    length = math.hypot(fx - x, fy - y)
    rows, columns = states.shape
    for k in range(int((length - 0.15) / resolution)):
        share = (k + 0.5) * resolution / length
        row = int(math.floor((y + (fy - y) * share - y0) / resolution))
        column = int(math.floor((x + (fx - x) * share - x0) / resolution))
        if 0 <= row < rows and 0 <= column < columns and states[row, column] == OCCUPIED:
            return False
    return True
