"""Second and third derivatives of the harmonic-balance equations, analytic.

*Along directions*: changes of the coefficients together with changes of omega and of parameters, to second order. With
`v = omega D u`, the change of an element's velocity along a direction a is `v_a = omega D u_a + omega_a D u`, and to
second order `v_ab = omega_a D u_b + omega_b D u_a`; hence, with q_a = (u_a, v_a) the change of what a law reads,

    F''[a, b] = < sum_rs f_rs q_a,r q_b,s + sum_i f_vi (v_ab)_i >  + terms with the element's coefficients,
    R''[a, b] = A''[a, b] X + A'[a] X_b + A'[b] X_a + S''[a, b].

*Along perturbations of any shift* (`waves`), omega and the parameters kept: `R'' = B(f w0) F''` and `R''' = B(f w0)
F'''`, the Fourier coefficients of `f_qq[a, b]` and `f_qqq[a, b, c]` along the motion, at the sums of the frequencies
that go in. Both are weights at instants: see `aft.law`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from suboctave.harmonic.aft.channel import Channel
from suboctave.harmonic.assembly import apply_blocks, toeplitz
from suboctave.harmonic.basis import Array, ComplexArray, spectrum_to_real, to_complex
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.trigonometric import motion, projected, spectra, wave_sums
from suboctave.harmonic.waves import Frequencies, Kind, Waves

__all__ = ["Direction", "Multilinear", "change_at", "second_derivative", "third_derivative"]


@dataclass(frozen=True)
class Direction:
    """A direction in which motion, omega and parameters change.

    x
        Change of the coefficients, shape (2 H + 1, size).
    rates
        Changes of "omega" and of parameters, by name; absent means zero.
    """

    x: Array
    rates: Mapping[str, float] = field(default_factory=dict)

    @property
    def omega(self) -> float:
        """Change of omega."""
        return self.rates.get("omega", 0.0)

    @property
    def parameters(self) -> dict[str, float]:
        """Changes of the parameters that are not zero."""
        return {k: r for k, r in self.rates.items() if k != "omega" and r != 0.0}


def change_at(channel: Channel, a: Direction, zr: Array, zi: Array) -> Array:
    """Change of q along a direction at instants, (Q, N)."""
    along = channel.along
    values = np.array([motion(to_complex(a.x @ d), zr, zi) for d in channel.ins])
    if not channel.moving:
        return values[:, 0]
    rates = along.rate * values[:, 1]
    if a.omega:
        rates += a.omega / along.nu * np.array([motion(one, zr, zi)[1] for one in along.motions])
    return np.concatenate((values[:, 0], rates))


def _unbalanced_second(state: BalanceState, a: Direction, b: Direction) -> Array:
    """S''[a, b], shape (2 H + 1, size)."""
    result = np.zeros_like(state.x)
    for channel in state.channels:
        force = _force_second(state, channel, a, b) + _by_coefficients(state, channel, a, b)
        result += np.multiply.outer(force, channel.out)
    for first, one in a.rates.items():
        for second, two in b.rates.items():
            if one * two != 0.0:
                result -= one * two * state.load_by(first, second)
    return result


def _force_second(state: BalanceState, channel: Channel, a: Direction, b: Direction) -> Array:
    """F''[a, b] along d_out at fixed coefficients, shape (2 H + 1,)."""
    basis, high = state.basis, state.basis.harmonics
    result = np.zeros(basis.size)
    for zr, zi, weights in channel.second:
        q_a, q_b = change_at(channel, a, zr, zi), change_at(channel, b, zr, zi)
        total = np.einsum("rsn,rn,sn->n", weights, q_a, q_b)
        result += spectrum_to_real(spectra(total[None], np.ones_like(zr), zr, zi, high)[0], high)
    if channel.moving and (a.omega or b.omega):
        for i, d in enumerate(channel.ins):
            change = basis.derivative(a.omega * (b.x @ d) + b.omega * (a.x @ d))
            result += toeplitz(channel.damping(i), high) @ change
    return result


def _by_coefficients(state: BalanceState, channel: Channel, a: Direction, b: Direction) -> Array:
    """What changes of elements' coefficients add to F''[a, b] along d_out, shape (2 H + 1,)."""
    basis, high = state.basis, state.basis.harmonics
    result = np.zeros(basis.size)
    if not (a.parameters or b.parameters):
        return result
    for law, member in channel.members():
        rates_a, rates_b = (member.element.parameter_rates(state.values, one.parameters) for one in (a, b))
        if not (rates_a.any() or rates_b.any()):
            continue
        by = law.by_coefficients(member)
        for rates, other in ((rates_a, b), (rates_b, a)):
            if not rates.any():
                continue
            for i, d in enumerate(channel.ins):
                result += toeplitz(rates @ by.tangent[:, i], high) @ (other.x @ d)
                if by.tangent.shape[1] > channel.count:
                    change = state.omega * basis.derivative(other.x @ d) + other.omega * basis.derivative(state.x @ d)
                    result += toeplitz(rates @ by.tangent[:, channel.count + i], high) @ change
        spectrum = np.einsum("i,j,ijq->q", rates_a, rates_b, by.curvature)
        bent = member.element.parameter_curvature(state.values, a.parameters, b.parameters)
        result += spectrum_to_real(spectrum + bent @ by.force, high)
    return result


def _linear_change(state: BalanceState, a: Direction) -> ComplexArray | None:
    """A'[a] per harmonic, None if zero."""
    linear, freq = state.linear, state.frequencies
    total = a.omega * state.basis.multiples[:, None, None] * linear.stiffness(freq, 1) if a.omega else None
    for name, rate in a.parameters.items():
        block = linear.stiffness_by(freq, (name,))
        if block is not None:
            total = rate * block if total is None else total + rate * block
    return total


def _linear_second(state: BalanceState, a: Direction, b: Direction) -> ComplexArray | None:
    """A''[a, b] per harmonic, None if zero."""
    freq, by = state.frequencies, state.linear.stiffness_by
    m = state.basis.multiples[:, None, None]
    terms: list[tuple[ComplexArray | None, float | Array]] = []
    if a.omega and b.omega:
        terms.append((state.linear.stiffness(freq, 2), a.omega * b.omega * m**2))
    for one, other in ((a, b), (b, a)):
        if one.omega:
            terms += [(by(freq, (name,), 1), one.omega * rate * m) for name, rate in other.parameters.items()]
    for first, rate in a.parameters.items():
        terms += [(by(freq, (first, second)), rate * other) for second, other in b.parameters.items()]
    blocks = [factor * block for block, factor in terms if block is not None]
    return sum(blocks[1:], blocks[0]) if blocks else None


def second_derivative(state: BalanceState, a: Direction, b: Direction) -> Array:
    """R''[a, b], shape (dimension,)."""
    result = np.zeros_like(state.x)
    for block, vector in (
        (_linear_second(state, a, b), state.x),
        (_linear_change(state, a), b.x),
        (_linear_change(state, b), a.x),
    ):
        if block is not None:
            result += apply_blocks(block, vector)
    return (result + _unbalanced_second(state, a, b)).ravel()


def third_derivative(state: BalanceState, a: Array, b: Array, c: Array) -> Array:
    """R'''[a, b, c] along changes of the coefficients, (2 H + 1, size) each; shape (dimension,)."""
    first, second, third = (Waves.of(state, Kind.INTEGER, one) for one in (a, b, c))
    at = Frequencies.of(state, Kind.INTEGER)
    return Multilinear(state).third(first, second, third, at).vector(Kind.INTEGER)


class Multilinear:
    """The second and third derivatives at one motion, along perturbations of any shift."""

    def __init__(self, state: BalanceState) -> None:
        self.state = state
        #: waves and instants with the changes of q there, by channel, wave and instants
        self._known: dict[tuple[int, int, int], tuple[Waves, Array, ComplexArray]] = {}

    def second(self, a: Waves, b: Waves, out: Frequencies) -> Waves:
        """R''[a, b] at the frequencies `out`."""
        shift = _shift(out, a, b)
        total = np.zeros((out.count, self.state.balance.size), dtype=complex)
        for channel in self.state.channels:
            for zr, zi, weights in channel.second:
                values = [self.values(channel, one, zr, zi) for one in (a, b)]
                products = np.einsum("rsn,rn,sn->n", weights, *values)
                total += np.multiply.outer(_project(products, zr, zi, shift, out.count), channel.out)
        return Waves(total, out)

    def third(self, a: Waves, b: Waves, c: Waves, out: Frequencies) -> Waves:
        """R'''[a, b, c] at the frequencies `out`."""
        shift = _shift(out, a, b, c)
        total = np.zeros((out.count, self.state.balance.size), dtype=complex)
        for channel in self.state.channels:
            for zr, zi, weights, corners in channel.third:
                values = [self.values(channel, one, zr, zi) for one in (a, b, c)]
                plain = _trilinear(weights, *values)
                spectrum = np.zeros(out.count, dtype=complex)
                if corners is not None:
                    slopes = [self.values(channel, one.slope, zr, zi) for one in (a, b, c)]
                    x, y, z = values
                    plain = plain + _trilinear(corners, slopes[0], y, z)
                    plain += _trilinear(corners, x, slopes[1], z) + _trilinear(corners, x, y, slopes[2])
                    own = _project(_trilinear(corners, x, y, z), zr, zi, shift, out.count)
                    spectrum -= 1j * out.values * own
                spectrum += _project(plain, zr, zi, shift, out.count)
                total += np.multiply.outer(spectrum, channel.out)
        return Waves(total, out)

    def values(self, channel: Channel, a: Waves, zr: Array, zi: Array) -> ComplexArray:
        """Change of q along a perturbation at the instants of a channel, (Q, N), without the factor of its lowest wave;
        the same wave is evaluated once.
        """
        key = id(channel), id(a), id(zr)
        if key not in self._known:
            rows = (a.amplitudes @ channel.ins.T).T
            if channel.moving:
                rows = np.concatenate((rows, 1j * self.state.rate * a.at.values * rows))
            self._known[key] = a, zr, wave_sums(rows, zr, zi)
        return self._known[key][2]


def _trilinear(weights: Array, a: ComplexArray, b: ComplexArray, c: ComplexArray) -> ComplexArray:
    if len(weights) == 1:
        return weights[0, 0, 0] * a[0] * b[0] * c[0]
    result: ComplexArray = np.einsum("rsn,rn,sn->n", np.einsum("rstn,tn->rsn", weights, c), a, b)
    return result


def _shift(out: Frequencies, *waves: Waves) -> int:
    """By how many whole frequencies the lowest of a product lies above the lowest wanted."""
    exact = sum(one.at.lowest for one in waves) - out.lowest
    shift = round(exact.real)
    if abs(exact - shift) > 1e-6:
        raise ValueError("the product of these waves has other frequencies than those requested")
    return shift


def _project(values: ComplexArray, zr: Array, zi: Array, shift: int, count: int) -> ComplexArray:
    """Fourier coefficients `1/(2 pi) sum_j values_j z_j^(shift - k)`, k = 0 .. count - 1."""
    out = np.empty(count, dtype=complex)
    projected(values, zr, zi, shift, out)
    return out
