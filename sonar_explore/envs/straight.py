"""Many ticks of the simulator in one call: a straight bit of way, steered by the robot's own belief.

It drives, hears and decides as `Simulator.tick` and `planning.driving.Driver` do tick by tick, in their arithmetic.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import kernel
from sonar_explore.envs.tick import ODOMETRY, OUTCOME, TRUE, drive_and_fire
from sonar_explore.planning.echoes import note_echoes
from sonar_explore.planning.straight import steered
from sonar_explore.slam.odometry_filter import carried


@kernel
def straight(  # type: ignore[no-untyped-def]
    state,
    body,
    wheels,
    sonar,
    disc,
    draws,
    hearing,
    steering,
    belief,
    echoes,
    ring,
    progress,
    trues,
    odometries,
    rings,
):
    """How many ticks were driven, and how many echoes are held then.

    Args:
        state: of the simulator (`envs.tick`), moved on.
        body: greatest speed [m/s] and turn rate [rad/s], length of a tick [s], radius [m].
        wheels: as `OdometryError.as_kernels_take_it`.
        sonar: scale of ranges, noise [m] and its growth [m/m], chance of a dropout, quantum [m], greatest range [m].
        disc: which fires first.
        draws: random numbers of each tick, shape (ticks, 4).
        hearing: as `drive_and_fire` takes it.
        steering, belief, echoes: as `planning.straight` has them.
        ring: latest echo of each disc, shape (8,), [m], moved on.
        progress: metres since a glance, time [s], metres driven, moved on.
        trues, odometries: poses after each tick, shape (ticks, 3), filled.
        rings: the ring after each tick, shape (ticks, 8), [m], filled.
    """
    speed_max, turn_rate_max, dt, radius = body
    curvature, turn_scale, distance_sigma, turn_variance, drift_variance = wheels
    scale, sigma, sigma_per_m, dropout, quantum, range_max = sonar
    things, index, room, ear, kinds = hearing
    pieces, count, last, mounts, silence, points = echoes
    before, spread, pose = np.empty(3), np.empty(5), np.empty((1, 3))
    ticks = 0
    while ticks < len(draws):
        speed, rate = steered(steering, belief, pieces, count, progress[0])
        if speed < 0.0:
            break
        forward = min(speed_max, max(-speed_max, speed)) * dt
        turn = min(turn_rate_max, max(-turn_rate_max, rate)) * dt
        distance = abs(forward)
        heading_sigma = math.sqrt(turn_variance * (abs(turn) / (2.0 * math.pi)) + drift_variance * distance)
        true_forward = forward + distance_sigma * math.sqrt(distance) * draws[ticks, 0]
        true_turn = turn * turn_scale + curvature * forward + heading_sigma * draws[ticks, 1]
        for k in range(3):
            before[k] = state[ODOMETRY, k]
        drive_and_fire(
            state,
            forward,
            turn,
            true_forward,
            true_turn,
            radius,
            mounts[disc],
            things,
            index,
            room,
            ear,
            kinds,
        )
        touching = state[OUTCOME, 1] > 0.0
        range_m = state[OUTCOME, 0]
        noisy = range_m * scale + (sigma + sigma_per_m * range_m) * draws[ticks, 2]
        if draws[ticks, 3] < dropout or range_m >= range_max:
            ring[disc] = range_max
        else:
            ring[disc] = min(max(np.rint(noisy / quantum) * quantum, 0.0), range_max)
        carried(before, state[ODOMETRY], belief, spread)
        for k in range(3):
            pose[0, k], trues[ticks, k], odometries[ticks, k] = belief[k], state[TRUE, k], state[ODOMETRY, k]
        for k in range(len(ring)):
            rings[ticks, k] = ring[k]
        count = note_echoes(pieces, count, pose, ring.reshape(1, len(ring)), last, mounts, silence, points)
        progress[0] += speed * dt
        progress[1] += dt
        progress[2] += 0.0 if touching else distance
        disc = (disc + 1) % len(mounts)
        ticks += 1
        if touching:
            break
    return ticks, count
