"""Second and third derivatives of the harmonic-balance equations along perturbations of the motion of any shift.

    R''[a, b] = B(f w0) F''[a, b],    R'''[a, b, c] = B(f w0) F'''[a, b, c]

for a, b, c that change the motion only (omega and the parameters kept: their part is in `second`, up to second order).
F'' and F''' are the Fourier coefficients of `f_qq[a, b]` and `f_qqq[a, b, c]` along the motion (`bends`), at the sums
of the frequencies that go in.
"""

from __future__ import annotations

import numpy as np

from suboctave.harmonic import kernels
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.bends import Bends, bends_of
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.state import BalanceState
from suboctave.harmonic.waves import Frequencies, Waves


def third_derivative(state: BalanceState, a: Array, b: Array, c: Array) -> Array:
    """R'''[a, b, c] along changes of the coefficients, (2 H + 1, size) each; shape (dimension,)."""
    first, second, third = (Waves.of(state, Kind.INTEGER, one) for one in (a, b, c))
    at = Frequencies.of(state, Kind.INTEGER)
    return Multilinear(state).third(first, second, third, at).vector(Kind.INTEGER)


class Multilinear:
    """The second and third derivatives at one motion; what they share is computed once."""

    def __init__(self, state: BalanceState) -> None:
        self.state = state
        self.bends = bends_of(state)

    def second(self, a: Waves, b: Waves, out: Frequencies) -> Waves:
        """R''[a, b] at the frequencies `out`."""
        shift = _shift(out, a, b)
        total = np.zeros((out.count, self.state.balance.size), dtype=complex)
        for bend in self.bends:
            zr, zi, weights = bend.second
            if not len(zr):
                continue
            values = self._all_values(bend, (a, b), zr, zi)
            products = np.einsum("rsn,rn,sn->n", weights, *values)
            total += np.multiply.outer(_project(products, zr, zi, shift, out.count), bend.out)
        return Waves(self._response(total, out), out)

    def third(self, a: Waves, b: Waves, c: Waves, out: Frequencies) -> Waves:
        """R'''[a, b, c] at the frequencies `out`."""
        shift = _shift(out, a, b, c)
        total = np.zeros((out.count, self.state.balance.size), dtype=complex)
        for bend in self.bends:
            for part in bend.third:
                zr, zi = part.zr, part.zi
                if not len(zr):
                    continue
                values = self._all_values(bend, (a, b, c), zr, zi)
                plain = _trilinear(part.weights, *values)
                spectrum = np.zeros(out.count, dtype=complex)
                if part.slopes is not None:
                    slopes = self._all_values(bend, (a.slope, b.slope, c.slope), zr, zi)
                    x, y, z = values
                    plain = plain + _trilinear(part.slopes, slopes[0], y, z)
                    plain += _trilinear(part.slopes, x, slopes[1], z) + _trilinear(part.slopes, x, y, slopes[2])
                    own = _project(_trilinear(part.slopes, x, y, z), zr, zi, shift, out.count)
                    spectrum -= 1j * out.values * own
                spectrum += _project(plain, zr, zi, shift, out.count)
                total += np.multiply.outer(spectrum, bend.out)
        return Waves(self._response(total, out), out)

    def _all_values(self, bend: Bends, waves: tuple[Waves, ...], zr: Array, zi: Array) -> list[ComplexArray]:
        """The same wave is evaluated once."""
        known = {id(one): one for one in waves}
        values = {key: self.values(bend, one, zr, zi) for key, one in known.items()}
        return [values[id(one)] for one in waves]

    def values(self, bend: Bends, a: Waves, zr: Array, zi: Array) -> ComplexArray:
        """Change of q along a perturbation at instants, (Q, N), without the factor of its lowest wave."""
        rows = (a.amplitudes @ bend.ins.T).T
        if bend.moving:
            rows = np.concatenate((rows, 1j * self.state.rate * a.at.values * rows))
        values: ComplexArray = kernels.polynomial(np.ascontiguousarray(rows), zr, zi)
        return values

    def _response(self, force: ComplexArray, out: Frequencies) -> ComplexArray:
        compliance = self.state.linear.compliance(out.values * self.state.rate)
        return force if compliance is None else np.einsum("fij,fj->fi", compliance, force)


def _trilinear(weights: Array, a: ComplexArray, b: ComplexArray, c: ComplexArray) -> ComplexArray:
    if len(weights) == 1:
        return weights[0, 0, 0] * a[0] * b[0] * c[0]
    result: ComplexArray = np.einsum("rsn,rn,sn->n", np.einsum("rstn,tn->rsn", weights, c), a, b)
    return result


def _shift(out: Frequencies, *waves: Waves) -> int:
    """By how many whole frequencies the lowest of a product lies above the lowest wanted."""
    exact = sum(one.at.lowest for one in waves) - out.lowest
    shift = round(exact)
    if abs(exact - shift) > 1e-6:
        raise ValueError("the product of these waves has other frequencies than those asked for")
    return shift


def _project(values: ComplexArray, zr: Array, zi: Array, shift: int, count: int) -> ComplexArray:
    """Fourier coefficients `1/(2 pi) sum_j values_j z_j^(shift - k)`, k = 0 .. count - 1."""
    turned = values * (zr + 1j * zi) ** shift
    parts = kernels.spectra(np.stack((turned.real, turned.imag)), zr, zi, count - 1)
    result: ComplexArray = parts[0] + 1j * parts[1]
    return result
