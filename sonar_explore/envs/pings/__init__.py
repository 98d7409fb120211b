"""The kernels of a ping: which echo comes first, for many pings fired from nearly one place.

The answer is defined ping by ping, and tests/envs/plain_pings.py says it so: go through every wall, wedge
and column near the disc, keep the nearest that is in the beam, loud enough and not hidden; where nothing is
heard, look again from the mirror images of the disc. Here the pings of one scan, whose discs all lie on a
small circle, share what is the same for all of them:

- a *view* (`views`) is the circle, or its image in one or two mirrors, and the sources that any of its pings
  could hear, each with the window of headings and the ranges at which it could;
- from the circle itself, each source also knows the walls and columns that could hide it;
- what is near stands in rows of numbers (`rows`), which loops without branches look through for views and rays;
- the rays of the fan that look for mirrors (`ghosts`, `rays`) are made from one sine and cosine.

Views, rows and rays only leave out what cannot answer, with a margin far wider than rounding, and keep the order.
What is left is decided by the same arithmetic as in the plain form (`direct`): results agree to the last bit.
"""

from sonar_explore.envs.pings.arrays import (
    CONVEX_EDGE,
    CORNER,
    CYLINDER,
    EDGE,
    GHOST,
    NOTHING,
    PLANE,
    RIGHT_CORNER,
    ROUGH,
    Ear,
    Index,
    Scratch,
    Things,
    cell_of,
)
from sonar_explore.envs.pings.fire import fire_all, turned_discs

__all__ = [
    "CONVEX_EDGE",
    "CORNER",
    "CYLINDER",
    "EDGE",
    "GHOST",
    "NOTHING",
    "PLANE",
    "RIGHT_CORNER",
    "ROUGH",
    "Ear",
    "Index",
    "Scratch",
    "Things",
    "cell_of",
    "fire_all",
    "turned_discs",
]
