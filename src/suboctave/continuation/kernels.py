"""Compiled pieces of Newton's method along a curve. Arrays in, arrays out."""

from __future__ import annotations

import math

import numpy as np

from suboctave.compiled import kernel


@kernel()
def bordered_transposed(jacobian, row, weights):
    """Transpose of `[F_u / weights; row]`, so that its transpose lies in memory as LAPACK wants it; (N + 1, N + 1)."""
    rows, cols = jacobian.shape
    out = np.empty((cols, rows + 1))
    for j in range(cols):
        scale = 1.0 / weights[j]
        for i in range(rows):
            out[j, i] = jacobian[i, j] * scale
        out[j, rows] = row[j]
    return out


@kernel()
def scaled_transposed(matrix, rows, columns, more):
    """Transpose of a matrix with factors for its rows and columns, and `more` rows and columns of zeros."""
    m, n = matrix.shape
    out = np.zeros((n + more, m + more), dtype=matrix.dtype)
    for j in range(n):
        for i in range(m):
            out[j, i] = matrix[i, j] * rows[i] * columns[j]
    return out


@kernel()
def bordered_and_scaled(matrix, scale, left, right, size):
    """Transpose of `[S A S, size left; size right^H, 0]`, S the diagonal matrix of `scale`; (N + 1, N + 1)."""
    n = matrix.shape[0]
    out = np.empty((n + 1, n + 1), dtype=matrix.dtype)
    for j in range(n):
        for i in range(n):
            out[j, i] = matrix[i, j] * (scale[i] * scale[j])
        out[j, n] = size * right[j].conjugate()
        out[n, j] = size * left[j]
    out[n, n] = 0.0
    return out


@kernel()
def longest_column(matrix):
    """Largest sum of moduli over a column."""
    sums = np.zeros(matrix.shape[1])
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            sums[j] += abs(matrix[i, j])
    largest = 0.0
    for j in range(matrix.shape[1]):
        # not a number stays
        if not sums[j] <= largest:
            largest = sums[j]
    return largest


@kernel()
def right_hand_side(residual, row, weights, u, guess):
    """`[F; row . (weights (u - guess))]`, shape (N + 1,)."""
    n = u.shape[0]
    out = np.empty(n)
    total = 0.0
    for i in range(n):
        total += row[i] * weights[i] * (u[i] - guess[i])
        out[i] = residual[i] if i < n - 1 else total
    return out


@kernel()
def moved(u, step, weights, share):
    """`u - share step / weights`, and the length of the step."""
    out = np.empty(u.shape[0])
    total = 0.0
    for i in range(u.shape[0]):
        out[i] = u[i] - share * step[i] / weights[i]
        total += step[i] * step[i]
    return out, math.sqrt(total)


@kernel()
def distance(u, v, weights):
    """`|weights (u - v)|`."""
    total = 0.0
    for i in range(u.shape[0]):
        d = weights[i] * (u[i] - v[i])
        total += d * d
    return math.sqrt(total)


@kernel()
def normalised(direction, weights):
    """A direction in scaled variables as a vector in u of unit length in scaled arclength."""
    total = 0.0
    for i in range(direction.shape[0]):
        total += direction[i] * direction[i]
    total = math.sqrt(total)
    out = np.empty(direction.shape[0])
    for i in range(direction.shape[0]):
        out[i] = direction[i] / (total * weights[i])
    return out


@kernel()
def rescaled(direction, weights, out):
    """A direction in u with unit length in scaled arclength, into `out`."""
    total = 0.0
    for i in range(direction.shape[0]):
        d = weights[i] * direction[i]
        total += d * d
    total = 1.0 / math.sqrt(total)
    for i in range(direction.shape[0]):
        out[i] = direction[i] * total


@kernel()
def weighted_length(weights, u):
    """`|weights u|` of as many entries of u as there are weights."""
    total = 0.0
    for i in range(weights.shape[0]):
        d = weights[i] * u[i]
        total += d * d
    return math.sqrt(total)


@kernel()
def cosine(a, b, weights):
    """Cosine of the angle between two vectors in scaled variables."""
    ab = 0.0
    aa = 0.0
    bb = 0.0
    for i in range(a.shape[0]):
        w = weights[i] * weights[i]
        ab += w * a[i] * b[i]
        aa += w * a[i] * a[i]
        bb += w * b[i] * b[i]
    return ab / math.sqrt(aa * bb)


@kernel()
def predict(points, tangents, weights, step, out):
    """The Hermite polynomial through points and tangents (m, n) taken `step` further in scaled arclength, into `out`.

    The latest point comes first; one point gives a straight line, two a cubic, three a quintic.
    """
    m, n = points.shape
    size = np.empty(m)
    where = np.zeros(m)
    for j in range(m):
        total = 0.0
        for i in range(n):
            d = weights[i] * tangents[j, i]
            total += d * d
        size[j] = math.sqrt(total)
        if j > 0:
            chord = turn = 0.0
            for i in range(n):
                d = weights[i] * (points[j - 1, i] - points[j, i])
                chord += d * d
                d = weights[i] * (tangents[j - 1, i] / size[j - 1] - tangents[j, i] / size[j])
                turn += d * d
            # the arc is longer than its chord
            where[j] = where[j - 1] - math.sqrt(chord) * (1.0 + turn / 24.0)
    for i in range(n):
        out[i] = 0.0
    for j in range(m):
        product, total = 1.0, 0.0
        for k in range(m):
            if k != j:
                product *= (step - where[k]) / (where[j] - where[k])
                total += 1.0 / (where[j] - where[k])
        square = product * product
        ahead = step - where[j]
        value = square * (1.0 - 2.0 * ahead * total)
        slope = square * ahead / size[j]
        for i in range(n):
            out[i] += value * points[j, i] + slope * tangents[j, i]


@kernel()
def between(u, tangent, v, heading, weights, s):
    """Cubic Hermite interpolation at the share s of the way from u to v, with tangents of any length."""
    n = u.shape[0]
    chord = first = last = 0.0
    for i in range(n):
        w = weights[i] * weights[i]
        d = v[i] - u[i]
        chord += w * d * d
        first += w * tangent[i] * tangent[i]
        last += w * heading[i] * heading[i]
    r = 1.0 - s
    a = (1.0 + 2.0 * s) * r * r
    b = s * r * r * math.sqrt(chord / first)
    c = s * s * (3.0 - 2.0 * s)
    d = s * s * (s - 1.0) * math.sqrt(chord / last)
    out = np.empty(n)
    for i in range(n):
        out[i] = a * u[i] + b * tangent[i] + c * v[i] + d * heading[i]
    return out


@kernel()
def disagreement(u, tangent, v, heading, weights):
    """Distance between the unit chord from u to v and the mean of the unit tangents there; 0 without a chord."""
    n = u.shape[0]
    chord = first = last = 0.0
    for i in range(n):
        w = weights[i] * weights[i]
        d = v[i] - u[i]
        chord += w * d * d
        first += w * tangent[i] * tangent[i]
        last += w * heading[i] * heading[i]
    if chord == 0.0:
        return 0.0
    chord, first, last = 1.0 / math.sqrt(chord), 0.5 / math.sqrt(first), 0.5 / math.sqrt(last)
    total = 0.0
    for i in range(n):
        d = weights[i] * (chord * (v[i] - u[i]) - first * tangent[i] - last * heading[i])
        total += d * d
    return math.sqrt(total)


@kernel()
def determinant_sign(lu, pivots):
    """Sign of the determinant of a factorised matrix (`lapack.dgetrf`, pivots counted from 0)."""
    sign = 1.0
    for i in range(pivots.shape[0]):
        if pivots[i] != i:
            sign = -sign
        if lu[i, i] < 0.0:
            sign = -sign
    return sign


@kernel()
def log_modulus(lu):
    """Natural logarithm of the modulus of the determinant of a factorised matrix."""
    total = 0.0
    for i in range(lu.shape[0]):
        size = abs(lu[i, i])
        total += math.log(size) if size > 0.0 else -math.inf
    return total
