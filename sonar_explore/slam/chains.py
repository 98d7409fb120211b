"""Feature chains: a root and the links that were associated with it (section III.A)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonar_explore.compiled import kernel
from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Segment
from sonar_explore.slam.features import Feature


@dataclass(frozen=True)
class Link:
    """One wall segment as one scan saw it."""

    segment: Segment
    """In the map frame, placed by the pose believed after that scan's correction."""
    scan: int
    """Index of the scan."""
    feature_index: int
    """Index of the feature among that scan's features."""
    feature: Feature
    """The measurement itself, in the robot frame: whoever moves the scan can place it again."""

    @property
    def range_m(self) -> float:
        """Distance from the robot when it was seen, [m]."""
        return self.feature.range_m

    @cached_property
    def foot(self) -> tuple[float, float, float]:
        """Its middle, x y [m], and the direction of its line, in (-pi/2, pi/2], [rad]; map frame."""
        return *self.segment.midpoint, self.segment.direction


@dataclass(frozen=True, eq=False)
class Chain:
    """A wall: its root is what it is corrected to, its links are where it may be met again."""

    id: int
    placed: tuple[Link, ...]
    """The links where they stood when last somebody looked at them."""
    root_index: int
    """Index of the root among the links."""
    root_probability: float
    """P(root), equation (3): 1 for the first scan."""
    dangling: bool
    """Rooted by a scan of which no feature was associated (section III.E, case b)."""
    moved_to: Array | None = None
    """Ends of the links where they stand now, shape (n, 4), map frame, [m]; None where that is as they were placed."""

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """In the order in which they were added."""
        if self.moved_to is None:
            return self.placed
        return tuple(map(_moved, self.placed, self.moved_to.tolist()))

    @cached_property
    def root(self) -> Link:
        """The link that corrections refer to."""
        if self.moved_to is None or "links" in vars(self):
            return self.links[self.root_index]
        return _moved(self.placed[self.root_index], self.moved_to[self.root_index].tolist())

    @cached_property
    def ends(self) -> Array:
        """Of each link, shape (n, 4), map frame, [m]; not to be written to."""
        if self.moved_to is not None:
            return self.moved_to
        return np.array([link.segment.as_row() for link in self.placed], dtype=float)

    @cached_property
    def feet(self) -> Array:
        """Of each link its middle, x y [m], the direction of its line [rad], and how many discs heard it."""
        return np.array([(*link.foot, link.feature.discs) for link in self.links], dtype=float)

    def lengthened(self, link: Link) -> Chain:
        """The chain with one link more."""
        longer = Chain(self.id, (*self.links, link), self.root_index, self.root_probability, self.dangling)
        if "feet" in vars(self):
            vars(longer)["feet"] = feet = np.empty((len(longer.links), 4))
            feet[:-1], feet[-1] = self.feet, (*link.foot, link.feature.discs)
        return longer


def _moved(link: Link, ends: Sequence[float]) -> Link:
    """The link there, or itself where that is where it stands."""
    segment = Segment(*ends)
    if segment == link.segment:
        return link
    return Link(segment, link.scan, link.feature_index, link.feature)


class ChainMap:
    """All chains by id, and all their links stacked for association. Ids are never used again.

    Who moves scans moves the stacked rows; the links of a chain follow when somebody looks at it.
    """

    def __init__(self) -> None:
        self._chains: dict[int, Chain] = {}
        self._next_id = 0
        self._dangling: list[int] = []
        self._size = 0
        self._segments: Array = np.empty((64, 4))
        self._owners: NDArray[np.intp] = np.empty((64, 3), dtype=np.intp)
        """Chain, place among its links, and scan of each row of `segments`."""
        self._measured: Array = np.empty((64, 4))
        """The same segments in the robot frames of their scans, [m]."""
        self._rows: dict[int, list[int]] = {}
        """Of each chain, the rows of its links in their order."""
        self._behind: NDArray[np.bool_] = np.zeros(64, dtype=bool)
        """Chains that have such, by id."""

    def __len__(self) -> int:
        return len(self._chains)

    def __contains__(self, chain_id: int) -> bool:
        return chain_id in self._chains

    def __getitem__(self, chain_id: int) -> Chain:
        if chain_id not in self._chains:
            raise SonarExploreError(f"no chain {chain_id}; there are {len(self)} chains")
        if self._behind[chain_id]:
            self._catch_up(chain_id)
        return self._chains[chain_id]

    @property
    def chains(self) -> tuple[Chain, ...]:
        """Ordered by id."""
        for chain_id in np.flatnonzero(self._behind[: self._next_id]).tolist():
            self._catch_up(chain_id)
        return tuple(self._chains.values())  # in the order in which they were rooted

    def root_probability(self, chain_id: int) -> float:
        """Of a chain, wherever its links are by now."""
        return self._chains[chain_id].root_probability

    def row(self, chain_id: int, link: int) -> int:
        """That of a link of a chain among `segments`."""
        return self._rows[chain_id][link]

    @property
    def dangling(self) -> tuple[int, ...]:
        """Ids of the dangling chains, rising."""
        return tuple(self._dangling)

    @property
    def segments(self) -> Array:
        """Every link of every chain, oldest first, shape (n, 4), [m], map frame."""
        return self._segments[: self._size]

    @property
    def owners(self) -> NDArray[np.intp]:
        """Chain, place among its links, and scan of each row of `segments`, shape (n, 3)."""
        return self._owners[: self._size]

    @property
    def scan_indices(self) -> NDArray[np.intp]:
        """The scan of each row of `segments`, shape (n,)."""
        return self._owners[: self._size, 2]

    def add_root(self, link: Link, root_probability: float, *, dangling: bool = False) -> int:
        """Start a chain and return its id."""
        chain_id, self._next_id = self._next_id, self._next_id + 1
        self._chains[chain_id], self._rows[chain_id] = (
            Chain(chain_id, (link,), 0, root_probability, dangling),
            [],
        )
        if chain_id == len(self._behind):
            self._behind = np.concatenate([self._behind, np.zeros_like(self._behind)])
        if dangling:
            self._dangling.append(chain_id)
        self._stack(link, chain_id, 0)
        return chain_id

    def add_link(self, chain_id: int, link: Link) -> None:
        """Lengthen a chain."""
        if chain_id not in self._chains:
            raise SonarExploreError(f"no chain {chain_id}; there are {len(self)} chains")
        chain = self._chains[chain_id]
        self._chains[chain_id] = chain.lengthened(link)
        self._stack(link, chain_id, len(chain.links))

    def merge(self, survivor_id: int, absorbed_id: int) -> None:
        """Union of links under the survivor's root; the dangling tag goes (section III.G)."""
        survivor, absorbed = self[survivor_id], self[absorbed_id]
        if survivor_id == absorbed_id:
            raise SonarExploreError(f"chain {survivor_id} cannot be merged with itself")
        links = survivor.links + absorbed.links
        self._chains[survivor_id] = replace(survivor, placed=links, moved_to=None, dangling=False)
        del self._chains[absorbed_id]
        self._dangling = [i for i in self._dangling if i not in (survivor_id, absorbed_id)]
        rows = self._rows.pop(absorbed_id)
        self._owners[rows] += (survivor_id - absorbed_id, len(survivor.links), 0)
        self._rows[survivor_id] += rows

    def place(self, scans: NDArray[np.intp], poses: Array) -> None:
        """Place again every link of these scans, for a back-end that moves whole scans.

        Args:
            scans: rising, shape (k,).
            poses: x, y [m], heading [rad] of each, shape (k, 3).
        """
        rows = slice(self._size)
        _place(
            *(np.ascontiguousarray(scans), poses, self._owners[rows], self._measured, self._segments),
            self._behind,
        )

    def _catch_up(self, chain_id: int) -> None:
        """The links of a chain go where their rows are, once somebody looks at them."""
        chain = self._chains[chain_id]
        placed = vars(chain).get("links", chain.placed)
        there = self._segments[self._rows[chain_id]]
        rest = chain.root_index, chain.root_probability, chain.dangling
        self._chains[chain_id] = Chain(chain_id, placed, *rest, there)
        self._behind[chain_id] = False

    def _stack(self, link: Link, chain_id: int, index: int) -> None:
        if self._size == len(self._segments):
            for name in ("_segments", "_owners", "_measured"):
                rows = getattr(self, name)
                setattr(self, name, np.concatenate([rows, np.zeros_like(rows)]))
        self._segments[self._size] = link.segment.as_row()
        self._measured[self._size] = link.feature.segment.as_row()
        self._owners[self._size] = chain_id, index, link.scan
        self._rows[chain_id].append(self._size)
        self._size += 1


@kernel
def _place(scans, poses, owners, measured, segments, behind):  # type: ignore[no-untyped-def]
    """Segments of the links of these scans; their chains are `behind` then."""
    turned = np.empty((len(scans), 2))
    number = np.full(scans[-1] + 1 if len(scans) else 0, -1)
    for k in range(len(scans)):
        number[scans[k]] = k
        turned[k, 0], turned[k, 1] = math.cos(poses[k, 2]), math.sin(poses[k, 2])
    for row in range(len(owners)):
        k = number[owners[row, 2]] if owners[row, 2] < len(number) else -1
        if k < 0:
            continue
        x, y, c, s = poses[k, 0], poses[k, 1], turned[k, 0], turned[k, 1]
        for i in (0, 2):
            at, across = measured[row, i], measured[row, i + 1]
            segments[row, i], segments[row, i + 1] = x + c * at - s * across, y + s * at + c * across
        behind[owners[row, 0]] = True
