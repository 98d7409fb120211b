"""A whole leg of the way in one call of the simulator, steered by the robot's own belief.

It drives, hears and decides as `Simulator.tick` and `planning.driving.Driver` do tick by tick, in their arithmetic and
with their random numbers. What fires while the robot turns on the spot is heard together.
"""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel
from sonar_explore.envs.pings import fire_all
from sonar_explore.envs.tick import DISC, ODOMETRY, OUTCOME, TRUE, drive_a_tick, mounted
from sonar_explore.planning.echoes import NORMALS_RAD, note_echoes
from sonar_explore.planning.leg import (
    ARRIVED,
    BLOCKED,
    BUMPED,
    GLANCE,
    GO,
    LISTEN,
    MORE,
    SHUT,
    THERE,
    next_move,
)
from sonar_explore.slam.odometry_filter import carried

SINCE_GLANCE, LISTENED, TIME, DRIVEN = range(4)
"""Of the progress: metres since a glance; whether the robot has listened, 0/1; time, [s]; metres driven."""


@kernel
def drive(  # type: ignore[no-untyped-def]
    state, robot, rng, hearing, disc, leg, belief, echoes, progress, trues, odometries, rings
):
    """How it ended, the corner that the robot is at or goes to, how many ticks it drove, how many readings there are,
    and how many echoes are held. There is a reading of each tick, and one where another corner is set out for.

    Args:
        state: of the simulator (`envs.tick`), moved on.
        robot: body, wheels and sonar, as `_motion` and `_reported` take them.
        rng: the simulator's generator.
        hearing: as `drive_and_fire` takes it.
        disc: which fires first.
        leg: path, the corner to go to, steering and turn rates of a glance as `planning.leg` has them; most ticks.
        belief, echoes: as `planning.leg` has them, moved on.
        progress: shape (4,), moved on.
        trues: poses after each tick, shape (n, 3), filled.
        odometries: poses at each reading, after that before the first, shape (1 + n, 3), filled.
        rings: the same of the latest echo of each disc, shape (1 + n, 8), [m].
    """
    path, corner, steering, glance, most = leg
    pieces, count, last, mounts, silence, points = echoes
    draws, same = np.empty((len(rings), 4)), np.empty(len(rings))
    fired, heard, kinds = (
        np.empty((len(rings), 3)),
        np.empty(len(rings)),
        np.empty(len(rings), dtype=np.int64),
    )
    poses, spread = np.empty((len(rings), 3)), np.empty(5)
    ticks, done = 0, 1
    while True:
        move, speed, rate, n = THERE, 0.0, 0.0, 1
        if ticks < most:
            x, y, since, listened = (
                path[corner, 0],
                path[corner, 1],
                progress[SINCE_GLANCE],
                progress[LISTENED],
            )
            move, speed, rate, n = next_move(steering, x, y, belief, pieces, count, since, listened > 0.0)
            n = len(glance) if move == GLANCE else len(mounts) if move == LISTEN else min(n, most - ticks)
        if move == SHUT or (move == THERE and corner == len(path) - 1):
            return BLOCKED if move == SHUT else ARRIVED, corner, ticks, done - 1, count
        n = min(n, len(rings) - 1)
        if done + n > len(rings) or count + len(NORMALS_RAD) * n > len(pieces):
            return MORE, corner, ticks, done - 1, count
        if move == THERE:
            corner += 1
            _copy(state[ODOMETRY], odometries[done])
            _copy(rings[done - 1], rings[done])
            carried(odometries[done - 1], odometries[done], belief, spread)
            done += 1
            continue
        for k in range(n):
            same[k] = rate
            for z in range(3):
                draws[k, z] = rng.standard_normal()
            draws[k, 3] = rng.random()
        touching = False
        if move == GO:
            touching = _go(state, robot, speed, rate, draws[0], mounts[disc], hearing, progress)
            _note(state, trues[ticks], odometries[done])
            _copy(state[DISC], fired[0])
        else:
            rates = glance if move == GLANCE else same[:n]
            _turn(state, robot, rates, draws, mounts, disc, fired, trues[ticks:], odometries[done:])
            progress[SINCE_GLANCE] = 0.0 if move == GLANCE else since
            progress[LISTENED] = 1.0 if move == LISTEN else listened
        fire_all(fired[:n], hearing[0], hearing[1], hearing[2], hearing[3], heard[:n], kinds[:n])
        _take_in(
            heard[:n], draws, robot, disc, rings[done - 1 :], odometries[done - 1 :], belief, poses, spread
        )
        for _ in range(n):
            progress[TIME] += robot[0][2]
        count = note_echoes(pieces, count, poses[:n], rings[done : done + n], last, mounts, silence, points)
        disc = (disc + n) % len(mounts)
        ticks, done = ticks + n, done + n
        if touching:
            return BUMPED, corner, ticks, done - 1, count


@inner_kernel
def _go(state, robot, speed, rate, draws, mount, hearing, progress):  # type: ignore[no-untyped-def]
    """One tick ahead; whether it touched a wall."""
    forward, turn, true_forward, true_turn = _motion(speed, rate, draws, robot)
    radius, dt = robot[0][3], robot[0][2]
    drive_a_tick(state, forward, turn, true_forward, true_turn, radius, mount, hearing[0], hearing[1])
    touching = state[OUTCOME, 1] > 0.0
    progress[SINCE_GLANCE] += speed * dt
    progress[DRIVEN] += 0.0 if touching else abs(forward)
    return touching


@inner_kernel
def _turn(state, robot, rates, draws, mounts, disc, fired, trues, odometries):  # type: ignore[no-untyped-def]
    """A tick on the spot at each of these rates; from where each disc fires."""
    for k in range(len(rates)):
        _, turn, _, true_turn = _motion(0.0, rates[k], draws[k], robot)
        state[TRUE, 2] += true_turn
        state[ODOMETRY, 2] += turn
        _note(state, trues[k], odometries[k])
        mounted(state[TRUE], mounts[(disc + k) % len(mounts)], fired[k])


@inner_kernel
def _take_in(heard, draws, robot, disc, rings, odometries, belief, poses, spread):  # type: ignore[no-untyped-def]
    """What was heard at some ticks goes into the rings, where the robot believes to be into `poses`; the first rows of
    rings and odometries are those before."""
    for k in range(len(heard)):
        _copy(rings[k], rings[k + 1])
        fired = (disc + k) % rings.shape[1]
        rings[k + 1, fired] = _reported(heard[k], draws[k, 2], draws[k, 3], robot[2])
        carried(odometries[k], odometries[k + 1], belief, spread)
        _copy(belief[:3], poses[k])


@inner_kernel
def _motion(speed, rate, draws, robot):  # type: ignore[no-untyped-def]
    """Way [m] and turn [rad] of a tick by the odometry, and in truth (`OdometryError.true_motion`).

    Args:
        speed, rate: what the wheels are told, [m/s] and [rad/s].
        draws: standard normal ones for both.
        robot: body, of greatest speed [m/s] and turn rate [rad/s], length of a tick [s] and radius [m]; wheels, as
            `OdometryError.as_kernels_take_it`; and sonar.
    """
    speed_max, turn_rate_max, dt, _ = robot[0]
    curvature, turn_scale, distance_sigma, turn_variance, drift_variance = robot[1]
    forward = min(speed_max, max(-speed_max, speed)) * dt
    turn = min(turn_rate_max, max(-turn_rate_max, rate)) * dt
    distance = abs(forward)
    heading_sigma = math.sqrt(turn_variance * (abs(turn) / (2.0 * math.pi)) + drift_variance * distance)
    true_forward = forward + distance_sigma * math.sqrt(distance) * draws[0]
    return forward, turn, true_forward, turn * turn_scale + curvature * forward + heading_sigma * draws[1]


@inner_kernel
def _reported(range_m, z, chance, sonar):  # type: ignore[no-untyped-def]
    """A range as the electronics report it, [m] (`acoustics.measured_once`), with these draws.

    `sonar`: scale of ranges, noise [m] and its growth [m/m], chance of a dropout, quantum [m], greatest range [m].
    """
    scale, sigma, sigma_per_m, dropout, quantum, range_max = sonar
    if chance < dropout or range_m >= range_max:
        return range_max
    noisy = range_m * scale + (sigma + sigma_per_m * range_m) * z
    return min(max(np.rint(noisy / quantum) * quantum, 0.0), range_max)


@inner_kernel
def _note(state, true, odometry):  # type: ignore[no-untyped-def]
    """Where the robot is, and where by its odometry."""
    _copy(state[TRUE], true)
    _copy(state[ODOMETRY], odometry)


@inner_kernel
def _copy(row, to):  # type: ignore[no-untyped-def]
    for k in range(len(row)):
        to[k] = row[k]
