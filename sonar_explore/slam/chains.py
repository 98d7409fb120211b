"""Feature chains: a root and the links that were associated with it (section III.A)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonar_explore.errors import SonarExploreError
from sonar_explore.geometry import Array, Pose, Segment
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


@dataclass(frozen=True)
class Chain:
    """A wall: its root is what it is corrected to, its links are where it may be met again."""

    id: int
    links: tuple[Link, ...]
    root_index: int
    """Index of the root among the links."""
    root_probability: float
    """P(root), equation (3): 1 for the first scan."""
    dangling: bool
    """Rooted by a scan of which no feature was associated (section III.E, case b)."""

    @property
    def root(self) -> Link:
        """The link that corrections refer to."""
        return self.links[self.root_index]

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


class ChainMap:
    """All chains by id, and all their links stacked for association. Ids are never used again."""

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

    def __len__(self) -> int:
        return len(self._chains)

    def __contains__(self, chain_id: int) -> bool:
        return chain_id in self._chains

    def __getitem__(self, chain_id: int) -> Chain:
        if chain_id not in self._chains:
            raise SonarExploreError(f"no chain {chain_id}; there are {len(self)} chains")
        return self._chains[chain_id]

    @property
    def chains(self) -> tuple[Chain, ...]:
        """Ordered by id."""
        return tuple(self._chains.values())  # in the order in which they were rooted

    @property
    def dangling(self) -> tuple[int, ...]:
        """Ids of the dangling chains, rising."""
        return tuple(self._dangling)

    @property
    def segments(self) -> Array:
        """Every link of every chain, oldest first, shape (n, 4), [m], map frame."""
        return self._segments[: self._size]

    @property
    def chain_ids(self) -> NDArray[np.intp]:
        """The chain of each row of `segments`, shape (n,)."""
        return self._owners[: self._size, 0]

    @property
    def link_indices(self) -> NDArray[np.intp]:
        """The place of each row of `segments` among its chain's links, shape (n,)."""
        return self._owners[: self._size, 1]

    def add_root(self, link: Link, root_probability: float, *, dangling: bool = False) -> int:
        """Start a chain and return its id."""
        chain_id, self._next_id = self._next_id, self._next_id + 1
        self._chains[chain_id] = Chain(chain_id, (link,), 0, root_probability, dangling)
        if dangling:
            self._dangling.append(chain_id)
        self._stack(link, chain_id, 0)
        return chain_id

    def add_link(self, chain_id: int, link: Link) -> None:
        """Lengthen a chain."""
        chain = self[chain_id]
        self._chains[chain_id] = chain.lengthened(link)
        self._stack(link, chain_id, len(chain.links))

    def merge(self, survivor_id: int, absorbed_id: int) -> None:
        """Union of links under the survivor's root; the dangling tag goes (section III.G)."""
        survivor, absorbed = self[survivor_id], self[absorbed_id]
        if survivor_id == absorbed_id:
            raise SonarExploreError(f"chain {survivor_id} cannot be merged with itself")
        links = survivor.links + absorbed.links
        self._chains[survivor_id] = replace(survivor, links=links, dangling=False)
        del self._chains[absorbed_id]
        self._dangling = [i for i in self._dangling if i not in (survivor_id, absorbed_id)]
        rows = self.chain_ids == absorbed_id
        self._owners[: self._size][rows] += (survivor_id - absorbed_id, len(survivor.links), 0)

    def place(self, pose_of_scan: dict[int, Pose]) -> None:
        """Place again every link of the scans named, for a back-end that moves whole scans."""
        owners = self._owners[: self._size]
        at = np.full((owners[:, 2].max(initial=-1) + 1, 4), np.nan)
        for scan, pose in pose_of_scan.items():
            if scan < len(at):
                at[scan] = pose.x, pose.y, math.cos(pose.heading), math.sin(pose.heading)
        rows = np.flatnonzero(np.isfinite(at[owners[:, 2], 0]))
        x, y, c, s = at[owners[rows, 2]].T
        x1, y1, x2, y2 = self._measured[rows].T
        ends = x + c * x1 - s * y1, y + s * x1 + c * y1, x + c * x2 - s * y2, y + s * x2 + c * y2
        self._segments[rows] = moved = np.column_stack(ends)
        links: dict[int, list[Link]] = {}
        for (chain_id, index, scan), ends_m in zip(owners[rows].tolist(), moved.tolist(), strict=True):
            if chain_id not in links:
                links[chain_id] = list(self._chains[chain_id].links)
            link = links[chain_id][index]
            links[chain_id][index] = Link(Segment(*ends_m), scan, link.feature_index, link.feature)
        for chain_id, placed in links.items():
            self._chains[chain_id] = replace(self._chains[chain_id], links=tuple(placed))

    def _stack(self, link: Link, chain_id: int, index: int) -> None:
        if self._size == len(self._segments):
            for name in ("_segments", "_owners", "_measured"):
                rows = getattr(self, name)
                setattr(self, name, np.concatenate([rows, np.empty_like(rows)]))
        self._segments[self._size] = link.segment.as_row()
        self._measured[self._size] = link.feature.segment.as_row()
        self._owners[self._size] = chain_id, index, link.scan
        self._size += 1
