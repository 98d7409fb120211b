"""A leg of the way: what a robot does next on it, decided from its belief and from what it heard near by."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sonar_explore.compiled import lean_kernel
from sonar_explore.geometry import Array
from sonar_explore.planning.echoes import EchoMemory, glance_after, nearest_danger

THERE, TURN, LISTEN, GLANCE, SHUT, GO = range(6)
"""What comes next: the next corner; turning on the spot; listening; a glance; something in the way; straight on."""
ARRIVED, BLOCKED, BUMPED, MORE = range(4)
"""How a call ends; MORE asks for another one."""


@dataclass(eq=False)
class Leg:
    """Where to, how, by what belief, and what to look out for; who drives it moves it on, belief and echoes as well."""

    path: Array
    """Corners after the start, x y, shape (n, 2), map frame, [m]."""
    steering: tuple[float, ...]
    """As `next_move` takes it."""
    glance_rad_s: Array
    """Turn rates of the ticks of a glance, shape (k,), [rad/s]."""
    belief: Array
    """As `odometry_filter.carried` takes it, shape (11,)."""
    echoes: EchoMemory
    """What was heard near by."""
    most_ticks: int
    """No longer than this."""
    listened: bool
    """Whether every disc has fired since the last scan."""
    since_glance_m: float
    """Driven since the last glance, [m]."""
    corner: int = 0
    """Which one the robot goes to."""
    ticks: int = 0
    """So far."""
    end: int = MORE
    """How it ended."""


@lean_kernel
def next_move(steering, x, y, pose, pieces, count, since_glance, listened):  # type: ignore[no-untyped-def]
    """What comes next, speed [m/s], turn rate [rad/s], and for how many ticks they surely are right.

    Args:
        steering: how near is there, [m]; how far off is straight, [rad]; speed, [m/s]; how far ahead and beside the
            way must be clear, [m]; after how many metres to glance; what the robot can turn, [rad/s]; and the length
            of a tick, [s].
        x, y: the corner, map frame, [m].
        pose: where the robot believes to be, x y [m] heading [rad], and more.
        pieces, count: what was heard near by (`planning.echoes`).
        since_glance: metres driven since the last one.
        listened: whether every disc has fired since the last scan.
    """
    arrived, aligned, cruising, brake, beside, glance_every, fastest, tick = steering
    dx, dy = x - pose[0], y - pose[1]
    distance = math.sqrt(dx * dx + dy * dy)
    error = math.pi - (math.pi - (math.atan2(dy, dx) - pose[2])) % (2.0 * math.pi)
    if distance <= arrived or (distance <= 2.0 * arrived and abs(error) > math.pi / 2):
        return THERE, 0.0, 0.0, 1
    far = distance > 3.0 * arrived
    rate = max(-fastest, min(fastest, error / tick))
    enough = aligned if far else max(aligned, 0.5)
    if abs(error) > enough:  # turning for so long turns by less than what is left, even as the belief has it
        full = fastest * tick
        return TURN, 0.0, rate, max(1, int(math.floor((abs(error) - enough - full) / (1.1 * full))))
    if not listened:  # a wall close ahead: the disc that hears it may not have fired since
        return LISTEN, 0.0, 0.0, 1
    if count or far:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        if far and since_glance >= glance_after(pieces, count, pose[0], pose[1], c, s, beside, glance_every):
            return GLANCE, 0.0, 0.0, 1
        if nearest_danger(pieces, count, pose[0], pose[1], c, s, min(brake, distance), beside) >= 0:
            return SHUT, 0.0, 0.0, 1
    return GO, min(cruising, distance / tick), rate if far else 0.0, 1
