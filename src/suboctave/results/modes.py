"""Nonlinear modes as results: frequency, energy and damping over amplitude, and the forcing that reaches one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from suboctave.arguments import checked
from suboctave.curves.trace import BranchPoint
from suboctave.errors import InputError, shortened
from suboctave.harmonic.basis import Array, ComplexArray, HarmonicBasis, to_real
from suboctave.harmonic.condensed import linear_part_of
from suboctave.harmonic.energy import action, fed, mean_energy, modal_amplitude, twice_kinetic
from suboctave.harmonic.evaluation import BalanceState, HarmonicBalance
from suboctave.model.inputs import check_is_system, observed_dof
from suboctave.model.system import System
from suboctave.results.branch import TrackedBranch

#: growth over a period that is none, where harmonics and rounding leave multipliers of a conservative motion off the
#: unit circle
ON_CIRCLE = 1e-4
#: where two more multipliers than those that are +1 by themselves are along curves of events
_CRITICAL = {"LP": (1.0,), "BP": (1.0,), "PD": (-1.0,)}


@checked(result=True)
class ModeCurve(TrackedBranch):
    """A nonlinear mode over its energy; read like a `Branch` over omega, `amplitude` is that of the observed DOF.

    `system` is that of the mode: without oscillating loads, of the conservative form without damping matrices.
    `bifurcations` has extrema of omega, and branch points (`switch_branch` follows the curve that crosses there); of a
    conservative mode limit points (LP), where the energy turns, and period doublings (PD) as well. The curves of its
    LP, BP, PD and extrema of omega over a second parameter (`track`) are read in the same way.
    """

    @property
    def damped(self) -> bool:
        """Whether it is the mode of a damped system (extended periodic motion concept)."""
        return bool(self.options.get("damped"))

    @property
    def frequency(self) -> Array:
        """Circular frequency of the mode, (len,)."""
        return self.omega

    @property
    def damping_ratio(self) -> Array:
        """Modal damping ratio zeta, (len,); zero of a conservative mode."""
        return np.array([point.extra for point in self.tracked])

    def _states(self) -> Iterator[BalanceState]:
        """Its motions with what keeps them going."""
        for point in self.tracked:
            yield fed(point.orbit.state(), point.extra)

    @property
    def energy(self) -> Array:
        """Mean over a period of kinetic and potential energy, zero at rest, (len,); of a conservative mode its energy
        at any time.
        """
        return np.array([mean_energy(state) for state in self._states()])

    @property
    def action(self) -> Array:
        """`1 / (2 pi)` times the integral of momenta over displacements, x' . M x' without gyroscopic forces, over a
        period, (len,): `d energy = omega d action / nu` along a conservative mode of nu periods.
        """
        return np.array([action(state) for state in self._states()])

    @property
    def modal_amplitude(self) -> Array:
        """`sqrt(c . M c)`, c the amplitudes at omega: that of a mode shape of unit modal mass, (len,)."""
        return np.array([modal_amplitude(state) for state in self._states()])

    def deciding(self, point: BranchPoint, multipliers: ComplexArray) -> NDArray[np.bool_]:
        """See `Branch.deciding`: all but the two that are +1 by themselves, and two more on curves of LP, BP and PD."""
        others = np.ones(len(multipliers), dtype=bool)
        for target in (1.0, *_CRITICAL.get(self.kind, ())):
            distance = np.where(others, np.abs(multipliers - target), np.inf)
            others[np.argsort(distance, kind="stable")[:2]] = False
        return others

    def open_at(self, point: BranchPoint) -> NDArray[np.bool_]:
        """See `Branch.open_at`. Multipliers of a conservative motion lie on the unit circle or come off it in pairs:
        one leaves the verdict open if its error is larger than the growth that counts. Of a damped mode none does.
        """
        loose = point.floquet.errors > ON_CIRCLE
        return super().open_at(point) & loose & (not self.damped)

    def stable_at(self, point: BranchPoint) -> bool:
        """Of a conservative mode whether no multiplier lies off the unit circle but the two that are +1 by themselves.
        Of a damped one True: its motions are those of no system that stands by itself, their stability is not told.
        """
        if self.damped:
            return True
        mu, errors = point.floquet.multipliers, point.floquet.errors
        others = self.deciding(point, mu)
        return bool(np.all(np.abs(mu[others]) <= 1.0 + np.maximum(ON_CIRCLE, errors[others])))

    def forcing(
        self, at: int | str | ArrayLike | None = None, system: System | None = None, harmonic: float = 1
    ) -> Array:
        """Amplitude of a load `F cos(harmonic omega t)` that holds the motions at phase resonance, by energy balance.

        What the load puts in over a period, in quadrature with the displacement that it acts along, is what the damping
        takes, with the mode for the motion:

            F = 4 zeta <x' . M x'> / (harmonic |c|),

        c the complex amplitude at `harmonic omega` of the displacement along the load, zeta <...> the work of the
        damping along the motion (Peter, Scheel, Krack & Leine, Synthesis of nonlinear frequency responses with
        experimentally extracted nonlinear modes, Mechanical Systems and Signal Processing 101, 2018; Hill, Cammarano,
        Neild & Wagg, Interpreting the forced responses of a two-degree-of-freedom nonlinear oscillator using backbone
        curves, Journal of Sound and Vibration 349, 2015).

        Parameters
        ----------
        at
            The DOF that the load acts on, by number or name, default the observed one; or its direction, shape (n,).
        system
            The system whose damping counts, default that of the mode; a conservative mode needs one. Its loads are left
            out.

        Returns
        -------
        Array
            F, shape (len,); nan where the displacement along the load has no such component.

        Raises
        ------
        InputError
            If the mode is conservative and no system is given, or one that has not its degrees of freedom.
        """
        n = self.system.n
        if system is None and not self.damped:
            raise InputError("a conservative mode has no damping that a load would balance: give system=, one that has")
        if system is not None:
            check_is_system(system)
            if system.n != n:
                raise InputError(f"system= has {system.n} degrees of freedom, the mode has {n}")
        direction = _direction(self, at)
        states = list(self._states())
        if system is None:
            own = zip(states, self.damping_ratio.tolist(), strict=True)
            powers = [2.0 * zeta * state.omega * twice_kinetic(state) for state, zeta in own]
        else:
            powers = list(_powers(system.without_excitation(), states, self.observe))
        found = []
        for state, power in zip(states, powers, strict=True):
            k = harmonic * state.basis.nu
            index = round(k) if np.isfinite(k) else 0
            if abs(k - index) > 1e-9 or index < 1:
                raise InputError(f"motions of {state.basis.nu} periods have no harmonic {harmonic:g}")
            along = _amplitudes(state)[index] @ direction if index <= state.basis.harmonics else 0.0
            # the mean power of F cos(k omega t) in quadrature is F k omega |c| / 2
            size = harmonic * state.omega * abs(along)
            found.append(2.0 * power / size if size > 0.0 else np.nan)
        return np.array(found)

    @property
    def _head(self) -> str:
        if len(self.names) > 1:
            return super()._head
        values = self.omega
        span = f"omega from {values[0]:.6g} to {values[-1]:.6g}" if len(self) else "empty"
        form = "damped" if self.damped else "conservative"
        leaves = "" if self.departs is None else f"leaves {self.departs}; "
        return f"Nonlinear mode, {form}: {len(self)} points, {span}; {leaves}{self.ended}."


def _direction(curve: ModeCurve, at: int | str | ArrayLike | None) -> Array:
    """The direction of a load, (n,)."""
    n = curve.system.n
    if at is None or isinstance(at, int | np.integer | str):
        direction = np.zeros(n)
        direction[curve.observe if at is None else observed_dof(curve.system, at)] = 1.0
        return direction
    direction = np.asarray(at, dtype=float)
    if direction.shape != (n,) or not np.isfinite(direction).all() or not direction.any():
        raise InputError(f"the direction of a load has {n} finite numbers, not all zero, not {shortened(at)}")
    return direction


def _amplitudes(state: BalanceState) -> ComplexArray:
    """Complex amplitudes of all degrees of freedom, (H + 1, n)."""
    return np.asarray(state.linear.shaped(state.recovered))


def _powers(system: System, states: list[BalanceState], observe: int) -> Iterator[float]:
    """The mean power that the forces of a system take from motions."""
    highest = max((state.basis.harmonics + 0.5) * state.rate for state in states)
    linear = linear_part_of(system, None, highest, None, [observe])
    balances: dict[HarmonicBasis, HarmonicBalance] = {}
    _, damping, stiffness, structural = (part.compact(system.parameters) for part in system.linear_parts)
    for state in states:
        c, basis, omega = _amplitudes(state), state.basis, state.omega
        x = linear.read(to_real(c))
        if basis not in balances:
            balances[basis] = HarmonicBalance(system, basis, linear=linear).settle(x, omega)
        velocity = 1j * state.frequencies[:, None] * c
        force = (stiffness @ c.T + damping @ velocity.T + 1j * (structural @ c.T)).T
        of_laws = 0.5 * omega * float(np.vdot(basis.derivative(x), balances[basis].at(x, omega).force))
        yield 0.5 * float(np.vdot(velocity, force).real) + of_laws


def tracked_class(options: Mapping[str, Any]) -> type[TrackedBranch]:
    """The class of curves that were computed with these options."""
    return ModeCurve if "damped" in options else TrackedBranch
