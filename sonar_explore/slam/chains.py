"""Feature chains: a root and the links that were associated with it (section III.A)."""

from __future__ import annotations

from dataclasses import dataclass, replace

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


class ChainMap:
    """All chains by id, and all their links stacked for association. Ids are never used again."""

    def __init__(self) -> None:
        self._chains: dict[int, Chain] = {}
        self._next_id = 0
        self._size = 0
        self._segments: Array = np.empty((64, 4))
        self._owners: NDArray[np.intp] = np.empty((64, 2), dtype=np.intp)

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
        return tuple(self._chains[i] for i in sorted(self._chains))

    @property
    def dangling(self) -> tuple[int, ...]:
        """Ids of the dangling chains, rising."""
        return tuple(chain.id for chain in self.chains if chain.dangling)

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
        self._stack(link.segment, chain_id, 0)
        return chain_id

    def add_link(self, chain_id: int, link: Link) -> None:
        """Lengthen a chain."""
        chain = self[chain_id]
        self._chains[chain_id] = replace(chain, links=(*chain.links, link))
        self._stack(link.segment, chain_id, len(chain.links))

    def merge(self, survivor_id: int, absorbed_id: int) -> None:
        """Union of links under the survivor's root; the dangling tag goes (section III.G)."""
        survivor, absorbed = self[survivor_id], self[absorbed_id]
        if survivor_id == absorbed_id:
            raise SonarExploreError(f"chain {survivor_id} cannot be merged with itself")
        links = survivor.links + absorbed.links
        self._chains[survivor_id] = replace(survivor, links=links, dangling=False)
        del self._chains[absorbed_id]
        rows = self.chain_ids == absorbed_id
        self._owners[: self._size][rows] += (survivor_id - absorbed_id, len(survivor.links))

    def place(self, pose_of_scan: dict[int, Pose]) -> None:
        """Place again every link of the scans named, for a back-end that moves whole scans."""
        for chain_id, chain in self._chains.items():
            links = tuple(_placed(link, pose_of_scan) for link in chain.links)
            self._chains[chain_id] = replace(chain, links=links)
        for row, (chain_id, index) in enumerate(self._owners[: self._size]):
            self._segments[row] = self._chains[int(chain_id)].links[index].segment.as_row()

    def _stack(self, segment: Segment, chain_id: int, index: int) -> None:
        if self._size == len(self._segments):
            self._segments = np.concatenate([self._segments, np.empty_like(self._segments)])
            self._owners = np.concatenate([self._owners, np.empty_like(self._owners)])
        self._segments[self._size] = segment.as_row()
        self._owners[self._size] = chain_id, index
        self._size += 1


def _placed(link: Link, pose_of_scan: dict[int, Pose]) -> Link:
    pose = pose_of_scan.get(link.scan)
    return link if pose is None else replace(link, segment=link.feature.segment.transformed(pose))
