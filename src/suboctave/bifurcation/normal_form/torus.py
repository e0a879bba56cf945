"""Normal form of a Neimark-Sacker point: the first Lyapunov coefficient of the torus, in the frequency domain.

The perturbation `A phi exp(i kappa t)` and its conjugate change the motion by `|A|^2 h11 + A^2 h20 exp(2 i kappa t) +
c.c.`,

    J_0 h11 = -R''[phi, conj phi],    J_2kappa h20 = -R''[phi, phi] / 2,

and what remains at kappa is, with `i g = i psi^H dJ_kappa/dkappa phi`,

    A' = (d delta + c3 |A|^2) A,    c3 = psi^H (R''[phi, h11] + R''[conj phi, h20] + R'''[phi, phi, conj phi] / 2) / (i
    g),    d = psi^H (J_p phi + R''[phi, X_p]) / (i g).

The real part of c3 is the first Lyapunov coefficient: negative, a stable torus surrounds the motions that have lost
stability (supercritical), with `|A|^2 = -Re d delta / Re c3`. Near `kappa = w0 / 3` and `w0 / 4` resonant terms of
second and third order join; at those ratios the form says nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bordered import NullVectors
from suboctave.bifurcation.normal_form.terms import NormalForm, Terms, unweighted
from suboctave.continuation.linear import Factor
from suboctave.harmonic.derivatives import Multilinear
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, bilinear_gradient, operator
from suboctave.harmonic.waves import Frequencies, Waves

#: share of w0 within which a strong resonance is stated, and within which it forbids a verdict
_STATED, _RESONANT = 0.02, 1e-3


def torus(state: BalanceState, vectors: NullVectors, name: str, kappa: float) -> Terms:
    """c3, d and the curvature; growth and frequency apart."""
    phi, psi = unweighted(state, vectors.right), unweighted(state, vectors.left)
    slope = bilinear_gradient(state, Kind.FREE, psi, phi, (name,), kappa)
    g = 1j * slope.kappa
    forms, wave = Multilinear(state), Waves.of(state, Kind.FREE, phi, kappa)
    whole, own = Frequencies.of(state, Kind.INTEGER), Frequencies.of(state, Kind.FREE, kappa)
    twice = Frequencies.of(state, Kind.FREE, 2.0 * kappa)
    factor = Factor.of(state.jacobian)
    along = factor.solve(-state.residual_by(name)).reshape(state.x.shape)
    d = (slope.rates[name] + (slope.x * along).sum()) / g
    mean = factor.solve(-forms.second(wave, wave.conjugate, whole).vector(Kind.INTEGER).real)
    second = Factor.of(operator(state, Kind.FREE, 2.0 * kappa)).solve(
        -0.5 * forms.second(wave, wave, twice).vector(Kind.FREE)
    )
    h20 = Waves(second.reshape(-1, state.balance.size), twice)
    parts = np.array(
        [
            (slope.x * mean.reshape(state.x.shape)).sum(),
            np.vdot(psi, forms.second(wave.conjugate, h20, own).vector(Kind.FREE)),
            0.5 * np.vdot(psi, forms.third(wave, wave, wave.conjugate, own).vector(Kind.FREE)),
        ]
    )
    c3 = complex(parts.sum() / g)
    coefficients = {
        "c3": c3.real,
        "d": d.real,
        "c3_frequency": c3.imag,
        "d_frequency": d.imag,
        "curvature": -c3.real / d.real if d.real else float("nan"),
    }
    return Terms(coefficients, {"c3": float(np.abs(parts).sum() / abs(g))}, 1.0)


def labelled(form: NormalForm, share: float) -> NormalForm:
    """The same with strong resonances stated; share: kappa in units of the base frequency."""
    near = [(abs(share - 1.0 / q), q) for q in (2, 3, 4)] + [(abs(share), 1)]
    distance, q = min(near)
    if distance > _STATED:
        return form
    words = f"kappa lies {distance:.1e} w0 from the strong resonance 1:{q}"
    if distance > _RESONANT:
        return replace(form, remark="; ".join(part for part in (words, form.remark) if part))
    return replace(form, remark=words, criticality=None)
