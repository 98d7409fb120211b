"""The rows of the smoother's Jacobian: each kind of factor, linearised at the unknowns as they are now."""

from __future__ import annotations

import math

from sonar_explore.compiled import inner_kernel, lean_kernel
from sonar_explore.slam.smoothing.factor_graph import FactorKind

START, ROBOT, TURN, ODOMETRY, LINE, POINT, COLUMN, RADIUS = (int(kind) for kind in FactorKind)
HUBER, CAUCHY = 1.5, 2.0  # sigmas
FIRMLY = 1e4  # one over the standard deviation of where the first scan stands, [1/m] and [1/rad]


@lean_kernel
def linearised(kinds, ends, measured, anchors, huber, known, stale, rows, off, shared, touched):  # type: ignore[no-untyped-def]
    """Factors from `known` on, and those of stale variables, anew: `rows` and `off` by the robust weights of now. Their
    variables are `touched`.

    Args:
        kinds: with `ends`, `measured` and `anchors` those of a `FactorGraph`, as `rows`, `off` and `shared`.
        huber: whether what is heard has Huber's loss, else Cauchy's.
        stale: shape (variables,).
    """
    if known == 0:
        for j in range(3):
            for k in range(4):
                shared[j, k] = 0.0
    for f in range(len(kinds)):
        a, b = ends[f, 0], ends[f, 1]
        if f < known and not stale[a] and (b < 0 or not stale[b]):
            continue
        row, residual = rows[f], off[f]
        if f < known:
            _share(row, residual, -1.0, shared)
        squared = _linearise(kinds[f], measured[f], anchors, a, b, row, residual)
        if squared >= 0.0:
            weight = math.sqrt(_huber(squared) if huber else _cauchy(squared))
            for i in range(2):
                residual[i] *= weight
                for j in range(11):
                    row[i, j] *= weight
        _share(row, residual, 1.0, shared)
        touched[a] = touched[0] = True
        if b >= 0:
            touched[b] = True


@inner_kernel
def _share(row, off, sign, shared):  # type: ignore[no-untyped-def]
    """Count what a factor has of the constants, or no more."""
    for i in range(3):
        for j in range(3):
            x = sign * row[i, 8 + j]
            if x == 0.0:
                continue
            for k in range(3):
                shared[j, k] += x * row[i, 8 + k]
            shared[j, 3] += x * off[i]


@lean_kernel
def losses(kinds, ends, measured, values, huber, row, off):  # type: ignore[no-untyped-def]
    """At these values: the sum of Cauchy's loss of what is heard, and that of all factors by the loss that is asked
    for, in squared sigmas.

    Args:
        row: for one factor's rows, shape (3, 11).
        off: and its residuals, shape (3,).
    """
    loss = total = 0.0
    for f in range(len(kinds)):
        squared = _linearise(kinds[f], measured[f], values, ends[f, 0], ends[f, 1], row, off)
        if squared >= 0.0:
            cauchy = CAUCHY * CAUCHY * math.log1p(squared / (CAUCHY * CAUCHY))
            loss += cauchy
            total += _huber_loss(squared) if huber else cauchy
        else:
            for i in range(3):
                total += off[i] * off[i]
    return loss, total


@inner_kernel
def _huber(squared):  # type: ignore[no-untyped-def]
    """Weight of a squared residual."""
    return 1.0 / max(1.0, math.sqrt(squared) / HUBER)


@inner_kernel
def _huber_loss(squared):  # type: ignore[no-untyped-def]
    """Of a squared residual."""
    return squared if squared <= HUBER * HUBER else HUBER * (2.0 * math.sqrt(squared) - HUBER)


@inner_kernel
def _cauchy(squared):  # type: ignore[no-untyped-def]
    """Weight of a squared residual: what is far off hardly counts."""
    return 1.0 / (1.0 + squared / (CAUCHY * CAUCHY))


@inner_kernel
def _linearise(kind, measured, values, a, b, row, off):  # type: ignore[no-untyped-def]
    """Rows and residuals of one factor; its squared residual where that counts robustly, else -1."""
    for i in range(3):
        off[i] = 0.0
        for j in range(11):
            row[i, j] = 0.0
    if kind == ODOMETRY:
        _odometry(measured, values, a, b, row, off)
        return -1.0
    if kind == LINE:
        return _line(measured, values, a, b, row, off)
    if kind in (POINT, COLUMN):
        return _point(measured, values, a, b, kind == COLUMN, row, off)
    if kind == TURN:  # every scan's turn is about as the wheels turn, and some about as their discs heard
        row[0, 3], off[0] = measured[0], measured[0] * values[a, 3]
        row[1, 3] = row[1, 8] = measured[2]
        off[1] = measured[2] * (values[0, 0] + values[a, 3] - measured[1])
    elif kind == RADIUS:
        row[0, 2], off[0] = measured[1], measured[1] * (values[a, 2] - measured[0])
    else:
        for i in range(3):
            if kind == START:
                row[i, i], off[i] = FIRMLY, FIRMLY * (values[a, i] - measured[i])
            else:
                row[i, 8 + i], off[i] = measured[i], measured[i] * values[0, i]
    return -1.0


@inner_kernel
def _odometry(m, values, a, b, row, off):  # type: ignore[no-untyped-def]
    """From one scan to the next, as `motion.Motion` has it."""
    c, s = math.cos(values[a, 2]), math.sin(values[a, 2])
    dx, dy = values[b, 0] - values[a, 0], values[b, 1] - values[a, 1]
    x, y = c * dx + s * dy, c * dy - s * dx
    turn_error, bend, own = values[0, 0], values[0, 1], values[a, 3]
    apart = (x, y, values[b, 2] - values[a, 2])
    k = 0
    for i in range(3):
        for j in range(i + 1):
            w = m[k]
            k += 1
            by_turn, by_bend, by_own = m[9 + 2 * j], m[10 + 2 * j], m[15 + j]
            off[i] += w * (apart[j] - m[6 + j] - by_turn * turn_error - by_bend * bend - by_own * own)
            row[i, 3] -= w * by_own
            row[i, 8] -= w * by_turn
            row[i, 9] -= w * by_bend
            if j == 0:
                row[i, 0] -= w * c
                row[i, 1] -= w * s
                row[i, 2] += w * y
                row[i, 4] += w * c
                row[i, 5] += w * s
            elif j == 1:
                row[i, 0] += w * s
                row[i, 1] -= w * c
                row[i, 2] -= w * x
                row[i, 4] -= w * s
                row[i, 5] += w * c
            else:
                row[i, 2] -= w
                row[i, 6] += w


@inner_kernel
def _line(m, values, a, b, row, off):  # type: ignore[no-untyped-def]
    """Bearing and range of a feature to the line of its chain; the line is thin: it may be seen from behind."""
    x, y, angle = values[a, 0], values[a, 1], values[b, 0]
    apart = values[a, 2] + m[0] + m[1] * (values[0, 0] + values[a, 3]) - angle
    side = 1.0 if math.cos(apart) >= 0.0 else -1.0
    if side < 0.0:
        apart += math.pi
    c, s = math.cos(angle), math.sin(angle)
    off[0] = _wrapped(apart) * m[3]
    off[1] = (side * (values[b, 1] - x * c - y * s) - m[2] * (1.0 + values[0, 2])) * m[4]
    u, v = m[3], side * m[4]
    row[0, 2], row[0, 4], row[0, 3], row[0, 8] = u, -u, u * m[1], u * m[1]
    row[1, 0], row[1, 1], row[1, 4], row[1, 5] = -v * c, -v * s, v * (x * s - y * c), v
    row[1, 10] = -m[2] * m[4]
    return off[0] * off[0] + off[1] * off[1]


@inner_kernel
def _point(m, values, a, b, thick, row, off):  # type: ignore[no-untyped-def]
    """Bearing and range of a point to its place, of a column to its surface."""
    dx, dy = values[b, 0] - values[a, 0], values[b, 1] - values[a, 1]
    away = math.sqrt(dx * dx + dy * dy)
    c, s, u, v = dx / away, dy / away, m[3], m[4]
    bearing = values[a, 2] + m[0] + m[1] * (values[0, 0] + values[a, 3])
    off[0] = _wrapped(bearing - math.atan2(dy, dx)) * u
    off[1] = (away - m[2] * (1.0 + values[0, 2])) * v
    row[0, 0], row[0, 1], row[0, 2] = -u * s / away, u * c / away, u
    row[0, 4], row[0, 5], row[0, 3], row[0, 8] = u * s / away, -u * c / away, u * m[1], u * m[1]
    row[1, 0], row[1, 1], row[1, 4], row[1, 5] = -v * c, -v * s, v * c, v * s
    row[1, 10] = -m[2] * v
    if thick:
        off[1] -= values[b, 2] * v
        row[1, 6] = -v
    return off[0] * off[0] + off[1] * off[1]


@inner_kernel
def _wrapped(angle):  # type: ignore[no-untyped-def]
    """`geometry.wrap_angle`."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)
