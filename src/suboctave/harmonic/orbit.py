"""A solved periodic motion, as data, and the forces of single elements along it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suboctave.arguments import Positive, checked
from suboctave.errors import GivenDof, InputError, chosen_dof, shortened
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis, harmonic_index, to_complex, to_real
from suboctave.harmonic.energy import fed
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.harmonic.linear_part import LinearPart
from suboctave.harmonic.quadrature import peak
from suboctave.harmonic.trigonometric import motion
from suboctave.harmonic.truncation import AdaptiveHarmonics
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.system import System
from suboctave.motion import Motion, answer

#: share of a motion that its sub-harmonics may have where it repeats earlier
_REPEATED = 1e-6


@checked(result=True)
@dataclass(frozen=True, eq=False)
class PeriodicOrbit(Motion):
    """One periodic motion of a system, solved by harmonic balance.

    Attributes
    ----------
    balance
        The equations it solves (system, basis, frozen samples).
    x
        The unknowns of these equations, shape (2 H + 1, balance.size): coefficients of all degrees of freedom, or of
        displacements along the directions of its elements; `coefficients` has them all.
    omega
        Circular frequency of the load, rad per unit time.
    values
        Parameter values.
    residual
        Size of the residual in units of the forces that balance.
    truncation
        Estimated size of the neglected harmonics of the motion, relative to the motion (0 if not estimated).
    adaptive
        The rule its harmonics were chosen by, None if their number was given; curves continued from it inherit it.
    zeta
        Of a nonlinear mode the damping ratio that keeps it going: a damping of `-2 zeta omega` per unit of mass, which
        has its share in what moves where no element acts. The equations are those without it.
    """

    balance: HarmonicBalance
    x: Array
    omega: Positive
    values: Mapping[str, float]
    residual: float
    truncation: float = 0.0
    adaptive: AdaptiveHarmonics | None = None
    zeta: float = 0.0

    def __post_init__(self) -> None:
        shape = self.balance.basis.size, self.balance.size
        if self.x.shape != shape:
            raise InputError(f"x must be coefficients of shape {shape}, not {self.x.shape}", ("x",))

    @property
    def basis(self) -> HarmonicBasis:
        """Harmonics and period."""
        return self.balance.basis

    @cached_property
    def system(self) -> System:
        """The system at the orbit's parameter values."""
        system = self.balance.system
        changed = {k: v for k, v in self.values.items() if v != system.parameters[k]}
        return system.moved_to(changed) if changed else system

    @property
    def period(self) -> float:
        """Period of the motion, `2 pi nu / omega`."""
        return 2.0 * math.pi * self.basis.nu / self.omega

    @cached_property
    def floquet(self) -> Any:
        """Floquet multipliers over its own period with their errors, and the verdict: `suboctave.stability`."""
        return answer("floquet_of")(self)

    @property
    def multipliers(self) -> ComplexArray:
        """Floquet multipliers over its own period, (2 N,), by descending modulus."""
        result: ComplexArray = self.floquet.multipliers
        return result

    @property
    def own_period(self) -> int:
        """After how many load periods the motion first repeats; `basis.nu` unless its sub-harmonics vanish."""
        nu, sizes = self.basis.nu, np.linalg.norm(to_complex(self.x) * self.balance.scales[0], axis=1)
        k = np.arange(len(sizes))
        shares = ((d, float(np.linalg.norm(sizes[k % (nu // d) != 0]))) for d in range(1, nu) if nu % d == 0)
        return next((d for d, rest in shares if rest <= _REPEATED * np.linalg.norm(sizes)), nu)

    def state(self) -> BalanceState:
        """The harmonic-balance equations evaluated at this orbit."""
        return self.balance.at(self.x, self.omega, self.values)

    @cached_property
    def _linear(self) -> LinearPart:
        """The linear part at the motion's parameters and frequencies."""
        return fed(self.state(), self.zeta).linear

    @cached_property
    def _moving(self) -> ComplexArray:
        """Complex amplitudes of the linear part's equation of motion, (H + 1, N)."""
        return fed(self.state(), self.zeta).recovered

    @property
    def amplitudes(self) -> ComplexArray:
        """Complex amplitudes `c_k = a_k - i b_k`, shape (H + 1, n): `x = Re sum_k c_k exp(i k omega t / nu)`."""
        return self._linear.shaped(self._moving)

    @property
    def coefficients(self) -> Array:
        """`(a_0, a_1, b_1, ...)`, shape (2 H + 1, n): `x(t) = a_0 + sum_k a_k cos(k omega t / nu) + b_k sin(k omega t /
        nu)`, of all degrees of freedom.
        """
        return to_real(self.amplitudes)

    def displacement(self, t: Array | float) -> Array:
        """x at the times t; shape (n,) for a number, (n, len(t)) for an array (a `Trajectory` has time first)."""
        return self._series(t, 0)

    def velocity(self, t: Array | float) -> Array:
        """dx/dt at the times t; shapes as `displacement`."""
        return self._series(t, 1)

    def acceleration(self, t: Array | float) -> Array:
        """Second time derivative of x at the times t; shapes as `displacement`."""
        return self._series(t, 2)

    def _series(self, t: Array | float, order: int) -> Array:
        rate = self.basis.multiples * self.omega
        try:
            times = np.atleast_1d(np.asarray(t, float))
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"t must be a time or an array of times, not {shortened(t)}") from None
        waves = np.exp(1j * np.multiply.outer(times, rate)) * (1j * rate) ** order
        result = self._linear.shaped(np.real(waves @ self._moving)).T
        return result[:, 0] if np.ndim(t) == 0 else result

    def harmonic(self, k: float, dof: GivenDof = 0) -> complex:
        """Complex amplitude of the component at `k omega`; k may be a fraction for sub-harmonic motions.

        Raises
        ------
        InputError
            If `k nu` is not a whole number, or dof is out of range.
        """
        at = harmonic_index(k, self.basis.nu)
        amplitudes = self._along(dof)
        return complex(amplitudes[at]) if at <= self.basis.harmonics else 0.0 + 0.0j

    def amplitude(self, dof: GivenDof = 0) -> float:
        """Largest |x| of a DOF over the motion's period, found by Newton's method on dx/dt = 0."""
        return peak(self._along(dof))[0]

    def peak_to_peak(self, dof: GivenDof = 0) -> float:
        """Largest minus smallest x of a DOF over the motion's period, found as `amplitude`."""
        c = self._along(dof)
        # lifted, x has one sign, and its largest modulus is at its largest or its smallest value
        lift = 2.0 * float(np.abs(c).sum())
        above, below = c.copy(), -c
        above[0] += lift
        below[0] += lift
        return max(0.0, peak(above)[0] + peak(below)[0] - 2.0 * lift)

    def amplitude_about_mean(self, dof: GivenDof = 0) -> float:
        """Largest distance of a DOF from its mean over the motion's period, found as `amplitude`."""
        c = self._along(dof).copy()
        c[0] = 0.0
        return peak(c)[0]

    def velocity_amplitude(self, dof: GivenDof = 0) -> float:
        """Largest |dx/dt| of a DOF over the motion's period, as `amplitude`."""
        return peak(self._along(dof, 1))[0]

    def acceleration_amplitude(self, dof: GivenDof = 0) -> float:
        """Largest second derivative of x of a DOF, in modulus, over the motion's period, as `amplitude`."""
        return peak(self._along(dof, 2))[0]

    def rms(self, dof: GivenDof = 0, derivative: int = 0) -> float:
        """Root mean square of x over the period, its mean included, or of a derivative by t.

        By Parseval `sqrt(c_0^2 + sum_k |c_k|^2 / 2)`, exact for the harmonics that the motion has.
        """
        c = self._along(dof, derivative)
        return math.sqrt(c[0].real ** 2 + 0.5 * float(np.sum(np.abs(c[1:]) ** 2)))

    def along(self, direction: Array) -> ComplexArray:
        """Complex amplitudes of `direction . x`, shape (H + 1,); `direction`: (n,), over the structure's DOFs."""
        if np.shape(direction) != (self.system.n,):
            raise InputError(f"direction must be {self.system.n} numbers, not of shape {np.shape(direction)}")
        c: ComplexArray = self._moving @ self._linear.seen(direction)
        return c

    def start(self) -> Array:
        """State `(x(0), dx/dt(0))`, shape (2 n,), from which time integration runs into this motion."""
        return np.concatenate((self.displacement(0.0), self.velocity(0.0)))

    def _along(self, dof: GivenDof, derivative: int = 0) -> ComplexArray:
        """Complex amplitudes of one of the structure's DOFs, or of a derivative of it by t, shape (H + 1,)."""
        n = self.balance.system.n
        if isinstance(dof, int | np.integer) and -n <= dof < 0:
            dof = int(dof) + n
        place = chosen_dof(dof, 0, n, names=self.balance.system.dof_names)
        c = self.along(_unit(n, place))
        return c * (1j * self.basis.multiples * self.omega) ** derivative if derivative else c

    def __repr__(self) -> str:
        period = "" if self.basis.nu == 1 else f", {self.basis.nu}T"
        return (
            f"PeriodicOrbit(omega={self.omega:.8g}, harmonics={self.basis.harmonics}{period}, "
            f"residual={self.residual:.1e}, truncation={self.truncation:.1e})"
        )


def _unit(n: int, dof: int) -> Array:
    unit = np.zeros(n)
    unit[dof] = 1.0
    return unit


def amplitude_along(state: BalanceState, dof: int) -> float:
    """Largest |x| of a DOF along an evaluated motion, as `PeriodicOrbit.amplitude`."""
    return peak(state.recovered @ state.linear.seen(_unit(state.balance.system.n, dof)))[0]


def force_along(state: BalanceState, element: int) -> Callable[[Array], Array]:
    """The force f of an element as a function of instants `tau = omega t / nu` (m,), values (m,).

    Of its law, not of a truncated series of the force.
    """
    local = state.local(element)
    law, moving = as_coupled(local.element), local.element.depends_on_velocity

    def force(tau: Array) -> Array:
        zr, zi = np.cos(tau), np.sin(tau)
        values = [motion(one, zr, zi) for one in local.motions]
        q = [u for u, _ in values]
        if moving:
            q += [state.rate * du for _, du in values]
        theta = np.mod(state.basis.nu * tau, 2.0 * math.pi)
        result: Array = law.tangent(np.array(q), theta, local.coefficients)[0]
        return result

    return force
