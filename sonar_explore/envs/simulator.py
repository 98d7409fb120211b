"""The simulated AmigoBot in a world: it drives, fires, scans and bumps. Only this file moves the true pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sonar_explore.amigobot import AmigoBot
from sonar_explore.checks import check_numbers
from sonar_explore.envs.acoustics import (
    SonarPhysics,
    echoes,
    measured,
    measured_by,
    measured_once,
    temperature_scale,
)
from sonar_explore.envs.leg import DRIVEN, LISTENED, SINCE_GLANCE, TIME, drive
from sonar_explore.envs.odometry import OdometryError, OdometryNoise, running_sum
from sonar_explore.envs.pings import turned_discs
from sonar_explore.envs.scene import Scene
from sonar_explore.envs.tick import ODOMETRY, OUTCOME, TRUE, drive_and_fire
from sonar_explore.envs.world import World
from sonar_explore.geometry import Array, Pose
from sonar_explore.measurement import Scan
from sonar_explore.planning.leg import BUMPED, Leg
from sonar_explore.planning.polyline import spaced
from sonar_explore.ring import RingPlan

SCAN_STEP_RAD = math.radians(4.0)  # section IV: 90 readings a turn
READINGS = 1000  # of a leg in one call
MAY_BE_ZERO = (
    *("robot.scan_sonar", "robot.range_min_m"),
    *("sonar.roughness", "sonar.sigma_m", "sonar.sigma_per_m", "sonar.dropout", "sonar.temperature_error_k"),
    *("noise.turn_sigma_rad", "noise.drift_sigma_rad", "noise.distance_sigma_m"),
)


@dataclass(frozen=True)
class SimulatorConfig:
    """The robot, its sonar and its wheels."""

    robot: AmigoBot = field(default_factory=AmigoBot)
    sonar: SonarPhysics = field(default_factory=SonarPhysics)
    noise: OdometryNoise = field(default_factory=OdometryNoise)
    scan_step_rad: float = SCAN_STEP_RAD
    """Turn between two readings of a scan, [rad]; must divide a full turn."""
    scan_all_discs: bool = True
    """Beyond the paper: all eight discs are recorded while the robot turns, not one."""

    def __post_init__(self) -> None:
        check_numbers(self, "simulator", or_zero=MAY_BE_ZERO)


class Simulator:
    """A robot in a world (implements `sonar_explore.robot.Robot`); the true pose is in `true_pose`."""

    def __init__(self, world: World, config: SimulatorConfig, rng: np.random.Generator) -> None:
        self.world = world
        self.config = config
        sonar = config.sonar
        self._scene = Scene.of(world, sonar.range_max_m, sonar.roughness)
        self._hearing = (*self._scene.plain, sonar.plain_ear, np.empty(1, dtype=np.int64))
        self._mounts = np.array([(disc.x, disc.y, disc.heading) for disc in config.robot.sonars])
        self.reset(rng)

    def reset(self, rng: np.random.Generator) -> None:
        """Back to the start, as another robot on another day: new systematic errors, new temperature."""
        self._rng = rng
        self._wheels = OdometryError(self.config.noise, self.config.robot.wheel_base_m, rng)
        self._range_scale = temperature_scale(self.config.sonar, rng)
        start = self.world.start
        self._state = np.zeros((4, 3))
        self._state[TRUE] = start.x, start.y, start.heading
        self.true_pose = start
        self.pose_robot_in_odometry = Pose(0.0, 0.0, 0.0)
        self.ring_m = np.full(len(self.config.robot.sonars), self.config.robot.range_max_m)
        self.bumper = False
        self.contacts = 0
        """Touches so far; a touch that lasts counts once."""
        self.time_s = 0.0
        self.driven_m = 0.0
        """Path length by the wheels, [m]."""
        self.true_trail: list[Pose] = []
        """True poses about every 5 cm driven; whoever reads it may clear it."""
        self._next_disc = 0

    def tick(self, speed_m_s: float, turn_rate_rad_s: float) -> None:
        """Drive for one ping interval, stop at a wall, fire the next disc of the ring."""
        robot = self.config.robot
        dt = robot.ping_interval_s
        speed_max, turn_rate_max = robot.speed_max_m_s, robot.turn_rate_max_rad_s
        forward = min(speed_max, max(-speed_max, speed_m_s)) * dt
        turn = min(turn_rate_max, max(-turn_rate_max, turn_rate_rad_s)) * dt
        disc = self._next_disc
        true_forward, true_turn = self._wheels.true_motion(forward, turn)
        drive_and_fire(
            self._state,
            forward,
            turn,
            true_forward,
            true_turn,
            robot.radius_m,
            self._mounts[disc],
            *self._hearing,
        )
        state = self._state.tolist()
        self.true_pose, self.pose_robot_in_odometry = Pose(*state[TRUE]), Pose(*state[ODOMETRY])
        range_m, touching, _ = state[OUTCOME]
        if touching:
            self.contacts += not self.bumper
        else:
            self.driven_m += abs(forward)
        self.bumper = bool(touching)
        if not self.true_trail or self.true_pose.distance_to(self.true_trail[-1]) >= 0.05:
            self.true_trail.append(self.true_pose)
        self.time_s += dt
        self.ring_m = self.ring_m.copy()
        self.ring_m[disc] = measured_once(range_m, self._range_scale, self.config.sonar, self._rng)
        self._next_disc = (disc + 1) % len(self._mounts)

    def turn(self, turn_rates_rad_s: Array) -> tuple[Array, Array]:
        """A tick on the spot at each rate, with the draws of single ones: all fire from one place, in one call."""
        robot, ticks = self.config.robot, len(turn_rates_rad_s)
        most = robot.turn_rate_max_rad_s
        turns = np.clip(turn_rates_rad_s, -most, most) * robot.ping_interval_s
        draws = _draws_of_ticks(self._rng, ticks)
        true_headings = running_sum(self.true_pose.heading, self._wheels.true_turns_by(turns, draws[:, 1]))
        counted = running_sum(self.pose_robot_in_odometry.heading, turns)
        fired = (self._next_disc + np.arange(ticks)) % len(self._mounts)
        discs = np.empty((ticks, 3))
        turned_discs(self.true_pose.x, self.true_pose.y, true_headings[1:], self._mounts[fired], discs)
        heard, _ = echoes(self._scene, discs, self.config.sonar)
        ranges = measured_by(heard, self._range_scale, self.config.sonar, draws[:, 2], draws[:, 3])
        rings = np.empty((ticks, len(self._mounts)))
        rings[:] = self.ring_m
        for k, disc in enumerate(fired.tolist()):
            rings[k:, disc] = ranges[k]
        first = replace(self.true_pose, heading=float(true_headings[1]))
        if not self.true_trail or first.distance_to(self.true_trail[-1]) >= 0.05:
            self.true_trail.append(first)
        odometry = np.empty((ticks, 3))
        odometry[:] = self.pose_robot_in_odometry.as_row()
        odometry[:, 2] = counted[1:]
        self.true_pose = replace(self.true_pose, heading=float(true_headings[-1]))
        self.pose_robot_in_odometry, self.ring_m = Pose(*odometry[-1].tolist()), rings[-1].copy()
        self._state[[TRUE, ODOMETRY], 2] = true_headings[-1], counted[-1]
        self._next_disc = (self._next_disc + ticks) % len(self._mounts)
        self.bumper = False
        for _ in range(ticks):
            self.time_s += robot.ping_interval_s
        return odometry, rings

    def drive_leg(self, leg: Leg) -> tuple[Array, Array]:
        """Drive on along a leg, to its end or for as long as there is room for readings: what `turn` returns, and one
        more wherever another corner is set out for. The leg moves on with it."""
        readings = max(READINGS, len(leg.glance_rad_s))
        trues, odometries = np.empty((2, readings + 1, 3))
        rings = np.empty((readings + 1, len(self.ring_m)))
        odometries[0], rings[0] = self._state[ODOMETRY], self.ring_m
        progress = np.array([leg.since_glance_m, leg.listened, self.time_s, self.driven_m])
        leg.end, leg.corner, ticks, count, held = drive(
            self._state,
            self._body,
            self._rng,
            self._hearing,
            self._next_disc,
            (leg.path, leg.corner, leg.steering, leg.glance_rad_s, leg.most_ticks - leg.ticks),
            leg.belief,
            leg.echoes.as_kernels_take_it(readings),
            progress,
            trues,
            odometries,
            rings,
        )
        leg.ticks += ticks
        leg.echoes.holds(held)
        leg.since_glance_m, leg.listened = float(progress[SINCE_GLANCE]), bool(progress[LISTENED])
        self.time_s, self.driven_m = progress[[TIME, DRIVEN]].tolist()
        last = self.true_trail[-1] if self.true_trail else None
        self.true_trail += spaced(trues[:ticks], last, 0.05)
        if ticks:
            touching = leg.end == BUMPED
            self.contacts += touching and not (ticks == 1 and self.bumper)
            self.bumper, self.ring_m = touching, rings[count].copy()
            self.true_pose = Pose(*trues[ticks - 1].tolist())
            self.pose_robot_in_odometry = Pose(*odometries[count].tolist())
        self._next_disc = (self._next_disc + ticks) % len(self._mounts)
        return odometries[1 : count + 1], rings[1 : count + 1]

    @property
    def _body(self) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
        """Body, wheels and sonar, as `envs.leg` takes them."""
        robot, sonar = self.config.robot, self.config.sonar
        return (
            (robot.speed_max_m_s, robot.turn_rate_max_rad_s, robot.ping_interval_s, robot.radius_m),
            self._wheels.as_kernels_take_it,
            (
                *(self._range_scale, sonar.sigma_m, sonar.sigma_per_m),
                *(sonar.dropout, sonar.quantum_m, sonar.range_max_m),
            ),
        )

    def scan(self, direction: int) -> Scan:
        """Turn once on the spot. The odometry error acts during the turn: the scan is smeared."""
        robot = self.config.robot
        count = round(2.0 * math.pi / self.config.scan_step_rad)
        step = direction * 2.0 * math.pi / count
        began = self.pose_robot_in_odometry
        true_headings = running_sum(self.true_pose.heading, self._wheels.true_turns(step, count))
        discs = [robot.scan_sonar]
        if self.config.scan_all_discs:
            discs += [disc for disc in range(len(robot.sonars)) if disc != robot.scan_sonar]
        headings = step * np.arange(count)
        heard = [
            Scan(
                pose_robot_in_odometry=began,
                headings_rad=headings,
                ranges_m=ranges,
                pose_sonar_in_robot=robot.sonars[disc],
                range_max_m=robot.range_max_m,
            )
            for disc, ranges in zip(
                discs, self._measure(self.true_pose, true_headings[:-1], discs), strict=True
            )
        ]
        self.true_pose = replace(self.true_pose, heading=float(true_headings[-1]))
        counted = running_sum(began.heading, np.full(count, step))
        self.pose_robot_in_odometry = replace(began, heading=float(counted[-1]))
        self._state[[TRUE, ODOMETRY], 2] = true_headings[-1], counted[-1]
        self.bumper = False
        self.time_s += count * (abs(step) / robot.turn_rate_max_rad_s + len(discs) * robot.ping_interval_s)
        return replace(heard[0], others=tuple(heard[1:]))

    def ring_scan(self, direction: int) -> Scan:
        """Turn by the ring's widest gap while its discs fire one after the other (`sonar_explore.ring`)."""
        robot, began = self.config.robot, self.pose_robot_in_odometry
        plan = RingPlan.of(robot, self.config.scan_step_rad, direction)
        turns = self._wheels.true_turns(plan.step_rad, plan.steps)
        true_headings = running_sum(self.true_pose.heading, turns)
        ranges = self._measure_ring(self.true_pose, true_headings[plan.at_step], plan.mounts)
        self.true_pose = replace(self.true_pose, heading=float(true_headings[-1]))
        counted = running_sum(began.heading, np.full(plan.steps, plan.step_rad))
        self.pose_robot_in_odometry = replace(began, heading=float(counted[-1]))
        self._state[[TRUE, ODOMETRY], 2] = true_headings[-1], counted[-1]
        self.bumper = False
        self.time_s += plan.steps * abs(plan.step_rad) / robot.turn_rate_max_rad_s
        self.time_s += len(plan.disc) * robot.ping_interval_s
        return Scan(
            pose_robot_in_odometry=began,
            headings_rad=plan.headings_rad,
            ranges_m=ranges,
            pose_sonar_in_robot=robot.sonars[robot.scan_sonar],
            range_max_m=robot.range_max_m,
            ring=plan.mounts,
        )

    def _measure(self, true_pose: Pose, true_headings: Array, discs: Sequence[int]) -> list[Array]:
        """Fire each of these discs at each of these headings; all together, for they share what they could hear."""
        n = len(true_headings)
        fired = np.empty((len(discs) * n, 3))
        mounts = np.repeat(self._mounts[list(discs)], n, axis=0)
        turned_discs(true_pose.x, true_pose.y, np.tile(true_headings, len(discs)), mounts, fired)
        ranges, _ = echoes(self._scene, fired, self.config.sonar)
        z, chance = np.empty((2, len(discs), n))
        for disc in range(len(discs)):  # as they would be drawn disc by disc
            self._rng.standard_normal(out=z[disc])
            self._rng.random(out=chance[disc])
        return list(
            measured_by(ranges.reshape(len(discs), n), self._range_scale, self.config.sonar, z, chance)
        )

    def _measure_ring(self, true_pose: Pose, true_headings: Array, mounts: Array) -> Array:
        """Fire discs mounted like this at these headings, one each."""
        c, s = np.cos(true_headings), np.sin(true_headings)
        x, y, heading = mounts.T
        places = (true_pose.x + c * x - s * y, true_pose.y + s * x + c * y, true_headings + heading)
        ranges, _ = echoes(self._scene, np.column_stack(places), self.config.sonar)
        return measured(ranges, self._range_scale, self.config.sonar, self._rng)


def _draws_of_ticks(rng: np.random.Generator, ticks: int) -> Array:
    """In the order of single ticks, shape (ticks, 4): of the way, of the turn, of the range; and the chance that the
    ping goes unheard."""
    draws = np.empty((ticks, 4))
    normal, uniform = rng.standard_normal, rng.random
    for z, chance in zip(draws[:, :3], draws[:, 3:], strict=True):
        normal(out=z)
        uniform(out=chance)
    return draws
