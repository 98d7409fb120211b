"""What exploring would have cost with the map known: a tour of view points that see the whole building.

View points are chosen one by one, each the one that shows most of what is left (greedy set cover); they lie where
the robot would scan, and see what a scan explores (docs/metrics.md). Their order is the best that nearest neighbour,
2-opt and moving single points find; the way between them is that of the robot's own planner on the true grid. The
tour begins at the start and ends anywhere. It is no lower bound: a better tour may exist.
"""

from __future__ import annotations

import heapq
import itertools
from pathlib import Path

import msgspec
import numpy as np
from scipy import ndimage

from sonar_explore.config import ExplorationConfig
from sonar_explore.envs.load import load_world
from sonar_explore.envs.world import World
from sonar_explore.episodes.files import write_atomically
from sonar_explore.episodes.lattice import clearance_on
from sonar_explore.episodes.scoring import Scorer
from sonar_explore.geometry import Array
from sonar_explore.mapping.grid import FREE, OCCUPIED, GridFrame, Mask
from sonar_explore.mapping.occupancy import OccupancyGrid
from sonar_explore.planning.paths import SafePaths, path_length, straightened

COVER = 0.99
"""Share of the reachable area that a tour must see."""
LATTICE_M = 0.40
"""Between possible view points, [m]."""


class Tour(msgspec.Struct, frozen=True):
    """A tour of a building whose map is known."""

    length_m: float
    views: list[tuple[float, float]]
    """In their order, without the start, [m]."""
    seen: float
    """Share of the reachable area that they and the start see."""
    reachable_m2: float


def kept_tour(world: str, fingerprint: str, path: Path) -> Tour:
    """The tour from its file, where that was made from the same world by the same code; else a new one."""
    made: tuple[str, Tour]
    try:
        made = msgspec.json.decode(path.read_bytes(), type=tuple[str, Tour])
        if made[0] == fingerprint:
            return made[1]
    except (OSError, msgspec.DecodeError):
        pass
    tour = tour_of(load_world(world))
    write_atomically(path, msgspec.json.encode((fingerprint, tour)))
    return tour


def tour_of(world: World, config: ExplorationConfig | None = None) -> Tour:
    """A short tour that sees `COVER` of what can be reached, or all that can be seen where that is less."""
    config = config or ExplorationConfig()
    scorer = Scorer(world)
    grid = true_grid(scorer)
    body = config.simulator.robot.radius_m

    def paths(x: float, y: float, daring: bool) -> SafePaths:
        """The ways from here on the true map."""
        return SafePaths(grid, x, y, body, config.planning, daring=daring)

    start = world.start
    for daring in (False, True):  # narrow places are for the daring alone
        places = _places(grid, paths(start.x, start.y, daring), config.candidates.least_room_m)
        places = np.vstack([[[start.x, start.y]], places])
        views, seen = view_points(scorer, places)
        if seen >= COVER:
            break
    stops = np.vstack([places[:1], places[[v for v in views if v]]])
    trees = [paths(x, y, daring) for x, y in stops.tolist()]
    cells = grid.frame.cells(stops)
    cost = np.array([tree.cost_m[cells[:, 0], cells[:, 1]] for tree in trees])
    order = shortest_order(np.minimum(cost, cost.T))
    length = 0.0
    for a, b in itertools.pairwise(order):
        way = trees[a].to(*stops[b].tolist())
        assert way is not None  # both lie in what the start reaches
        length += path_length(straightened(way, trees[a].room_m, grid.frame))
    ordered = [(float(x), float(y)) for x, y in stops[order[1:]]]
    return Tour(length, ordered, seen, scorer.reachable_area_m2)


def true_grid(scorer: Scorer) -> OccupancyGrid:
    """What a faultless map would show: cells that no wall passes are free, as far as the robot's body reaches."""
    lattice = scorer.lattice
    res = lattice.resolution_m
    clearance = clearance_on(scorer.world, lattice, 2.0 * res)
    inside = ndimage.distance_transform_edt(~scorer.reachable) * res <= 0.18
    states = np.where((clearance > res / 2) & inside, FREE, OCCUPIED).astype(np.uint8)
    return OccupancyGrid(GridFrame(*lattice.origin, res, lattice.shape), states)


def view_points(scorer: Scorer, places: Array) -> tuple[list[int], float]:
    """Rows of places (n, 2) that together see enough, the first of them always among them; and what they see."""
    sight = [np.flatnonzero(scorer.explored_mask_from(x, y)) for x, y in places.tolist()]
    total = int(scorer.reachable.sum())
    coverable = np.unique(np.concatenate(sight)).size
    times = np.zeros(scorer.reachable.size, dtype=np.int32)
    times[sight[0]] += 1
    chosen, covered = [0], len(sight[0])
    enough = min(COVER * total, coverable)
    heap = [(-len(cells), i) for i, cells in enumerate(sight) if i]
    heapq.heapify(heap)
    while covered < enough:
        # what a place adds only ever shrinks: the first that holds its own is the best
        _, i = heapq.heappop(heap)
        gain = int((times[sight[i]] == 0).sum())
        if heap and gain < -heap[0][0]:
            heapq.heappush(heap, (-gain, i))
            continue
        times[sight[i]] += 1
        chosen.append(i)
        covered += gain
    for i in chosen[1:]:  # those that later ones made needless
        lost = int((times[sight[i]] == 1).sum())
        if covered - lost >= enough:
            times[sight[i]] -= 1
            covered -= lost
            chosen.remove(i)
    return chosen, covered / total


def shortest_order(cost: Array) -> list[int]:
    """A short way through all rows of a symmetric cost (n, n) that begins at the first and ends anywhere.

    >>> shortest_order(np.abs(np.subtract.outer([0.0, 3.0, 1.0, 2.0], [0.0, 3.0, 1.0, 2.0])))
    [0, 2, 3, 1]
    """
    left, order = set(range(1, len(cost))), [0]
    while left:
        order.append(min(left, key=lambda j: (cost[order[-1], j], j)))
        left.remove(order[-1])
    best = _length(cost, order)
    while True:
        order = _moved(cost, _reversed(cost, order))
        now = _length(cost, order)
        if now > best - 1e-9:
            return order
        best = now


def _reversed(cost: Array, order: list[int]) -> list[int]:
    """2-opt: turn pieces round while that makes the way shorter."""
    better = True
    while better:
        better = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                change = cost[order[i - 1], order[j]] - cost[order[i - 1], order[i]]
                if j + 1 < len(order):
                    change += cost[order[i], order[j + 1]] - cost[order[j], order[j + 1]]
                if change < -1e-9:
                    order = [*order[:i], *order[i : j + 1][::-1], *order[j + 1 :]]
                    better = True
    return order


def _moved(cost: Array, order: list[int]) -> list[int]:
    """Put single points elsewhere while that makes the way shorter."""
    for point in order[1:]:
        rest = [k for k in order if k != point]
        ways = [[*rest[:k], point, *rest[k:]] for k in range(1, len(order))]
        best = min(ways, key=lambda way: _length(cost, way))
        if _length(cost, best) < _length(cost, order) - 1e-9:
            order = best
    return order


def _length(cost: Array, order: list[int]) -> float:
    return float(cost[order[:-1], order[1:]].sum())


def _places(grid: OccupancyGrid, paths: SafePaths, least_room_m: float) -> Array:
    """The roomiest cell of each square of a lattice that can be driven to, shape (n, 2), [m]."""
    within: Mask = paths.within & (grid.to_walls_m >= least_room_m)
    if not within.any():
        within = paths.within
    cells = np.argwhere(within)
    step = round(LATTICE_M / grid.frame.resolution_m)
    square = (cells[:, 0] // step) * (grid.frame.shape[1] + 1) + cells[:, 1] // step
    order = np.lexsort((cells[:, 1], cells[:, 0], -paths.room_m[cells[:, 0], cells[:, 1]], square))
    _, first = np.unique(square[order], return_index=True)
    return grid.frame.centres(cells[order[first]])
