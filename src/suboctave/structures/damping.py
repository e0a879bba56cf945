"""Viscous damping made of mass and stiffness: Rayleigh's, `C = alpha M + beta K`, and modal,

    C = M Phi diag(2 zeta omega) Phi^T M,        Phi^T M Phi = I.

With the first modes alone, what `beta K` does not give them already, modes beyond have damping in proportion to
stiffness (Clough & Penzien, Dynamics of Structures, 2nd ed. 1993, section 12-3):

    C = beta K + M Phi diag(2 zeta omega - beta omega^2) Phi^T M,        beta = 2 zeta_last / omega_last.

Rayleigh's damps a mode of the circular frequency omega with the ratio `alpha / (2 omega) + beta omega / 2`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from suboctave.arguments import checked
from suboctave.errors import InputError, is_number, shortened
from suboctave.model.expressions.coefficients import Coefficient, Number, named_coefficient
from suboctave.model.frequencies import natural_frequencies
from suboctave.model.inputs import check_count
from suboctave.model.updated import Updated

#: DOFs up to which all modes are damped, by a full matrix: 32 MB of it
MOST_MODAL = 2000


def _check_ratio(ratio: float) -> None:
    """Refuse a damping ratio from 1 on: with it nothing vibrates, and percentages are meant."""
    if ratio >= 1:
        raise InputError(
            f"a damping ratio of {ratio:g} is {100 * ratio:g} per cent of critical: write {ratio / 100:g} for "
            f"{ratio:g} per cent; what is damped so much that it does not vibrate needs a damping matrix"
        )


def written_out(matrix: Any) -> Any:
    """A damping matrix in compressed-row form; InputError where that would be a large full one."""
    import scipy.sparse

    if not isinstance(matrix, Updated):
        return matrix
    if len(matrix.columns) > MOST_MODAL:
        raise InputError(
            f"the modal damping of joined structures is a full matrix, here of {len(matrix.columns)} DOFs, and up to "
            f"{MOST_MODAL} are written to a file: save the structures, and join them when they are read"
        )
    return scipy.sparse.csr_array(matrix.toarray())


@checked
@dataclass(frozen=True)
class Rayleigh:
    """Damping `alpha M + beta K`. Numbers, or expressions in the parameters of the system.

    alpha
        Unit 1 / time: damps low frequencies.
    beta
        Unit time: damps high frequencies.
    """

    alpha: Number = 0.0
    beta: Number = 0.0

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            self._read(name)

    def _read(self, name: str) -> Coefficient:
        return named_coefficient(getattr(self, name), "Rayleigh", name)

    @classmethod
    def from_ratios(cls, first: tuple[float, float], second: tuple[float, float]) -> Rayleigh:
        """The damping with given ratios at two circular frequencies: `(omega1, zeta1), (omega2, zeta2)`.

        Between them modes are damped less, beyond them more. Raises `InputError` for equal frequencies, and for
        ratios from 1 on (0.02 is 2 per cent of critical).
        """
        for pair in (first, second):
            is_pair = isinstance(pair, Sequence) and len(pair) == 2 and all(map(is_number, pair))
            if not is_pair or not pair[0] > 0 or pair[1] < 0:
                what = "a pair of a circular frequency above 0 and a damping ratio from 0 on"
                raise InputError(f"Rayleigh.from_ratios takes twice {what}, not {shortened(pair)}")
            _check_ratio(pair[1])
        (w1, z1), (w2, z2) = first, second
        if w1 == w2:
            raise InputError(f"Rayleigh.from_ratios needs two different frequencies, not twice {w1:g}")
        spread = (w2 - w1) * (w2 + w1)
        return cls(2 * w1 * w2 * (z1 * w2 - z2 * w1) / spread, 2 * (z2 * w2 - z1 * w1) / spread)

    def text(self, name: str) -> str:
        """One of its numbers or expressions as a text."""
        return self._read(name).text

    @property
    def constant(self) -> bool:
        """Whether both are numbers."""
        return self._read("alpha").constant and self._read("beta").constant

    def matrix(self, mass: Any, stiffness: Any) -> Any:
        """The damping matrix (n, n), sparse; `{expression: matrix}` where there are parameters in it."""
        alpha, beta = self._read("alpha"), self._read("beta")
        if self.constant:
            return alpha.value({}) * mass + beta.value({}) * stiffness
        if alpha == beta:
            return {alpha.text: mass + stiffness}
        return {alpha.text: mass, beta.text: stiffness}


@checked
@dataclass(frozen=True)
class ModalDamping:
    """Damping ratios of the modes, the lowest first.

    ratios
        One number for `count` modes (all modes where none is given), or one number for each of the first modes.
        Each is below 1: 0.02 is 2 per cent of critical. Rigid-body modes count, and stay undamped.

    Modes beyond those given have the last ratio in proportion to their frequency, as damping in proportion to stiffness
    gives it: with a last ratio of 0 they are undamped. Structures of more than 2000 degrees of freedom need a count:
    some more than there are modes among the harmonics.
    """

    ratios: float | Sequence[float]
    count: int | None = None

    def __post_init__(self) -> None:
        several = np.ndim(self.ratios) > 0
        given = tuple(np.asarray(self.ratios, dtype=object).ravel().tolist())
        if several:
            object.__setattr__(self, "ratios", given)
        if not given or not all(is_number(ratio) and ratio >= 0 for ratio in given):
            raise InputError(f"damping ratios are numbers from 0 on, not {shortened(self.ratios)}")
        _check_ratio(max(given))
        if self.count is not None and several:
            raise InputError("count= is for one ratio of several modes")
        if self.count is not None:
            object.__setattr__(self, "count", check_count("count", self.count))

    def matrix(self, mass: Any, stiffness: Any) -> Any:
        """The damping matrix (n, n), in compressed-row form; `Updated` where modes beyond those given are left."""
        import scipy.sparse

        n = mass.shape[0]
        if n > MOST_MODAL and self.count is None and not isinstance(self.ratios, tuple):
            raise InputError(
                f"modal damping of all modes is for up to {MOST_MODAL} DOFs, not {n}: say how many modes, "
                f"ModalDamping({self.ratios:g}, count=...), some more than there are among the harmonics"
            )
        ratios = np.array(self.ratios if isinstance(self.ratios, tuple) else [self.ratios] * min(self.count or n, n))
        if len(ratios) > n:
            raise InputError(f"{len(ratios)} damping ratios are given, the structure has {n} modes")
        found = natural_frequencies(mass, stiffness, len(ratios))
        omega = np.where(np.arange(len(found)) < found.growing + found.rigid, 0.0, found.omega)
        momenta = mass @ found.modes
        rates = 2.0 * ratios[: len(omega)] * omega
        if len(ratios) == n:
            full = (momenta * rates) @ momenta.T
            return scipy.sparse.csr_array(0.5 * (full + full.T))
        beta = rates[-1] / omega[-1] ** 2 if omega[-1] > 0.0 else 0.0
        # of motions that grow it takes what their negative stiffness would feed
        squares = np.where(np.arange(len(omega)) < found.growing, -(found.omega**2), omega**2)
        return Updated(scipy.sparse.csr_array(beta * stiffness), momenta, rates - beta * squares)
