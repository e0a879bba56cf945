"""The force of one element along a periodic motion, as Fourier coefficients, with its derivatives.

Everything a harmonic-balance residual, its Jacobian, a bifurcation system or a normal form needs from an element:

- `LocalForce`: Fourier coefficients of `f`, `f_u`, `f_v`. The same `f_u`, `f_v` serve every basis (integer, half-odd,
  shifted by kappa) because the Galerkin matrices depend on differences and sums of frequencies only.
- `Curvature`: second derivatives as weights at instants: `int f_uu h dtau = sum_j uu_j h(tau_j)`. For a sampled law
  these are its nodes; for a piecewise-linear law `f_uu` is a comb of Dirac functions at the crossings, with weight
  `stiffness / |du/dtau|`.
- `CoefficientForce`: derivatives with respect to the element's coefficients (stiffness, gap, ...).

Piecewise-linear laws are integrated in closed form over the contact intervals: no sampling, no regularisation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.harmonic import instants, kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.quadrature import Nodes, graded_motion, nodes_for, sampled_spectra, search_grid, singularities
from suboctave.model.sampling import Piece, PiecewiseLinear, Sampling, SharpSampling

_NONE = np.zeros(0, dtype=complex)


@dataclass(frozen=True)
class LocalForce:
    """Fourier coefficients `g_q = mean(g exp(-i q tau))`, q = 0 .. top; `damping` is empty if the law has no
    velocity.
    """

    force: ComplexArray
    stiffness: ComplexArray
    damping: ComplexArray


@dataclass(frozen=True)
class Curvature:
    """Second derivatives of a law as weights at instants `z = exp(i tau)`; uv and vv are None without velocity."""

    zr: Array
    zi: Array
    uu: Array
    uv: Array | None
    vv: Array | None


@dataclass(frozen=True)
class CoefficientForce:
    """Fourier coefficients of `f_c` (nc, top + 1), `f_uc`, `f_vc` (nc, top + 1) and `f_cc` (nc, nc, top + 1)."""

    force: ComplexArray
    stiffness: ComplexArray
    damping: ComplexArray | None
    curvature: ComplexArray


@dataclass(frozen=True)
class CoefficientChange:
    """Fourier coefficients of what a change of the element's coefficients does to `f`, `f_u`, `f_v`, (top + 1,)."""

    force: ComplexArray
    stiffness: ComplexArray
    damping: ComplexArray | None


@dataclass(frozen=True)
class LocalMotion:
    """An element on a motion: coefficients of the relative displacement (H + 1,), the base frequency, the element's
    numbers.
    """

    element: Any
    motion: ComplexArray
    rate: float
    coefficients: Array
    top: int
    samples: int | None = None
    told: Sampling | None = None

    @property
    def kind(self) -> Sampling:
        """What the element tells of its law at these coefficients (`told`, where that has been asked before)."""
        return self.element.sampling(self.coefficients) if self.told is None else self.told

    @property
    def pieces(self) -> tuple[Piece, ...] | None:
        """The pieces of a piecewise-linear law, else None."""
        kind = self.kind
        return kind.pieces if isinstance(kind, PiecewiseLinear) else None

    def nodes(self) -> Nodes:
        """Sampling nodes of a law that is not piecewise linear."""
        return nodes_for(self.kind, self.motion, self.top, self.samples)

    def contacts(self) -> list[Contact]:
        """Contact intervals of every piece of a piecewise-linear law."""
        high = self.motion.shape[0] - 1
        grid = search_grid(high)
        found = []
        for piece in self.pieces or ():
            level = float(self.coefficients[piece.gap])
            crossed, above = instants.crossings(self.motion, level, grid.zr, grid.zi)
            chi = kernels.contact_spectrum(crossed, above, piece.side, self.top + high)
            found.append(Contact(piece.stiffness, piece.gap, piece.side, crossed, above, chi))
        return found


@dataclass(frozen=True)
class Contact:
    """Contact of one piece of a piecewise-linear law.

    Indices of its coefficients, its side, the instants at which the gap is crossed (ascending), whether the motion
    lies above the gap before the first of them, and the Fourier coefficients of the contact indicator.
    """

    stiffness: int
    gap: int
    side: int
    instants: Array
    above: bool
    chi: ComplexArray

    def active(self, tau: Array) -> Array:
        """1 where the piece is in contact, else 0, at instants tau in [0, 2 pi]."""
        above = (np.searchsorted(self.instants, tau) % 2 == 1) != self.above
        return (above == (self.side > 0)).astype(float)


def local_force(local: LocalMotion) -> LocalForce:
    """Force and tangent of an element along a motion."""
    if local.pieces is None:
        spectra = sampled_spectra(local.element, local.motion, local.rate, local.coefficients, local.nodes(), local.top)
        return LocalForce(spectra[0], spectra[1], spectra[2] if len(spectra) > 2 else _NONE)
    force = np.zeros(local.top + 1, dtype=complex)
    stiffness = np.zeros(local.top + 1, dtype=complex)
    for contact in local.contacts():
        s, gap = local.coefficients[contact.stiffness], local.coefficients[contact.gap]
        if len(contact.instants) == 0 and contact.chi[0] == 0.0:
            continue
        force += s * kernels.product_spectrum(local.motion, gap, contact.chi, local.top)
        stiffness += s * contact.chi[: local.top + 1]
    return LocalForce(force, stiffness, _NONE)


def curvature(local: LocalMotion) -> Curvature:
    """Second derivatives with respect to displacement and velocity."""
    if local.pieces is None:
        nodes = local.nodes()
        values = kernels.motion(local.motion, nodes.zr, nodes.zi)
        uu, uv, vv = local.element.curvature(values[0], local.rate * values[1], local.coefficients)
        w = nodes.weights
        return Curvature(nodes.zr, nodes.zi, w * uu, None if uv is None else w * uv, None if vv is None else w * vv)
    times, weights = [], []
    for contact in local.contacts():
        speed = _speed(local, contact)
        times.append(contact.instants)
        weights.append(contact.side * local.coefficients[contact.stiffness] / speed)
    tau = np.concatenate(times)
    return Curvature(np.cos(tau), np.sin(tau), np.concatenate(weights), None, None)


def _speed(local: LocalMotion, contact: Contact) -> Array:
    """|du/dtau| at the crossings, kept from zero where the motion grazes (the derivative does not exist there)."""
    zr, zi = np.cos(contact.instants), np.sin(contact.instants)
    speed = np.abs(kernels.motion(local.motion, zr, zi)[1])
    size = float(np.abs(local.motion).max())
    return np.maximum(speed, 1e-12 * max(size, np.finfo(float).tiny))


def coefficient_force(local: LocalMotion) -> CoefficientForce:
    """Derivatives with respect to the element's coefficients."""
    count, top = len(local.coefficients), local.top
    if local.pieces is None:
        nodes = local.nodes()
        x, xd = kernels.motion(local.motion, nodes.zr, nodes.zi)
        f_c, f_uc, f_vc = local.element.coefficient_tangent(x, local.rate * xd, local.coefficients)
        f_cc = local.element.coefficient_curvature(x, local.rate * xd, local.coefficients)

        def project(values: Array) -> ComplexArray:
            flat = np.ascontiguousarray((values * nodes.weights).reshape(-1, len(nodes.weights)))
            return kernels.spectra(flat, nodes.zr, nodes.zi, top).reshape(values.shape[:-1] + (top + 1,))

        return CoefficientForce(project(f_c), project(f_uc), None if f_vc is None else project(f_vc), project(f_cc))
    force = np.zeros((count, top + 1), dtype=complex)
    stiffness = np.zeros((count, top + 1), dtype=complex)
    second = np.zeros((count, count, top + 1), dtype=complex)
    for contact in local.contacts():
        i, j = contact.stiffness, contact.gap
        s, gap = local.coefficients[i], local.coefficients[j]
        chi = contact.chi[: top + 1]
        # the Dirac comb delta(u - gap) along the motion
        zr, zi = np.cos(contact.instants), np.sin(contact.instants)
        comb = kernels.spectra((1.0 / _speed(local, contact))[None, :], zr, zi, top)[0]
        force[i] += kernels.product_spectrum(local.motion, gap, contact.chi, top)
        force[j] -= s * chi
        stiffness[i] += chi
        stiffness[j] -= contact.side * s * comb
        second[i, j] -= chi
        second[j, i] -= chi
        second[j, j] += contact.side * s * comb
    return CoefficientForce(force, stiffness, None, second)


def coefficient_change(local: LocalMotion, rates: Array) -> CoefficientChange:
    """First derivatives along a change of the element's coefficients, `rates` (nc,); kept with the motion."""
    known: dict[bytes, CoefficientChange] = local.__dict__.setdefault("_changes", {})
    key = rates.tobytes()
    if key not in known:
        known[key] = _coefficient_change(local, rates)
    return known[key]


def _coefficient_change(local: LocalMotion, rates: Array) -> CoefficientChange:
    if local.pieces is not None:
        whole = coefficient_force(local)
        return CoefficientChange(rates @ whole.force, rates @ whole.stiffness, None)
    kind = local.kind
    if isinstance(kind, SharpSampling):
        zr, zi, w, x, xd = graded_motion(local.motion, *singularities(kind), local.top)
        nodes = Nodes(zr, zi, w)
    else:
        nodes = local.nodes()
        x, xd = kernels.motion(local.motion, nodes.zr, nodes.zi)
    parts = local.element.coefficient_change(x, local.rate * xd, local.coefficients, rates)
    rows = np.array([part * nodes.weights for part in parts if part is not None])
    found = kernels.spectra(rows, nodes.zr, nodes.zi, local.top)
    return CoefficientChange(found[0], found[1], found[2] if len(found) > 2 else None)
