"""A sparse Cholesky factor by blocks: made where it changed, with what stands on the right, and solved with."""

from __future__ import annotations

import math

import numpy as np

from sonar_explore.compiled import inner_kernel, kernel, lean_kernel


@kernel
def eliminated(  # type: ignore[no-untyped-def]
    starts, factors, ends, rows, off, shared, order, rank, dims, touched, layout, struct, factor, forward
):
    """Blocks of columns of the touched variables, and of those above them in the tree, which are touched then: each
    from its factors less what those before it have in its rows. Likewise `forward`, L^-1 J'r, shape (variables, 4)."""
    n = len(rank)
    # by variable, the blocks whose next rows are its
    waiting, after = np.full(n, -1), np.empty(n, dtype=np.int64)
    upto, row = np.zeros(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    place, goes = np.zeros(n, dtype=np.int64), np.empty(4 * n + 4, dtype=np.uint64)
    sums = np.empty(32)
    for p in range(len(order)):
        v = order[p]
        if touched[v]:
            height = place[v] = 0
            height = dims[v]
            for i in range(layout[v, 0], layout[v, 0] + layout[v, 1]):
                place[struct[i]] = height
                height += dims[struct[i]]
            block = factor[layout[v, 3] : layout[v, 3] + height * dims[v]]
            block[:] = 0.0
            _assemble(v, starts, factors, ends, rows, off, shared, rank, dims, place, block, forward[v], sums)
            k = waiting[v]
            while k >= 0:
                _subtract(k, v, upto[k], row[k], dims, layout, struct, factor, forward, place, goes, block)
                k = after[k]
            _cholesky(block, height, dims[v])
            _substitute(block, dims[v], forward[v])
            if layout[v, 1] > 0:
                touched[struct[layout[v, 0]]] = True
        k = waiting[v]
        while k >= 0:
            following = after[k]
            upto[k] += 1
            row[k] += dims[v]
            if upto[k] < layout[k, 1]:
                u = struct[layout[k, 0] + upto[k]]
                after[k], waiting[u] = waiting[u], k
            k = following
        if layout[v, 1] > 0:
            u = struct[layout[v, 0]]
            row[v], after[v], waiting[u] = dims[v], waiting[u], v


@inner_kernel
def _assemble(v, starts, factors, ends, rows, off, shared, rank, dims, place, block, right, sums):  # type: ignore[no-untyped-def]
    """The columns of J'J of one variable, from the diagonal on, and what J'r has of it.

    What all its factors add to, the square on top and the rows of the constants, is summed up four numbers at a time,
    however many the variable has.
    """
    if v == 0:  # all factors are tied to them: the sum over all is kept
        for j in range(3):
            right[j] = shared[j, 3]
            for k in range(3):
                block[k * 3 + j] = shared[k, j]
        return
    for k in range(32):
        sums[k] = 0.0
    d = dims[v]
    for at in range(starts[v], starts[v + 1]):
        f = factors[at]
        side = 0 if ends[f, 0] == v else 1
        mine, theirs, u = 4 * side, 4 - 4 * side, ends[f, 1 - side]
        wide = dims[u] if u >= 0 and rank[u] > rank[v] else 0
        below = block[place[u] * d :] if wide > 0 else block
        for i in range(3):
            row = rows[f, i]
            own, other = row[mine : mine + 4], row[theirs : theirs + 4]
            a, b, c, e = own[0], own[1], own[2], own[3]
            if a == 0.0 and b == 0.0 and c == 0.0 and e == 0.0:
                continue
            p, q, r, x = row[8], row[9], row[10], off[f, i]
            _add_four(sums[0:4], a, a, b, c, e)
            _add_four(sums[4:8], b, a, b, c, e)
            _add_four(sums[8:12], c, a, b, c, e)
            _add_four(sums[12:16], e, a, b, c, e)
            _add_four(sums[16:20], p, a, b, c, e)
            _add_four(sums[20:24], q, a, b, c, e)
            _add_four(sums[24:28], r, a, b, c, e)
            _add_four(sums[28:32], x, a, b, c, e)
            for k in range(wide):
                x, under = other[k], below[k * d : k * d + d]
                under[0] += x * a
                under[1] += x * b
                if d > 2:
                    under[2] += x * c
                if d > 3:
                    under[3] += x * e
    constants = block[place[0] * d :]
    for j in range(d):
        right[j] = sums[28 + j]
        for k in range(j, d):
            block[k * d + j] = sums[4 * k + j]
        for k in range(3):
            constants[k * d + j] += sums[16 + 4 * k + j]
        if block[j * d + j] == 0.0:  # of what became another, nothing is measured any more
            block[j * d + j] = 1.0


@inner_kernel
def _add_four(sums, x, a, b, c, e):  # type: ignore[no-untyped-def]
    sums[0] += x * a
    sums[1] += x * b
    sums[2] += x * c
    sums[3] += x * e


@inner_kernel
def _subtract(k, v, upto, row, dims, layout, struct, factor, forward, place, goes, block):  # type: ignore[no-untyped-def]
    """What the block of k, whose rows from `row` on are those of v and of the variables after it, has in that of v.

    Where each of these rows `goes` is written down first: one loop through all of them is much sooner done than a short
    one for each variable. Slices and unsigned numbers spare the compiler the question whether an index counts from the
    end.
    """
    d, dv, rows = dims[k], dims[v], 0
    for i in range(layout[k, 0] + upto, layout[k, 0] + layout[k, 1]):
        u = struct[i]
        for j in range(4):  # the next variable writes over what is too much
            goes[rows + j] = (place[u] + j) * dv
        rows += dims[u]
    begin = layout[k, 3] + row * d
    theirs = factor[begin : begin + rows * d]
    for j in range(dv):
        mine = theirs[j * d : j * d + d]
        for i in range(d):
            forward[v, j] -= mine[i] * forward[k, i]
    if dv == 4:
        _subtract_four(theirs, d, rows, goes, block)
        return
    for j in range(dv):
        mine, column = theirs[j * d : j * d + d], block[j:]
        a, b = mine[0], mine[1]
        if d == 4:
            c, e = mine[2], mine[3]
            for i in range(rows):
                total = theirs[4 * i] * a + theirs[4 * i + 1] * b
                total += theirs[4 * i + 2] * c + theirs[4 * i + 3] * e
                column[goes[i]] -= total
        elif d == 3:
            c = mine[2]
            for i in range(rows):
                total = theirs[3 * i] * a + theirs[3 * i + 1] * b
                column[goes[i]] -= total + theirs[3 * i + 2] * c
        else:
            for i in range(rows):
                column[goes[i]] -= theirs[2 * i] * a + theirs[2 * i + 1] * b


@inner_kernel
def _subtract_four(theirs, d, rows, goes, block):  # type: ignore[no-untyped-def]
    """The same where v is a pose: four columns at a time."""
    a, b, f, g = theirs[0], theirs[1], theirs[d], theirs[d + 1]
    m, n, r, s = theirs[2 * d], theirs[2 * d + 1], theirs[3 * d], theirs[3 * d + 1]
    if d == 2:
        for i in range(rows):
            x, y, at = theirs[2 * i], theirs[2 * i + 1], goes[i]
            mine = block[at : at + np.uint64(4)]
            mine[0] -= x * a + y * b
            mine[1] -= x * f + y * g
            mine[2] -= x * m + y * n
            mine[3] -= x * r + y * s
        return
    c, h, p, t = theirs[2], theirs[d + 2], theirs[2 * d + 2], theirs[3 * d + 2]
    if d == 3:
        for i in range(rows):
            x, y, z, at = theirs[3 * i], theirs[3 * i + 1], theirs[3 * i + 2], goes[i]
            mine = block[at : at + np.uint64(4)]
            mine[0] -= x * a + y * b + z * c
            mine[1] -= x * f + y * g + z * h
            mine[2] -= x * m + y * n + z * p
            mine[3] -= x * r + y * s + z * t
        return
    e, k, q, u = theirs[3], theirs[7], theirs[11], theirs[15]
    for i in range(rows):
        x, y, z, w, at = theirs[4 * i], theirs[4 * i + 1], theirs[4 * i + 2], theirs[4 * i + 3], goes[i]
        mine = block[at : at + np.uint64(4)]
        mine[0] -= (x * a + y * b) + (z * c + w * e)
        mine[1] -= (x * f + y * g) + (z * h + w * k)
        mine[2] -= (x * m + y * n) + (z * p + w * q)
        mine[3] -= (x * r + y * s) + (z * t + w * u)


@inner_kernel
def _cholesky(block, height, d):  # type: ignore[no-untyped-def]
    """Of the square on top; the rows below times the inverse of its transpose."""
    for i in range(d):
        for j in range(i + 1):
            total = block[i * d + j]
            for k in range(j):
                total -= block[i * d + k] * block[j * d + k]
            block[i * d + j] = math.sqrt(total) if i == j else total / block[j * d + j]
    a, b, c = block[0], block[d], block[d + 1]
    if d == 2:
        for i in range(2 * d, height * d, d):
            x = block[i] / a
            block[i], block[i + 1] = x, (block[i + 1] - x * b) / c
        return
    e, f, g = block[2 * d], block[2 * d + 1], block[2 * d + 2]
    h, k, m, n = (block[12], block[13], block[14], block[15]) if d == 4 else (0.0, 0.0, 0.0, 0.0)
    for i in range(d * d, height * d, d):
        x = block[i] / a
        y = (block[i + 1] - x * b) / c
        z = (block[i + 2] - x * e - y * f) / g
        block[i], block[i + 1], block[i + 2] = x, y, z
        if d == 4:
            block[i + 3] = (block[i + 3] - x * h - y * k - z * m) / n


@inner_kernel
def _substitute(block, d, right):  # type: ignore[no-untyped-def]
    """The square on top's inverse times this, in place."""
    for i in range(d):
        for k in range(i):
            right[i] -= block[i * d + k] * right[k]
        right[i] /= block[i * d + i]


@lean_kernel
def solved(order, dims, layout, struct, factor, forward, x):  # type: ignore[no-untyped-def]
    """L' x = forward; of variables that are not in the order x stays as it is."""
    for p in range(len(order) - 1, -1, -1):
        v = order[p]
        d = dims[v]
        at = layout[v, 3] + d * d
        for j in range(d):
            x[v, j] = forward[v, j]
        for k in range(layout[v, 0], layout[v, 0] + layout[v, 1]):
            u = struct[k]
            for i in range(dims[u]):
                for j in range(d):
                    x[v, j] -= factor[at + j] * x[u, i]
                at += d
        at = layout[v, 3]
        for i in range(d - 1, -1, -1):
            for k in range(i + 1, d):
                x[v, i] -= factor[at + k * d + i] * x[v, k]
            x[v, i] /= factor[at + i * d + i]


@lean_kernel
def covariances(variables, by, other, by_other, rank, parent, dims, layout, struct, factor, half, out):  # type: ignore[no-untyped-def]
    """A' (L L')^-1 A = |L^-1 A|^2: L^-1 A has something only where the tree leads from the two variables.

    Nothing is said of a variable less than zero.
    """
    columns = half.shape[2]
    for k in range(len(variables)):
        v, w = variables[k], other
        if v < 0:
            continue
        for i in range(4):
            for c in range(columns):
                half[v, i, c] += by[k, i, c]
                half[w, i, c] += by_other[k, i, c]
        while v >= 0 or w >= 0:
            u = v if w < 0 or (v >= 0 and rank[v] <= rank[w]) else w
            v, w = parent[v] if v == u else v, parent[w] if w == u else w
            d, at = dims[u], layout[u, 3]
            for c in range(columns):
                for i in range(d):
                    for j in range(i):
                        half[u, i, c] -= factor[at + i * d + j] * half[u, j, c]
                    half[u, i, c] /= factor[at + i * d + i]
            at += d * d
            for m in range(layout[u, 0], layout[u, 0] + layout[u, 1]):
                for i in range(dims[struct[m]]):
                    for c in range(columns):
                        for j in range(d):
                            half[struct[m], i, c] -= factor[at + j] * half[u, j, c]
                    at += d
            for c in range(columns):
                for e in range(columns):
                    for i in range(d):
                        out[k, c, e] += half[u, i, c] * half[u, i, e]
            half[u] = 0.0
