"""Curves of bifurcations by the other formulations: the null vector among the unknowns, and the published system.

    extended       [R; J phi; (phi^H phi - 1) / 2]       unknowns (X, phi, two parameters), and kappa at an NS
    alcorta2019    [R; Re(conj(c) g)]                    unknowns (X, two parameters)

J is weighted by masses and in units of omega^2; at an NS phi is complex, and `Im c^H phi = 0`, c the last phi, fixes
its rotation. In the published system (`alcorta`) N phi = 0 has no exact solution: |N phi|, or the modulus of the
bordered scalar g of N, is made least along the response curve, where g changes by g_1: that is where `Re(conj(g_1) g) =
0`. c is g_1 of the last point, of unit modulus. The minimally augmented system stays at hand, for the tests along the
curve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suboctave.bifurcation.bordered import Bordered, NullVectors, bordered, null_vectors, weighted_operator
from suboctave.curves.kinds.singular import SingularEquations, SingularOperator
from suboctave.errors import ConvergenceError
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.derivatives import Direction
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind, operator_along
from suboctave.lazy import lazy

#: changes of the unit null vector that count as one in arclength: it does not govern the steps
_SPAN = 100.0


# ----------------------------------------------------------------------------------------------------------- extended
@dataclass(frozen=True)
class ExtendedOperator(SingularOperator):
    """J_kappa phi = 0 with phi of unit length, weighted by masses; `rows`, `size`: entries of phi, and per wave."""

    rows: int = 0
    size: int = 1

    @classmethod
    def started(
        cls, state: BalanceState, kind: Kind, kappa: float = 0.0, vectors: NullVectors | None = None
    ) -> tuple[ExtendedOperator, Array]:
        """See `SingularOperator.started`; the unknowns are (kappa, phi)."""
        borders = null_vectors(state, kind, kappa) if vectors is None else vectors
        own = cls(kind, borders, state.omega**2, len(borders.right), state.balance.size)
        return own, own.packed(borders.right, kappa)

    @property
    def extras(self) -> int:
        """kappa, where it is free, and phi in real numbers."""
        return 2 * self.rows + 1 if self.kind is Kind.FREE else self.rows

    def packed(self, phi: np.ndarray, kappa: float) -> Array:
        """The extra unknowns."""
        return np.concatenate(([kappa], phi.real, phi.imag)) if self.kind is Kind.FREE else phi.astype(float)

    def phi(self, extra: Array) -> np.ndarray:
        """The null vector of the extra unknowns."""
        if self.kind is not Kind.FREE:
            return extra
        vector: np.ndarray = extra[1 : self.rows + 1] + 1j * extra[self.rows + 1 :]
        return vector

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> ExtendedEquations:
        return ExtendedEquations(self, state, extra, names)

    def spans(self, rate: float) -> Array:
        spans = np.full(self.extras, _SPAN)
        if self.kind is Kind.FREE:
            spans[0] = rate
        return spans

    def resized(self, basis: HarmonicBasis, size: int) -> ExtendedOperator:
        borders = self.borders.resized(basis, size, self.kind)
        return replace(self, borders=borders, rows=len(borders.right))

    def carried(self, extra: Array, basis: HarmonicBasis, size: int) -> Array:
        phi = self.phi(extra)
        vectors = NullVectors(phi, phi).resized(basis, size, self.kind)
        kappa = float(extra[0]) if self.kind is Kind.FREE else 0.0
        return replace(self, rows=len(vectors.right)).packed(vectors.right * np.linalg.norm(phi), kappa)

    def shifted(self, extra: Array, angle: float) -> Array:
        if angle == 0.0:
            return extra
        kappa, phi = float(extra[0]), self.phi(extra).reshape(-1, self.size)
        if self.kind is Kind.FREE:
            k = np.arange(len(phi)) - len(phi) // 2
            return self.packed((np.exp(1j * k * angle)[:, None] * phi).ravel(), kappa)
        first = 1 if self.kind is Kind.INTEGER else 0
        turn = angle * (np.arange(len(phi) // 2) + (1.0 if first else 0.5))[:, None]
        turned = phi.copy()
        turned[first::2] = np.cos(turn) * phi[first::2] + np.sin(turn) * phi[first + 1 :: 2]
        turned[first + 1 :: 2] = np.cos(turn) * phi[first + 1 :: 2] - np.sin(turn) * phi[first::2]
        return self.packed(turned.ravel(), kappa)


class ExtendedEquations(SingularEquations):
    """J phi in units of omega^2, and the normalisation."""

    of: ExtendedOperator

    def __init__(self, of: ExtendedOperator, state: BalanceState, extra: Array, names: tuple[str, ...]) -> None:
        super().__init__(of, state, float(extra[0]) if of.kind is Kind.FREE else 0.0, names)
        self.phi = of.phi(extra)

    @lazy
    def _operator(self) -> tuple[np.ndarray, np.ndarray]:
        matrix, scale = weighted_operator(self.state, self.of.kind, self.kappa)
        return matrix / self.of.unit, scale

    @property
    def _complex(self) -> bool:
        return self.of.kind is Kind.FREE

    @lazy
    def values(self) -> Array:
        product = self._operator[0] @ self.phi
        length = 0.5 * (float(np.vdot(self.phi, self.phi).real) - 1.0)
        if not self._complex:
            return np.append(product, length)
        turned = float(np.vdot(self.of.borders.right, self.phi).imag)
        return np.concatenate((product.real, product.imag, [length, turned]))

    @property
    def rows(self) -> Array:
        state, kind = self.state, self.of.kind
        matrix, scale = self._operator
        n, m = state.balance.dimension, len(self.phi)
        zero = np.zeros_like(state.x)
        units = np.eye(n).reshape(n, *state.x.shape)
        directions = [Direction(unit) for unit in units]
        directions += [Direction(zero, {name: 1.0}) for name in self.names]
        shifts = [0.0] * len(directions)
        if self._complex:
            directions.insert(n, Direction(zero))
            shifts.insert(n, 1.0)
        by = operator_along(state, kind, self.phi * scale, directions, self.kappa, shifts)
        by = by * (scale / self.of.unit)[:, None]
        if not self._complex:
            last = np.concatenate((np.zeros(n), self.phi, np.zeros(len(self.names))))
            return np.vstack((np.hstack((by[:, :n], matrix, by[:, n:])), last))
        end = n + 1 + 2 * m
        out = np.zeros((2 * m + 2, end + len(self.names)))
        out[:m, : n + 1], out[m : 2 * m, : n + 1] = by[:, : n + 1].real, by[:, : n + 1].imag
        out[: 2 * m, n + 1 : end] = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
        out[:m, end:], out[m : 2 * m, end:] = by[:, n + 1 :].real, by[:, n + 1 :].imag
        out[-2, n + 1 : end] = np.concatenate((self.phi.real, self.phi.imag))
        c = self.of.borders.right
        out[-1, n + 1 : end] = np.concatenate((-c.imag, c.real))
        return out

    def renewed(self) -> ExtendedOperator:
        unit = self.phi / np.linalg.norm(self.phi)
        # the left vector serves the tests along the curve
        return replace(self.of, borders=NullVectors(unit, self.bordered.vectors.left), unit=self.state.omega**2)


# ---------------------------------------------------------------------------------------------------------- published
@dataclass(frozen=True)
class PublishedDoubling(SingularOperator):
    """Where |N phi| is least along the response curve; `waves` border N, `turn` is c, None for that of the motion."""

    waves: NullVectors | None = None
    turn: complex | None = None

    @classmethod
    def started(
        cls, state: BalanceState, kind: Kind = Kind.HALF, kappa: float = 0.0, vectors: NullVectors | None = None
    ) -> tuple[PublishedDoubling, Array]:
        waves = null_vectors(state, Kind.FREE, 0.5 * state.rate)
        borders = null_vectors(state, Kind.HALF) if vectors is None else vectors
        return cls(Kind.HALF, borders, state.omega**2, waves), np.zeros(0)

    def at(self, state: BalanceState, extra: Array, names: tuple[str, ...]) -> PublishedEquations:
        return PublishedEquations(self, state, 0.0, names)

    def resized(self, basis: HarmonicBasis, size: int) -> PublishedDoubling:
        assert self.waves is not None
        waves = self.waves.resized(basis, size, Kind.FREE)
        return replace(self, borders=self.borders.resized(basis, size, self.kind), waves=waves)


class PublishedEquations(SingularEquations):
    """`Re(conj(c) g)` of N in units of omega^2."""

    of: PublishedDoubling

    @lazy
    def published(self) -> Bordered:
        """g of N = J_kappa at half the base frequency."""
        assert self.of.waves is not None
        return bordered(self.state, Kind.FREE, self.of.waves, 0.5 * self.state.rate)

    @lazy
    def turn(self) -> complex:
        """c, of unit modulus."""
        return _turn(self.published, self.names[0]) if self.of.turn is None else self.of.turn

    @lazy
    def values(self) -> Array:
        return np.array([(self.turn.conjugate() * self.published.g).real / self.of.unit])

    @property
    def rows(self) -> Array:
        by_x, rates = _slopes(self.published, self.names)
        whole = np.concatenate((by_x, [rates[name] for name in self.names]))
        row: Array = (self.turn.conjugate() * whole).real / self.of.unit
        return row[None, :]

    def renewed(self) -> PublishedDoubling:
        state, waves = self.state, self.published.vectors
        turn = _turn(bordered(state, Kind.FREE, waves, 0.5 * state.rate), self.names[0])
        return replace(self.of, borders=self.bordered.vectors, unit=state.omega**2, waves=waves, turn=turn)


def _slopes(border: Bordered, names: tuple[str, ...]) -> tuple[np.ndarray, dict[str, complex]]:
    """Derivatives of g of N by coefficients and names, kappa following omega."""
    by_x, rates, by_kappa = border.gradient(tuple(dict.fromkeys(names)))
    if "omega" in rates:
        rates = {**rates, "omega": rates["omega"] + 0.5 * by_kappa / border.state.basis.nu}
    return by_x, rates


def _turn(border: Bordered, name: str) -> complex:
    """The change of g along the response curve over a parameter, of unit modulus."""
    state = border.state
    by_x, rates = _slopes(border, (name,))
    along = np.linalg.solve(state.jacobian, -state.residual_by(name))
    change = complex(by_x @ along) + rates[name]
    if not abs(change) > 0.0:
        raise ConvergenceError("the system does not tell where on the response curve to look")
    return complex(change / abs(change))
