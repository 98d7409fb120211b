"""What the kernels of a ping are given, and the columns of what they note down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonar_explore.beam import S_RAD, Beam
from sonar_explore.compiled import inner_kernel
from sonar_explore.geometry import Array

NOTHING, PLANE, CORNER, EDGE, CYLINDER, ROUGH = 0, 1, 2, 3, 4, 5
RIGHT_CORNER, CONVEX_EDGE = 1.0, 2.0  # kinds of wedge
GHOST = 10
"""Added to the kind of source, once per mirror, for an echo heard by way of mirrors."""

NEAREST_M = 0.02  # nothing nearer is asked for
WIDEST_RAD = math.radians(80.0)
FAN_RAD = math.radians(4.0)  # between the rays that look for mirrors, of the AmigoBot's beam
TOGETHER_M = 0.5  # discs in a box of this size share their views
EPS_M = 1e-5  # margin of every test that leaves something out: rounding is a millionth of it
# plain numbers handed to a kernel would be compiled apart, as constants
NONE, START = np.int64(-1), np.int64(0)
WIDE = np.bool_(False)
VIEWS = 256
CELLS = 4  # of 1 m, that a box of `TOGETHER_M` may touch
LISTS = 9  # rows of `Scratch.lists`:
HIDDEN_BY, NEAR_CELLS, KNOWN_VIEWS, NEAR_WALLS, NEAR_WEDGES, NEAR_COLUMNS = range(6)
SPARE, IN_FAN, IN_SIGHT = range(6, LISTS)
ROWS = 18  # of `Scratch.rows`, each a number of what is near:
# the first end of each wall and the vector to its second, its roughness; the columns of each wedge, as in `Things`;
# windows of sources; what was found.
AX, AY, EX, EY, IS_ROUGH, CX, CY, *_REST = range(ROWS)
OPENING, KIND, SX, SY, TX, TY, WINDOW_X, WINDOW_Y, WINDOW_COS, FOUND = _REST[1:]
WEDGE_COLUMNS = 9
LANES = 8  # numbers that are worked on at a time: rows are filled up to a multiple
HIDING = 4096  # places for the lists of what could hide a source

# A source in a view: BX BY mean bearing, COS of the widest angle off it, NEAREST range [m], and the squares of
# sine and tangent between which loudness must be computed: above MUTE none is heard, below LOUD all are.
BX, BY, COS, NEAREST, MUTE, LOUD = range(6)
# and WHAT it is, WHICH row of its array, whether a wedge surely opens to the view, and its lists of what could hide it.
WHAT, WHICH, OPENS, WALLS_FROM, WALLS_TO, COLUMNS_FROM, COLUMNS_TO = range(7)
WALL, WEDGE, COLUMN, ROUGH_WALL = np.int64(0), np.int64(1), np.int64(2), np.int64(3)


class Things(NamedTuple):
    """What answers and what hides in a world prepared for pings (`sonar_explore.envs.scene`), [m] and [rad]."""

    walls: Array
    """x1 y1 x2 y2 roughness, shape (n, 5)."""
    wedges: Array
    """x y start opening kind, cosine and sine of the start, of the end; shape (k, 9)."""
    cylinders: Array
    """x y radius, shape (m, 3)."""


class Index(NamedTuple):
    """Which of these are near which cell of a square lattice.

    Walls near cell c are `wall_items[wall_first[c]:wall_first[c + 1]]`, rising; so for the others. (A tuple of its
    own: kernels that are called for each source get no more arrays than they need.)
    """

    wall_first: NDArray[np.int64]
    wall_items: NDArray[np.int64]
    wedge_first: NDArray[np.int64]
    wedge_items: NDArray[np.int64]
    cylinder_first: NDArray[np.int64]
    cylinder_items: NDArray[np.int64]
    frame: Array
    """Of the lattice: x0 y0 [m], cell size [m], rows, columns."""


class Near(NamedTuple):
    """Rows of the arrays of `Things` that lie within reach, rising."""

    walls: NDArray[np.int64]
    wedges: NDArray[np.int64]
    cylinders: NDArray[np.int64]


class Circle(NamedTuple):
    """Where the discs of a view lie, or their images by way of one or two mirrors."""

    x: float
    """Of its middle, [m]."""
    y: float
    rho: float
    """Its radius, [m]."""
    gain: float
    """Share of the amplitude that the mirrors leave."""
    mirror_1: int
    """Wall that reflects first, -1 for none; then the second."""
    mirror_2: int


class Disc(NamedTuple):
    """A disc, its images in the first mirror and in the last, and the direction of the last image's beam."""

    px: float
    py: float
    q1x: float
    q1y: float
    qx: float
    qy: float
    c: float
    """Cosine and sine of the heading of the last image's beam."""
    s: float


class Ear(NamedTuple):
    """Mirrors, loss, range and beam, as the kernels take them."""

    mirrors: int
    """Most mirrors on the way of a ghost."""
    loss: float
    """Share of the amplitude left by each bounce off a mirror."""
    range_max: float
    """[m]"""
    s: float
    """Of the beam, as its threshold and the strength of edges (`sonar_explore.beam.Beam`), [rad]."""
    threshold: float
    edge_strength: float
    cos_widest: float
    """Cosine and square [rad^2] of an angle beyond which nothing is heard."""
    square_widest: float
    fan: float
    """How much wider than the AmigoBot's the fan of rays is that looks for mirrors."""
    fan_c: float
    """Cosine and sine of the angle between its rays."""
    fan_s: float
    edge_reach: float
    """Beyond this no edge is heard, [m], and the share of it that a mirror leaves."""
    edge_loss: float

    @staticmethod
    def of(mirrors: int, loss: float, range_max: float, beam: Beam) -> Ear:
        """For these mirrors, this range and this beam."""
        widest = min(WIDEST_RAD, max(math.radians(20.0), beam.half_angle_rad(1.0 / NEAREST_M)))
        shape = beam.s_rad, beam.threshold, beam.edge_strength
        fan = beam.s_rad / S_RAD
        rays = fan, math.cos(fan * FAN_RAD), math.sin(fan * FAN_RAD)
        edges = (beam.edge_strength / beam.threshold) ** (2.0 / 3.0), loss ** (4.0 / 3.0)
        return Ear(mirrors, loss, range_max, *shape, math.cos(widest), widest**2, *rays, *edges)


class Scratch(NamedTuple):
    """Room for the kernels to work in."""

    source: Array
    """Sources of all views, columns `BX` to `LOUD`."""
    ids: NDArray[np.int64]
    """Of the same sources, columns `WHAT` to `COLUMNS_TO`."""
    lists: NDArray[np.int64]
    """Rows of whole numbers, `HIDDEN_BY` to `IN_SIGHT`."""
    rows: Array
    """Rows of what is near, `AX` to `FOUND`, for loops that look at all of it at once."""

    @staticmethod
    def of(counts: Sequence[int], busiest: Sequence[int]) -> Scratch:
        """Given how many walls, wedges and columns there are, and how many at most near one cell."""
        near = [min(count, CELLS * most) for count, most in zip(counts, busiest, strict=True)]
        rows = 4 * (2 * near[0] + near[1] + near[2]) + 64
        most = 2 * near[0] + near[1] + near[2] + LANES
        longest = max(HIDING, VIEWS, most)
        return Scratch(
            np.empty((rows, 6)),
            np.empty((rows, 7), dtype=np.int64),
            np.empty((LISTS, longest), dtype=np.int64),
            np.empty((ROWS, most)),
        )


@inner_kernel
def cell_of(x, y, frame):  # type: ignore[no-untyped-def]
    """Index cell that holds a point; -1 outside."""
    column = int(math.floor((x - frame[0]) / frame[2]))
    row = int(math.floor((y - frame[1]) / frame[2]))
    rows, columns = int(frame[3]), int(frame[4])
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return -1
    return row * columns + column
