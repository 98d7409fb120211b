"""A Rao-Blackwellised particle filter over occupancy grids (Doucet et al. 2000; Hähnel et al. 2003; gmapping).

Each particle is one way that the robot may have gone, with the grid that follows from it. Odometry spreads the
particles, a scan weighs them by how well its end points fit each one's own grid, and where few carry all the
weight they are drawn anew (Thrun, Burgard and Fox, Probabilistic Robotics, table 13.4 and section 6.4).

As in gmapping a cell keeps the mean of the points that hit it, so that a coarse grid says more than its cells'
size; here also their mean direction, because a sonar hears which way a wall faces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonar_explore.geometry import Array, Pose, wrap_undirected
from sonar_explore.mapping.grid import GridFrame
from sonar_explore.slam.baselines.end_points import EndPoints, feet_of, placed

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class ParticleConfig:
    """How many, how fine, and how far a scan is believed."""

    particles: int = 40
    tries: int = 30
    """Poses drawn for each particle by odometry, and again about the likely ones, as in gmapping."""
    cell_m: float = 0.10
    """Side of a cell, [m]."""
    distance_m: float = 0.02
    """Standard deviation of an end point from the wall that its cell holds, [m]."""
    angle_rad: float = math.radians(0.6)
    """Standard deviation of its direction from theirs, [rad]."""
    outlier: float = 0.001
    """Share of end points that are of nothing on the grid."""
    resample_below: float = 0.5
    """Draw anew when the effective number of particles is less than this share."""
    occupied_share: float = 0.1
    """A cell is occupied when at least this share of the scans that met it hit it."""
    seed: int = 1
    """Of the particles' draws."""


class ParticleFilter:
    """Poses, weights and grids of all particles."""

    def __init__(self, start: Pose, config: ParticleConfig) -> None:
        self._config = config
        self._rng = np.random.default_rng(config.seed)
        n = config.particles
        self.poses: Array = np.tile([start.x, start.y, start.heading], (n, 1))
        """x, y [m], heading [rad] of each particle now, shape (particles, 3)."""
        self._motion: tuple[Array, Array] | None = None
        self._log_weights = np.zeros(n)
        self._paths: list[Array] = []
        self._grids = _Grids(n, config, start)

    @property
    def path(self) -> Array:
        """Mean over the particles: x, y [m], heading [rad] of every scan, shape (scans, 3)."""
        share = np.exp(self._log_weights - self._log_weights.max())
        share /= share.sum()
        paths = np.array(self._paths)
        return paths[:, 0] + np.einsum("p,spk->sk", share, paths - paths[:, :1])  # exact where all agree

    def place(self, pose: Pose) -> None:
        """All stand here for sure."""
        self.poses[:] = pose.x, pose.y, pose.heading
        self._motion = None

    def move(self, motion: Pose, covariance: Array) -> None:
        """Say how the particles have gone on since the last scan, as the odometry has it.

        Args:
            motion: `pose_robot_in_last_scan`.
            covariance: of it, x y [m] heading [rad], shape (3, 3).
        """
        root = np.linalg.cholesky(covariance + np.diag(LEAST))
        self._motion = np.array([motion.x, motion.y, motion.heading]), root

    def weigh(self, points: EndPoints) -> None:
        """Let the scan choose among the ways and weigh the particles, then put it on every grid."""
        if self._motion is not None:
            self._choose(feet_of(points), *self._motion)
            self._motion = None
            self._resample()
        self._grids.clear(self.poses, points)
        self._grids.hit(*placed(points, self.poses))
        self._paths.append(self.poses.copy())

    def _choose(self, points: EndPoints, motion: Array, root: Array) -> None:
        """A pose for each particle from where both odometry and scan are likely (Grisetti et al. 2007, section III).

        Tries by odometry alone, weighed by the scan, say where that is; tries drawn from there, weighed by scan and
        odometry over the density that drew them, stand for the posterior, and their mean for the particle's weight.
        """
        n, k = len(self.poses), self._config.tries
        blind = self._rng.standard_normal((n, k, 3))
        share = _shares(self._fit(points, motion, root, blind))
        mean = np.einsum("nk,nki->ni", share, blind)
        off = blind - mean[:, None]
        spread = np.linalg.cholesky(np.einsum("nk,nki,nkj->nij", share, off, off) + NARROWEST**2 * np.eye(3))
        drawn = self._rng.standard_normal((n, k, 3))
        tries = mean[:, None] + np.einsum("nij,nkj->nki", spread, drawn)
        log_density = -0.5 * (drawn**2).sum(axis=-1) - np.log(np.linalg.det(spread))[:, None]
        weight = self._fit(points, motion, root, tries) - 0.5 * (tries**2).sum(axis=-1) - log_density
        best = weight.max(axis=1)
        self._log_weights += best + np.log(np.exp(weight - best[:, None]).mean(axis=1))
        self._log_weights -= self._log_weights.max()
        below = np.cumsum(_shares(weight), axis=1)
        chosen = np.minimum((below < self._rng.uniform(size=(n, 1))).sum(axis=1), k - 1)
        self.poses = self._moved(motion, root, tries)[np.arange(n), chosen]

    def _moved(self, motion: Array, root: Array, tries: Array) -> Array:
        """Poses after the motion and a random part in units of its spread, shape (particles, tries, 3)."""
        step = motion + tries @ root.T
        c, s = np.cos(self.poses[:, 2:]), np.sin(self.poses[:, 2:])
        moved = [c * step[..., 0] - s * step[..., 1], s * step[..., 0] + c * step[..., 1], step[..., 2]]
        return self.poses[:, None] + np.stack(moved, axis=-1)

    def _fit(self, points: EndPoints, motion: Array, root: Array, tries: Array) -> Array:
        """Log-likelihood of the scan at each try on its particle's grid, shape (particles, tries)."""
        n, k = tries.shape[:2]
        xy, normal = placed(points, self._moved(motion, root, tries).reshape(-1, 3))
        fit = self._grids.log_likelihood(xy.reshape(n, -1, 2), normal.reshape(n, -1)).reshape(n, k, -1)
        return np.asarray(fit.sum(axis=-1))

    def _resample(self) -> None:
        """Systematic resampling (table 4.4)."""
        weights = np.exp(self._log_weights)
        weights /= weights.sum()
        n = len(weights)
        if 1.0 / (weights**2).sum() >= self._config.resample_below * n:
            return
        at = (self._rng.uniform() + np.arange(n)) / n
        drawn = np.minimum(np.searchsorted(np.cumsum(weights), at), n - 1)
        self.poses = self.poses[drawn]
        self._paths = [poses[drawn] for poses in self._paths]
        self._grids.draw(drawn)
        self._log_weights = np.zeros(n)


def _shares(log_weights: Array) -> Array:
    """Weights that add up to one, shape (n, k)."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


NARROWEST = 0.2
"""Of the second tries' spread, as a share of the odometry's."""
LEAST = (1e-6, 1e-6, 1e-8)
"""Variance that any motion has, x y [m2], heading [rad2]."""
HITS, X, Y, COS, SIN, MISSES = range(6)
_NEIGHBOURS = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])


class _Grids:
    """One grid a particle, all over the same cells, shape (particles, rows, columns, 6)."""

    def __init__(self, particles: int, config: ParticleConfig, start: Pose) -> None:
        self._config = config
        size = config.cell_m
        self._frame = GridFrame(
            math.floor(start.x / size) * size, math.floor(start.y / size) * size, size, (1, 1)
        )
        self._cells = np.zeros((particles, 1, 1, 6), dtype=np.float32)

    def log_likelihood(self, xy: Array, normal: Array) -> Array:
        """Of end points, shape (particles, n, 2), with walls' normals, shape (particles, n): shape (particles, n)."""
        cfg = self._config
        self._cover(xy)
        particle, row, column = self._at(xy)
        near = self._cells[
            particle[..., None], row[..., None] + _NEIGHBOURS[:, 0], column[..., None] + _NEIGHBOURS[:, 1]
        ].astype(float)
        hits = near[..., HITS]
        occupied = (hits > 0.0) & (hits >= cfg.occupied_share * (hits + near[..., MISSES]))
        mean = near[..., X : Y + 1] / np.maximum(hits, 1.0)[..., None]
        faces = 0.5 * np.arctan2(near[..., SIN], near[..., COS])
        off = xy[:, :, None, :] - mean
        across = off[..., 0] * np.cos(faces) + off[..., 1] * np.sin(faces)
        along = off[..., 1] * np.cos(faces) - off[..., 0] * np.sin(faces)
        turn = wrap_undirected(normal[..., None] - faces)
        squared = (across / cfg.distance_m) ** 2 + (turn / cfg.angle_rad) ** 2
        squared += np.maximum(0.0, np.abs(along) / cfg.cell_m - 1.0) ** 2
        fit = np.where(occupied, np.exp(-0.5 * squared), 0.0).max(axis=-1)
        return np.asarray(np.log(cfg.outlier + (1.0 - cfg.outlier) * fit))

    def hit(self, xy: Array, normal: Array) -> None:
        """Put end points on the grids."""
        self._cover(xy)
        at = self._at(xy)
        values = np.stack(
            [np.ones_like(normal), xy[..., 0], xy[..., 1], np.cos(2 * normal), np.sin(2 * normal)], axis=-1
        )
        for k in range(values.shape[-1]):
            np.add.at(self._cells[..., k], at, values[..., k].astype(np.float32))

    def clear(self, poses: Array, points: EndPoints) -> None:
        """Count a miss, once a scan, for every cell on the way to a wall's foot.

        A sonar hears nothing of a wall that it looks at obliquely: the normals alone are sure to be clear.
        """
        size = self._frame.resolution_m
        feet = points.foot > 0.0
        steps = np.arange(1, math.ceil(points.range_m.max(initial=0.0) / size) + 1) * size
        foot, step = np.nonzero(steps[None, :] < points.range_m[feet, None] - 1.5 * size)
        direction = poses[:, 2:] + points.bearing[feet][foot]
        along = np.stack([np.cos(direction), np.sin(direction)], axis=-1)
        xy = poses[:, None, :2] + steps[step][:, None] * along
        self._cover(xy)
        passed = np.zeros(self._cells.shape[:3], dtype=bool)
        passed[self._at(xy)] = True
        self._cells[..., MISSES] += passed

    def draw(self, particles: Rows) -> None:
        """Copy the grids of the particles drawn."""
        self._cells = self._cells[particles]

    def _at(self, xy: Array) -> tuple[Rows, Rows, Rows]:
        """Particle, row and column of points, shape (particles, n, 2): shape (particles, n) each."""
        cells = self._frame.cells(xy.reshape(-1, 2)).reshape(xy.shape)
        return np.broadcast_to(np.arange(len(xy))[:, None], xy.shape[:2]), cells[..., 0], cells[..., 1]

    def _cover(self, xy: Array) -> None:
        """Grow until the points and their neighbours lie on the grid."""
        if not xy.size:
            return
        margin = 2.0 * self._frame.resolution_m
        low, high = xy.reshape(-1, 2).min(axis=0) - margin, xy.reshape(-1, 2).max(axis=0) + margin
        old = self._frame
        self._frame = old.covering((float(low[0]), float(low[1])), (float(high[0]), float(high[1])), 2.0)
        if self._frame == old:
            return
        row = round((old.y0 - self._frame.y0) / old.resolution_m)
        column = round((old.x0 - self._frame.x0) / old.resolution_m)
        grown = np.zeros((len(self._cells), *self._frame.shape, 6), dtype=np.float32)
        grown[:, row : row + old.shape[0], column : column + old.shape[1]] = self._cells
        self._cells = grown
