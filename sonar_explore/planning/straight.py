"""A straight bit of way, driven without asking anybody until something is to be decided."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sonar_explore.compiled import inner_kernel
from sonar_explore.geometry import Array
from sonar_explore.planning.echoes import EchoMemory, glance_after, nearest_danger


@dataclass(eq=False)
class StraightBit:
    """Where to, how, by what belief, and what to look out for; who drives it moves belief and echoes on."""

    steering: tuple[float, ...]
    """As `steered` takes it."""
    since_glance_m: float
    """Driven since the last glance, [m]."""
    belief: Array
    """As `odometry_filter.carried` takes it, shape (11,)."""
    echoes: EchoMemory
    """What was heard near by."""
    most_ticks: int
    """How long to go on without asking."""


@inner_kernel
def steered(steering, belief, pieces, count, since_glance):  # type: ignore[no-untyped-def]
    """Speed [m/s] and turn rate [rad/s] of the next tick; a negative speed where something is to be decided first.

    The same decisions as in `driving.Driver`, which makes them itself before it goes on.

    Args:
        steering: x y of the end, [m]; how near is there, [m]; how far off is straight, [rad]; speed, [m/s]; how far
            ahead and beside the way must be clear, [m]; after how many metres to glance; what the robot can turn,
            [rad/s]; and the length of a tick, [s].
        belief: where the robot is, x y [m] heading [rad], and more.
        pieces, count: what was heard near by.
        since_glance: metres driven since the last one.
    """
    x, y, arrived, aligned, cruising, brake, beside, glance_every, fastest, tick = steering
    dx, dy = x - belief[0], y - belief[1]
    distance = math.sqrt(dx * dx + dy * dy)
    error = math.pi - (math.pi - (math.atan2(dy, dx) - belief[2])) % (2.0 * math.pi)
    far = distance > 3.0 * arrived
    if distance <= arrived or (distance <= 2.0 * arrived and abs(error) > 0.5 * math.pi):
        return -1.0, 0.0
    if abs(error) > (aligned if far else max(aligned, 0.5)) or (since_glance >= glance_every and far):
        return -1.0, 0.0
    if count:
        c, s = math.cos(belief[2]), math.sin(belief[2])
        if far and since_glance >= glance_after(
            pieces, count, belief[0], belief[1], c, s, beside, glance_every
        ):
            return -1.0, 0.0
        ahead = min(brake, distance)
        if nearest_danger(pieces, count, belief[0], belief[1], c, s, ahead, beside) >= 0:
            return -1.0, 0.0
    rate = max(-fastest, min(fastest, error / tick))
    return min(cruising, distance / tick), rate if far else 0.0
