"""Equilibria along a parameter: motions that do not move, with eigenvalues in the place of multipliers."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suboctave.arguments import checked
from suboctave.curves.hopf import stilled
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.model.linearised import ALL_EIGENVALUES, eigenvalues
from suboctave.results.branch import Branch
from suboctave.results.readings import Readings

if TYPE_CHECKING:
    import pandas


@checked(result=True)
class Equilibria(Branch):
    """A curve of equilibria along one parameter, in order; read like a `Branch`.

    Attributes
    ----------
    bifurcations
        LP (two equilibria meet and vanish), BP (branches cross), "Hopf" (an oscillation begins; `omega` is its circular
        frequency), in the order met.
    omega
        The frequency that they are written with, beyond all at which they may oscillate: a matter of the method.
    """

    shows = "equilibria"

    @cached_property
    def positions(self) -> Array:
        """Displacements of all degrees of freedom, shape (len, n)."""
        return np.array([orbit.displacement(0.0) for orbit in self.orbits])

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Eigenvalues of the linearised equation of motion, `exp(lambda t)`, by descending real part, shape (len, 2 N).

        Of systems with more than 400 degrees of freedom from the multipliers over the period of `omega`, nan where a
        motion is gone within it.
        """
        if self.system.n <= ALL_EIGENVALUES:
            places = zip(self.positions, self.orbits, strict=True)
            values = np.array([eigenvalues(self.system, x, orbit.values) for x, orbit in places])
        else:
            told = np.where(np.abs(self.multipliers) > self.multiplier_errors, self.multipliers, np.nan)
            values = np.log(told) * (self.omega / (2.0 * np.pi))[:, None]
        order = np.argsort(-values.real, axis=1, kind="stable")
        result: ComplexArray = np.take_along_axis(values, order, axis=1)
        return result

    def to_dataframe(self, readings: Readings = False) -> pandas.DataFrame:
        """One row per point: the parameter, |x| of the observed DOF, stability, the leading eigenvalue, errors."""
        import pandas as pd

        table = super().to_dataframe(readings)
        leading = self.eigenvalues[:, 0]
        first = {self.name: table[self.name], "amplitude": table["amplitude"], "stable": table["stable"]}
        first |= {"eigenvalue_real": leading.real, "eigenvalue_imag": leading.imag}
        left_out = ("omega", "multiplier_real", "multiplier_imag", "harmonics", "truncation", *first)
        return pd.DataFrame(first | {name: table[name] for name in table if name not in left_out})

    @property
    def _head(self) -> str:
        values = self.parameter(self.name)
        return (
            f"Equilibria: {len(self)} points ({self.verdicts}), {self.name} from {values[0]:.6g} to {values[-1]:.6g}; "
            f"{self.ended}."
        )

    def __repr__(self) -> str:
        notes = [f"  note: {warning}" for warning in self.warnings]
        rows = [f"{'kind':<6} {self.name:>13} {'omega':>12} {'position':>13}{'criticality':>15}{'residual':>11}"]
        for b in self.bifurcations:
            frequency = f"{b.omega:.9g}" if b.kind == "Hopf" else ""
            label, remark = b.criticality or "", b.remark()
            rows.append(
                f"{b.kind:<6} {b.parameter(self.name):>13.8g} {frequency:>12} {b.amplitude:>13.7g}{label:>15}"
                f"{b.residual:>11.1e}" + (f"  {remark}" if remark else "")
            )
        table = rows if len(rows) > 1 else ["no bifurcations"]
        return "\n".join([self._head, *(f"  {words}" for words in self.basis), *notes, *table])


def as_equilibria(branch: Branch, omega: float) -> Equilibria:
    """A branch of equilibria, written with a frequency, as such: its Neimark-Sacker points are Hopf points."""
    options = {**branch.options, "still": omega}
    own = ("system", "name", "points", "closed", "endings", "observe", "warnings", "audit", "departs", "arrives")
    met = []
    for item in branch.bifurcations.met:
        context = {**(item.context or {}), "still": omega}
        kind = "Hopf" if item.kind == "NS" else item.kind
        met.append(replace(item, kind=kind, orbit=stilled(item.orbit), context=context))
    given = {name: getattr(branch, name) for name in own}
    given["points"] = [replace(point, orbit=stilled(point.orbit)) for point in branch.points]
    return Equilibria(**given, bifurcations=met, events=list(branch.events.met), options=options)
