"""One tick of the simulator in one call: two small arcs, a look out for walls, a ping."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.envs.collision import clearance_at
from sonar_explore.envs.pings import Index, Things, fire_all

TRUE, ODOMETRY, DISC, OUTCOME = range(4)
"""Rows of the state, shape (4, 3): x y heading of robot, odometry and disc [m, rad]; range [m] and touch 0/1."""


@lean_kernel
def drive_and_fire(  # type: ignore[no-untyped-def]
    state, forward, turn, true_forward, true_turn, radius, mount, things, index, room, ear, kinds
):
    """`drive_a_tick`; then the disc fires."""
    drive_a_tick(state, forward, turn, true_forward, true_turn, radius, mount, things, index)
    fire_all(state[DISC : DISC + 1], things, index, room, ear, state[OUTCOME, 0:1], kinds)


@inner_kernel
def drive_a_tick(state, forward, turn, true_forward, true_turn, radius, mount, things, index):  # type: ignore[no-untyped-def]
    """Move `state` on: the odometry records what was asked, the truth does what the wheels make of it.

    At a wall the wheels stall: no way forward, but the robot can turn. The disc mounted like this goes with it.
    """
    true, odometry, disc, outcome = state[TRUE], state[ODOMETRY], state[DISC], state[OUTCOME]
    x, y, heading = _arc(true[0], true[1], true[2], true_forward, true_turn)
    touching = False
    if forward != 0.0:  # a body overlaps a wall after a move that did not take it away from one
        gap = clearance_at(x, y, Things(*things), Index(*index))
        touching = gap < radius and gap <= clearance_at(true[0], true[1], Things(*things), Index(*index))
    if touching:
        x, y, heading, forward = true[0], true[1], true[2] + true_turn, 0.0
    true[0], true[1], true[2] = x, y, heading
    odometry[0], odometry[1], odometry[2] = _arc(odometry[0], odometry[1], odometry[2], forward, turn)
    mounted(true, mount, disc)
    outcome[1] = touching


@inner_kernel
def mounted(body, mount, disc):  # type: ignore[no-untyped-def]
    """Where the disc mounted like this on a body is, and where to: x y [m] heading [rad] all."""
    x, y, heading = body[0], body[1], body[2]
    c, s = math.cos(heading), math.sin(heading)
    disc[0], disc[1] = x + c * mount[0] - s * mount[1], y + s * mount[0] + c * mount[1]
    disc[2] = heading + mount[2]


@inner_kernel
def _arc(x, y, heading, forward, turn):  # type: ignore[no-untyped-def]
    """Exact motion along an arc of constant curvature."""
    half = 0.5 * turn
    chord = forward * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    along = heading + half
    return x + chord * math.cos(along), y + chord * math.sin(along), heading + turn
