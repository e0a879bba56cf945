"""The contract of a law along a motion.

A law acts along one direction d_out and reads q, the displacements `u_i = d_i . x` along its inputs
and, if it depends on velocity, their rates v_i: `q = (u_1, .., u_m, v_1, .., v_m)`, Q entries. Along a periodic motion
it gives

- the Fourier coefficients `g_q = mean(g exp(-i q tau))`, q = 0 .. top, of f and of f_q: they serve every basis
  (integer, half-odd, shifted by kappa), since Galerkin matrices depend on differences and sums of frequencies only;
- second and third derivatives as weights at instants,

      int f_qq[a, b] h dtau = sum_j W_rs(j) a_r b_s h (tau_j),
      int f_qqq[a, b, c] h dtau = sum_j W_rst(j) a_r b_s c_t h (tau_j) + V_rst(j) d/dtau (a_r b_s c_t h) (tau_j);

- derivatives by the coefficients of its elements (stiffness, gap, ...).

V comes from corners. Where the force has a jump eta of its slope f_r at q_r = level, f_rr holds `eta delta(q_r -
level)`, and the third derivative `eta delta'`, of which

    int delta'(q_r - level) g dtau = -sum_i (1 / |q_r'|) d/dtau (g / q_r')  at the instants tau_i of passing,

besides Dirac functions with the jumps of f_rs. A piecewise-linear law has nothing else.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.lazy import lazy
from suboctave.model.elements.base import BaseElement
from suboctave.model.elements.smoothness import Sampling

__all__ = ["Along", "CoefficientSpectra", "LawAlong", "LocalMotion", "Member", "Second", "Third"]


class Member(NamedTuple):
    """An element at parameter values: its number in the system, itself, the smoothness of its law, its coefficients,
    and its frozen number of samples, None where the smoothness decides.
    """

    number: int
    element: BaseElement
    kind: Sampling
    coefficients: Array
    samples: int | None


@dataclass(eq=False)
class Along:
    """The displacements that a law reads.

    motions
        Complex coefficients of the displacement along every input, (m, H + 1).
    rate, nu
        Base frequency `omega / nu`, and the motion's period in periods of the load.
    moving
        Whether q has the rates too.
    top
        Highest Fourier coefficient that is wanted.
    """

    motions: ComplexArray
    rate: float
    nu: int
    moving: bool
    top: int

    @property
    def motion(self) -> ComplexArray:
        """The displacement along the first input, (H + 1,)."""
        first: ComplexArray = self.motions[0]
        return first

    @property
    def high(self) -> int:
        """Highest harmonic H."""
        return self.motions.shape[1] - 1

    @lazy
    def size(self) -> int:
        """Number Q of entries of q."""
        return 2 * len(self.motions) if self.moving else len(self.motions)

    def reaching(self, top: int) -> Along:
        """The same with Fourier coefficients up to `top`."""
        return replace(self, top=top)


class Second(NamedTuple):
    """Second derivatives as weights W (Q, Q, N) at instants `z = exp(i tau)`."""

    zr: Array
    zi: Array
    weights: Array


class Third(NamedTuple):
    """Third derivatives as weights W and V (Q, Q, Q, N) at instants; V is None where there is no corner."""

    zr: Array
    zi: Array
    weights: Array
    slopes: Array | None


class CoefficientSpectra(NamedTuple):
    """Fourier coefficients of `f_c` (nc, top + 1), `f_qc` (nc, Q', top + 1) and `f_cc` (nc, nc, top + 1)."""

    force: ComplexArray
    tangent: ComplexArray
    curvature: ComplexArray


class LocalMotion(NamedTuple):
    """An element on a motion: itself, the smoothness of its law, its coefficients, and the complex coefficients of
    every displacement that it reads, (m, H + 1).
    """

    element: BaseElement
    kind: Sampling
    coefficients: Array
    motions: ComplexArray

    @property
    def motion(self) -> ComplexArray:
        """The first of these displacements, (H + 1,)."""
        first: ComplexArray = self.motions[0]
        return first


class LawAlong(ABC):
    """A law, or the sum of laws of one kind, along a motion; a new kind of law is a new subclass.

    Of q it reads the first entries, Q' in number: the displacements alone, if it does not depend on velocity.
    """

    #: whether the smoothness classes of its elements are all of their laws
    whole = False

    def __init__(self, along: Along, members: Sequence[Member]) -> None:
        self.along = along
        self.members = members

    @abstractmethod
    def add_spectra(self, out: ComplexArray) -> None:
        """Add the Fourier coefficients of f and f_q to `out` (1 + Q, top + 1)."""

    @abstractmethod
    def second(self) -> list[Second]:
        """Second derivatives, (Q', Q', N)."""

    @abstractmethod
    def third(self) -> list[Third]:
        """Third derivatives, (Q', Q', Q', N)."""

    @abstractmethod
    def by_coefficients(self, member: Member) -> CoefficientSpectra:
        """Derivatives by the coefficients of one of its elements."""

    @abstractmethod
    def add_change(self, rates: Mapping[int, Array], out: ComplexArray) -> None:
        """Add what changes of elements' coefficients, `rates` (nc,) by element, do to f and f_q to `out` (1 + Q,
        top + 1).
        """

    def settled_samples(self, member: Member, settled: Callable[[ComplexArray, ComplexArray], bool]) -> int | None:
        """Number of samples with which force and tangent of one of its elements have settled; None where the smoothness
        decides. `settled`: whether spectra of both (1 + Q, top + 1) with half the samples, and with all, are the same.
        """
        return None
