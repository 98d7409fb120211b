"""How far the body is from the nearest wall."""

from __future__ import annotations

import math

from sonar_explore.compiled import lean_kernel
from sonar_explore.envs.pings import cell_of
from sonar_explore.envs.scene import Scene

_HAIR_M2 = 1e-9  # more than rounding can do to the square of the nearest distance


def clearance(scene: Scene, x: float, y: float) -> float:
    """Distance from a point to the nearest wall or to the surface of the nearest column, [m]; inf far outside."""
    return float(clearance_at(x, y, scene.things, scene.index))


@lean_kernel
def clearance_at(x, y, things, index):  # type: ignore[no-untyped-def]
    """`clearance` for kernels."""
    walls, cylinders = things.walls, things.cylinders
    best, limit = math.inf, math.inf
    cell = cell_of(x, y, index.frame)
    if cell < 0:
        return best
    for k in range(index.wall_first[cell], index.wall_first[cell + 1]):
        i = index.wall_items[k]
        ax, ay = walls[i, 0], walls[i, 1]
        ex, ey = walls[i, 2] - ax, walls[i, 3] - ay
        t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
        t = min(1.0, max(0.0, t))
        dx, dy = x - ax - t * ex, y - ay - t * ey
        if dx * dx + dy * dy < limit:  # the rest is farther off, however its distance is rounded
            best = min(best, math.hypot(dx, dy))
            limit = best * best + _HAIR_M2
    for k in range(index.cylinder_first[cell], index.cylinder_first[cell + 1]):
        i = index.cylinder_items[k]
        best = min(best, math.hypot(x - cylinders[i, 0], y - cylinders[i, 1]) - cylinders[i, 2])
    return best
