"""Normal form of a branch point: the algebraic branching equation, and at a pitchfork the cubic coefficient.

With `v = (X', 1)` along the branch followed, `J_0 X' = -R_p`, phi.X' = 0, the directions `s phi + r v` of the two
branches solve

    c s^2 + 2 b s r + a r^2 = 0,    a = psi.R''[v, v], b = psi.R''[v, phi], c = psi.R''[phi, phi].

`c = 0` is a pitchfork: the other branch leaves along phi, as `p = p_0 + curvature eps^2`, `curvature = -c3 / b`, with
c3 as at a period doubling. A symmetry of the system is the reason as a rule.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.normal_form.real import Expansion
from suboctave.bifurcation.normal_form.terms import NormalForm, Terms, with_criticality
from suboctave.continuation.linear import Factor
from suboctave.harmonic.basis import Array
from suboctave.harmonic.derivatives import Direction, second_derivative
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.trigonometric import wave_sums
from suboctave.harmonic.waves import Waves

#: share of its terms' size below which c counts as zero: a branch point is located to about 1e-8 of its symmetry
_SYMMETRIC = 1e-6


def branch_point(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """a, b, c, g, and c3 with the curvature that belong to c = 0."""
    own = Expansion.of(state, Kind.INTEGER, vectors, name)
    n = state.balance.dimension
    bordered = np.zeros((n + 1, n + 1), order="F")
    bordered[:n, :n] = state.jacobian
    # rows and columns in weighted units: J = D^-1 J_w D^-1
    size = state.omega**2
    weight = np.tile(state.balance.scales()[0], state.basis.size)
    bordered[:n, n] = size * weight * vectors.left
    bordered[n, :n] = size * weight * vectors.right
    factor = Factor.of(bordered, overwrite=True)

    def solve(rhs: Array) -> Array:
        solution: Array = factor.solve(np.append(rhs, 0.0))[:n]
        return solution

    shape = state.x.shape
    v = Direction(solve(-state.residual_by(name)).reshape(shape), {name: 1.0})
    a = float(own.psi @ second_derivative(state, v, v))
    b = own.by_parameter + float((own.by_motion * v.x).sum())
    squared = own.squared()
    c = float(own.psi @ squared)
    c3, cubic_size = own.cubic(solve(-0.5 * squared))
    coefficients = {"a": a, "b": b, "c": c, "g": own.g, "c3": c3, "curvature": -c3 / b if b else float("nan")}
    # or a share of what c3 amounts to where the branches are as far apart as the parameter is from zero: at rest, which
    # is located as well as rounding allows, c may have no other size
    parameter = abs(state.omega if name == "omega" else state.values[name])
    quadratic = max(_quadratic_size(own), math.sqrt(abs(c3 * b) * parameter))
    return Terms(coefficients, {"c3": cubic_size, "g": own.g_size, "c": quadratic}, own.g_size)


def labelled(form: NormalForm, terms: Terms) -> NormalForm:
    """Transcritical or pitchfork, and of the latter whether it is super- or subcritical."""
    if abs(form["c"]) > _SYMMETRIC * terms.sizes["c"]:
        kept = {key: form[key] for key in ("a", "b", "c", "g")}
        return replace(form, coefficients=kept, errors={}, shape="transcritical")
    return with_criticality(replace(form, shape="pitchfork"))


def _quadratic_size(own: Expansion) -> float:
    """Sum of the moduli that `psi.R''[phi, phi]` is made of, along the motion."""
    phi, psi = own.waves, Waves.of(own.state, Kind.INTEGER, own.psi)
    total = 0.0
    for channel in own.state.channels:
        along = np.ascontiguousarray((psi.amplitudes @ channel.out)[None])
        for zr, zi, weights in channel.second:
            q, left = own.forms.values(channel, phi, zr, zi), wave_sums(along, zr, zi)
            total += float(np.einsum("rsn,rn,sn,n->", *(np.abs(part) for part in (weights, q, q, left[0]))))
    return total / np.pi
