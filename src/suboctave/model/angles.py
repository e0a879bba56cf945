"""Angles: displacements that mean the same position again a whole turn further.

Where the equation of motion is the same at `x` and at `x + p`, p (n,) a turn, two states are the same motion if they
differ by whole turns. With the turns as rows of P (k, n), a difference of displacements d counts as

    d - round(d P^+) P,   P^+ the pseudo-inverse,

the nearest of all that differ from it by whole turns, if no degree of freedom belongs to several turns. `Turns.modulo`
is the one place where states are compared so.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from suboctave.errors import InputError, chosen_dof, dof_text, is_number, shortened
from suboctave.model.elements.base import Array, numbers_of
from suboctave.model.elements.coupled import as_coupled, reads
from suboctave.model.elements.smoothness import levels
from suboctave.model.expressions.coefficients import coefficient

#: states at which forces are compared with those a turn further; decades of displacements in turns, and of velocities
_STATES, _TURNS, _DECADES = 256, 3.0, 3.0
#: difference between both, relative to the largest force met, that is rounding, or a turn written with nine digits
_ROUNDING = 1e-8


@dataclass(frozen=True)
class Angle:
    """Degrees of freedom that turn together, and by how much each of them does in a turn."""

    dofs: tuple[int, ...]
    periods: tuple[float, ...]

    def turn(self, n: int) -> Array:
        """The translation of a turn, (n,)."""
        result = np.zeros(n)
        result[list(self.dofs)] = self.periods
        return result

    def name(self, names: Sequence[str]) -> str:
        """What messages call it."""
        return " with ".join(names[dof] if names else f"x_{dof}" for dof in self.dofs)


class Turns:
    """The turns of a system, rows of P (k, n); none of most."""

    def __init__(self, rows: Any) -> None:
        self.rows: Array = np.asarray(rows, dtype=float)
        inverse: Any = np.linalg.pinv(self.rows) if len(self.rows) else self.rows.T
        self.inverse: Array = inverse
        #: by how much each coordinate grows in a turn, infinite of those that are no angles, (n,)
        grown = np.abs(self.rows).max(axis=0, initial=0.0)
        self.periods: Array = np.where(grown > _ROUNDING * grown.max(initial=0.0), grown, np.inf)

    def __bool__(self) -> bool:
        return len(self.rows) > 0

    def counts(self, states: Any) -> NDArray[np.int_]:
        """Whole turns (..., k) in displacements (..., n) or states (..., 2n); 0 where there are no numbers."""
        whole = np.rint(np.asarray(states)[..., : self.rows.shape[1]] @ self.inverse)
        return np.nan_to_num(whole, posinf=0.0, neginf=0.0).astype(int)

    def modulo(self, differences: Any) -> Array:
        """Differences of displacements (..., n) or states (..., 2n) without whole turns."""
        values: Array = np.asarray(differences, dtype=float)
        if not self:
            return values
        values, n = values.copy(), self.rows.shape[1]
        values[..., :n] -= self.counts(values) @ self.rows
        return values

    def folded(self, displacements: Array) -> Array:
        """|x| (..., n) of angles taken within half a turn, of other displacements as it is."""
        folds = np.where(np.isfinite(self.periods), self.periods, 1.0)
        within = np.abs(displacements - folds * np.rint(displacements / folds))
        return np.where(np.isfinite(self.periods), within, np.abs(displacements))


#: those of a system without angles
NO_TURNS = Turns(np.zeros((0, 0)))


def read_angles(given: Any, n: int, names: Sequence[str]) -> tuple[Angle, ...]:
    """What a user gives: degrees of freedom by number or name, several that turn together as a list; or these as a
    mapping to the size of a turn (default 2 pi), a number or a text such as "2*pi/3".
    """
    if given is None:
        return ()
    if isinstance(given, str | int) or not isinstance(given, Iterable):
        given = [given]
    angles = [_angle(one, given[one] if isinstance(given, Mapping) else "2*pi", n, names) for one in given]
    taken = [dof for angle in angles for dof in angle.dofs]
    for dof in taken:
        if taken.count(dof) > 1:
            raise InputError(f"angles: {names[dof] if names else f'DOF {dof}'} is named twice", ("angles",))
    return tuple(angles)


def _angle(given: Any, period: Any, n: int, names: Sequence[str]) -> Angle:
    several = isinstance(given, list | tuple) and not (isinstance(given, tuple) and dof_text(given) in names)
    if several and not given:
        raise InputError("angles: an empty list names no degree of freedom", ("angles",))
    dofs = tuple(chosen_dof(dof, 0, n, "angles", names) for dof in (given if several else [given]))
    listed = list(period) if isinstance(period, list | tuple | np.ndarray) else [period] * len(dofs)
    if len(listed) != len(dofs):
        raise InputError(f"angles: {len(dofs)} degrees of freedom, {len(listed)} sizes of a turn", ("angles",))
    return Angle(dofs, tuple(_period(one) for one in listed))


def _period(given: Any) -> float:
    text = coefficient(given) if isinstance(given, str) else None
    if text is not None and not text.constant:
        raise InputError(f"angles: the size of a turn is a number such as 2*pi, not {given!r}", ("angles",))
    value = given if text is None else text.value({})
    if isinstance(value, bool) or not is_number(value) or not math.isfinite(value) or value == 0.0:
        raise InputError(f"angles: the size of a turn is a number other than zero, not {shortened(given)}", ("angles",))
    return float(value)


_DECLARED = re.compile(
    r"(?:^|[;\n])\s*angles?\s+([^\W\d]\w*(?:\s*:[^;,\n]+)?(?:\s*,\s*[^\W\d]\w*(?:\s*:[^;,\n]+)?)*)\s*(?=$|[;\n])"
)


def declared_angles(texts: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Equations without their declarations of angles, and these: `angle x`, `angle x, y: pi` as a text of its own, or
    behind an equation and a semicolon.
    """
    equations, declared = [], {}
    for text in texts:
        for found in _DECLARED.finditer(text):
            for part in found[1].split(","):
                name, _, period = part.partition(":")
                declared[name.strip()] = period.strip() or "2*pi"
        rest = _DECLARED.sub("", text)
        if rest.strip():
            equations.append(rest)
    return equations, declared


def check_angles(system: Any) -> None:
    """Refuse an angle a turn of which changes a force, at the system's parameters."""
    for angle in system.angles:
        _check(system, angle)


def _check(system: Any, angle: Angle) -> None:
    n, values, turn = system.n, system.parameters, angle.turn(system.n)
    parts: list[tuple[str, Array, Array]] = []  # what acts, its forces (n, N) at states, and those a turn further
    for what in ("stiffness", "structural"):
        force = np.asarray(getattr(system, what).sparse_value(values) @ turn)[:, None]
        if force.any():
            name = "the structural damping" if what == "structural" else "the stiffness"
            parts.append((name, np.zeros_like(force), force))
    moved = [e for e in system.elements if np.any(np.asarray(e.inputs(n)) @ turn)]
    if moved:
        states = _states(system, moved, angle)
        theta = np.linspace(0.0, 2.0 * np.pi, states.shape[1], endpoint=False)
        for element in moved:
            law, rows, acting = as_coupled(element), np.asarray(element.inputs(n)), element.direction(n)
            q, further = rows @ states[:n], np.zeros((len(rows), 1)) + (rows @ turn)[:, None]
            if element.depends_on_velocity:
                q = np.concatenate((q, rows @ states[n:]))
                further = np.concatenate((further, np.zeros((len(rows), 1))))
            c = element.coefficient_values(values)
            with np.errstate(all="ignore"):
                both = [np.asarray(law.tangent(at, theta, c)[0], dtype=float) for at in (q, q + further)]
            here, there = (np.outer(acting, np.broadcast_to(force, theta.shape)) for force in both)
            parts.append((element.label, here, there))
    known = np.ones(1, dtype=bool)
    for _, here, there in parts:
        known = known & np.isfinite(here).all(axis=0) & np.isfinite(there).all(axis=0)
    scale = sum((np.abs([h, t])[..., _of(known, h)].max(initial=0.0) for _, h, t in parts), 0.0)
    changes = [(name, (there - here)[:, _of(known, here)]) for name, here, there in parts]
    total: Any = sum(change for _, change in changes)
    if parts and np.abs(total).max(initial=0.0) > _ROUNDING * scale:
        wrong = [name for name, change in changes if np.abs(change).max(initial=0.0) > _ROUNDING * scale]
        named = angle.name(system.dof_names)
        raise InputError(
            f"angles: {named} is no angle of {'/'.join(f'{p:.6g}' for p in angle.periods)}: a turn further the force "
            f"of {' and '.join(wrong[:3])} is another one (by up to {np.abs(total).max():.3g}). An angle enters forces "
            "by functions that repeat with a turn, such as sin",
            ("angles",),
        )


def _of(known: NDArray[np.bool_], forces: Array) -> Any:
    """The states that count, of forces that are the same at all states too."""
    return known if forces.shape[1] == len(known) else slice(None)


def _states(system: Any, elements: Sequence[Any], angle: Angle) -> Array:
    """States (2n, N) of all sizes, and beside the corners of laws; of the degrees of freedom that elements read."""
    n, random, size = system.n, np.random.default_rng(0), min(map(abs, angle.periods))
    read = np.flatnonzero(np.any(np.vstack([np.asarray(e.inputs(n)) for e in elements]), axis=0))
    corners = []
    for element in elements:
        c, along = element.coefficient_values(system.parameters), reads(element, n)
        dof = int(np.argmax(np.abs(along)))
        corners += [(dof, level / along[dof]) for level in levels(element.sampling(c), c) if np.isfinite(level)]
    count = _STATES * (1 + len(corners))
    states = np.zeros((2 * n, count))
    signs = random.choice([-1.0, 1.0], (2 * len(read), count))
    sizes = size * 10.0 ** random.uniform(-_DECADES, _TURNS, (2 * len(read), count))
    near = random.uniform(size=sizes.shape) < 0.5
    states[np.concatenate((read, n + read))] = signs * np.where(near, size * random.uniform(size=sizes.shape), sizes)
    for i, (dof, level) in enumerate(corners, 1):
        states[dof, i * _STATES : (i + 1) * _STATES] = level + 2.0 * size * random.uniform(-1.0, 1.0, _STATES)
    return states


def numbered(description: Any) -> tuple[Angle, ...]:
    """Angles that were written down as `[[dofs, periods], ...]`."""
    return tuple(Angle(tuple(int(d) for d in dofs), tuple(numbers_of(p).tolist())) for dofs, p in description)
