"""What a normal form consists of, and how a criticality is read from it: see `normal_form`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from suboctave.errors import InputError, suggest
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"
#: share of the terms that add up to it below which a number counts as zero whatever its estimated error
ROUNDING = 1e-9


@dataclass(frozen=True)
class NormalForm:
    """Coefficients of the normal form of a bifurcation in its free parameter.

    Attributes
    ----------
    kind
        "LP", "BP", "PD" or "NS".
    parameter
        Name of the free parameter.
    coefficients
        By name, see `bifurcation.normal_form`. LP: a, b, g, curvature. PD: c3, d, g, curvature. BP: a, b, c, g, and at
        a pitchfork c3, curvature. NS: c3, d (growth), c3_frequency, d_frequency (their imaginary parts), curvature.
    errors
        Estimated errors of those that decide, by the same names: from how they change with two thirds and with half of
        the harmonics.
    criticality
        "supercritical", "subcritical", or None: at an LP, at a transcritical BP, and where no sign is certain.
    shape
        "transcritical" or "pitchfork" at a BP, else empty.
    remark
        Why there is no criticality, and resonances, in words.
    """

    kind: str
    parameter: str
    coefficients: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)
    criticality: str | None = None
    shape: str = ""
    remark: str = ""

    def __getitem__(self, name: str) -> float:
        if name not in self.coefficients:
            raise InputError(f"unknown coefficient {name!r}{suggest(name, list(self.coefficients))}")
        return self.coefficients[name]

    def __repr__(self) -> str:
        words = [f"{name}={value:.5g}" for name, value in self.coefficients.items()]
        label = " ".join(word for word in (self.criticality, self.shape) if word)
        return f"<normal form of {self.kind}{', ' + label if label else ''}: {', '.join(words)}>"


@dataclass(frozen=True)
class Terms:
    """Coefficients at one motion, the sizes of the sums that those which decide are made of, and the unit that the
    length of psi gives them.
    """

    coefficients: dict[str, float]
    sizes: dict[str, float]
    unit: float


def with_criticality(form: NormalForm) -> NormalForm:
    """The same with the sign of c3 read, where it is certain."""
    for key, words in (
        ("g", "a double multiplier: neither super- nor subcritical"),
        ("c3", "cubic coefficient zero within its error"),
    ):
        value, error = form.coefficients.get(key), form.errors.get(key)
        if value is None or error is None:
            continue
        if not abs(value) > error:
            return replace(form, criticality=None, remark=words)
    return replace(form, criticality=SUPERCRITICAL if form.coefficients["c3"] < 0.0 else SUBCRITICAL)


def unweighted(state: BalanceState, vector: np.ndarray) -> np.ndarray:
    """A null vector in the coefficients' own units."""
    scale: Array = np.tile(state.balance.scales()[1], len(vector) // state.balance.size)
    return vector * scale
