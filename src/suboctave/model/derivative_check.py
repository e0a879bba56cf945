"""Are the derivatives of an element those of its force? Finite differences answer, for whoever writes an element."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.errors import InputError, check_numbers, shortened
from suboctave.model.coupled import CoupledElement
from suboctave.model.element import Array, BaseElement, Element
from suboctave.model.sampling import (
    CornerSampling,
    PiecewiseLinear,
    PolynomialSampling,
    SharpSampling,
    SharpVelocitySampling,
)

__all__ = ["DerivativeReport", "check_derivatives"]

# Step of the differences, as a share of the length over which the law changes: truncation (step^4 / 30 times a fifth
# derivative) and rounding (1e-16 / step, more behind a sharp corner) both stay below 1e-7 there.
_STEP = 2e-3


@dataclass(frozen=True)
class DerivativeReport:
    """Worst error of every derivative, relative to the largest value it takes; `ok` if none exceeds `rtol`.

    `errors` maps names such as "f_u" or "f_c[gap]" to errors; `messages` lists what is wrong beyond numbers (shapes,
    values that are not finite, a missing `f_v`).
    """

    element: str
    rtol: float
    errors: Mapping[str, float]
    messages: tuple[str, ...] = field(default=())

    @property
    def ok(self) -> bool:
        """Whether every derivative is right."""
        return not self.messages and all(error <= self.rtol for error in self.errors.values())

    def __bool__(self) -> bool:
        return self.ok

    def __str__(self) -> str:
        lines = [f"{self.element}: derivatives {'agree' if self.ok else 'DO NOT agree'} with finite differences"]
        width = max((len(name) for name in self.errors), default=0)
        for name, error in self.errors.items():
            mark = "" if error <= self.rtol else f"   more than {self.rtol:g}"
            lines.append(f"  {name:<{width}}  {error:.1e}{mark}")
        return "\n".join(lines + [f"  {message}" for message in self.messages])

    __repr__ = __str__


def check_derivatives(
    element: BaseElement,
    parameters: Mapping[str, float] | None = None,
    u: ArrayLike | None = None,
    v: ArrayLike | None = None,
    rtol: float = 1e-6,
) -> DerivativeReport:
    """Compare every derivative that an element provides with central differences of fourth order.

    `u`, `v` (N,): where to look (default: around the gaps or sharp points, on both sides of each). Those closer to
    a corner of a piecewise-linear law than the step are left out. `parameters` gives the element's expressions their
    numbers. Errors are relative to the largest value that the derivative takes there; `rtol` bounds them. Of a coupled
    element, u and v are (m, N), one row per input.
    """
    if not isinstance(element, BaseElement):
        raise InputError(f"the first argument must be an element such as CubicSpring(..), not {shortened(element)}")
    if parameters is not None and not isinstance(parameters, Mapping):
        raise InputError(f"parameters must be a mapping {{name: number}}, not {shortened(parameters)}")
    check_numbers(**{str(name): value for name, value in (parameters or {}).items()})
    c = element.coefficient_values(parameters or {})
    if isinstance(element, CoupledElement):
        from suboctave.model.derivative_check_coupled import check_coupled

        errors, messages = check_coupled(element, c, u, v)
        return DerivativeReport(repr(element), rtol, errors, messages)
    assert isinstance(element, Element)
    points, widths = _features(element, c)
    reach = max([abs(p) for p in points] + [0.0]) or max(widths, default=1.0)
    at = np.asarray(u, dtype=float).ravel() if u is not None else _displacements(points, widths, reach)
    speed = np.asarray(v, dtype=float).ravel() if v is not None else reach * np.cos(1.0 + 2.7 * np.arange(len(at)))
    if len(speed) != len(at) or not len(at) or not (np.all(np.isfinite(at)) and np.all(np.isfinite(speed))):
        raise InputError(f"u and v must be finite and of equal length, not {len(at)} and {len(speed)} entries")
    length = min([*widths, float(np.max(np.abs(at))) or 1.0])
    kind = element.sampling(c)
    if isinstance(kind, CornerSampling):
        speeds = list(kind.velocities)
        speed, at = _away_from(speed, at, speeds, 4.0 * _STEP * max(map(abs, [*speeds, *speed])))
    if isinstance(kind, PiecewiseLinear | CornerSampling):
        margin = 4.0 * _STEP * max(length, reach)
        at, speed = _away_from(at, speed, points, margin)
    return _Check(element, c, at, speed, length, reach, points, rtol).report()


def _features(element: Element, c: Array) -> tuple[list[float], list[float]]:
    """Points where the law is not smooth, and the widths over which it changes there."""
    sampling = element.sampling(c)
    if isinstance(sampling, SharpSampling):
        return list(sampling.points), list(sampling.widths)
    if isinstance(sampling, CornerSampling):
        return list(sampling.points), []
    if isinstance(sampling, PiecewiseLinear):
        return [float(c[piece.gap]) for piece in sampling.pieces], []
    return [], []


def _displacements(points: list[float], widths: list[float], reach: float) -> Array:
    spread = [np.linspace(-2.1, 2.3, 23) * reach]
    for point, width in zip(points, widths, strict=False):
        near = width * np.geomspace(0.1, 30.0, 9)
        spread += [point - near, point + near]
    return np.concatenate(spread)


def _away_from(u: Array, v: Array, points: list[float], margin: float) -> tuple[Array, Array]:
    far = np.all([np.abs(u - point) > margin for point in points], axis=0) if points else np.full(len(u), True)
    if not np.any(far):
        raise InputError("every place given lies on a corner of the law; give some away from it")
    return u[far], v[far]


class _Check:
    def __init__(
        self,
        element: Element,
        c: Array,
        u: Array,
        v: Array,
        length: float,
        reach: float,
        points: list[float],
        rtol: float,
    ) -> None:
        self.element, self.c, self.u, self.v, self.rtol = element, c, u, v, rtol
        kind = element.sampling(c)
        fast = float(np.max(np.abs(v))) or 1.0
        if isinstance(kind, SharpVelocitySampling):
            fast = min([fast, *kind.widths])
        self.steps = {"u": _STEP * length, "v": _STEP * fast}
        self.coefficient_steps = []
        for value in c:
            own = abs(float(value)) or reach
            # a gap moves the whole law: its step follows the width of the law, not its own size
            is_point = any(value == point for point in points)
            self.coefficient_steps.append(_STEP * (min(length, own) if is_point else own))
        self.errors: dict[str, float] = {}
        self.messages: list[str] = []

    def report(self) -> DerivativeReport:
        e, c, u, v = self.element, self.c, self.u, self.v
        tangent = e.tangent(u, v, c)
        curvature = e.curvature(u, v, c)
        by_c = e.coefficient_tangent(u, v, c)
        f_cc = e.coefficient_curvature(u, v, c)
        third = e.third(u, v, c)
        moving = e.depends_on_velocity
        self._shapes(tangent, curvature, third, by_c, f_cc, moving)
        if not self.messages:
            self._states(tangent, curvature, third, moving)
            self._coefficients(by_c, f_cc, moving)
            self._pieces(tangent)
        return DerivativeReport(repr(e), self.rtol, self.errors, tuple(self.messages))

    def _shapes(self, tangent: Any, curvature: Any, third: Any, by_c: Any, f_cc: Any, moving: bool) -> None:
        n, nc = len(self.u), len(self.c)
        expected = [
            ("f", tangent[0], (n,), True),
            ("f_u", tangent[1], (n,), True),
            ("f_v", tangent[2], (n,), moving),
            ("f_uu", curvature[0], (n,), True),
            ("f_uv", curvature[1], (n,), moving),
            ("f_vv", curvature[2], (n,), moving),
            ("f_uuu", third[0], (n,), True),
            ("f_uuv", third[1], (n,), moving),
            ("f_uvv", third[2], (n,), moving),
            ("f_vvv", third[3], (n,), moving),
            ("f_c", by_c[0], (nc, n), True),
            ("f_uc", by_c[1], (nc, n), True),
            ("f_vc", by_c[2], (nc, n), moving),
            ("f_cc", f_cc, (nc, nc, n), True),
        ]
        for name, value, shape, there in expected:
            if (value is not None) != there:
                state = "missing" if there else "not None"
                self.messages.append(f"{name} is {state} although depends_on_velocity is {moving}")
            elif there and np.shape(value) != shape:
                self.messages.append(f"{name} has shape {np.shape(value)} instead of {shape}")
            elif there and not np.all(np.isfinite(value)):
                self.messages.append(f"{name} is not finite everywhere")

    def _states(self, tangent: Any, curvature: Any, third: Any, moving: bool) -> None:
        def law(order: int, name: str, laws: Any = None) -> Callable[[float], Array]:
            def shifted(step: float) -> Array:
                u = self.u + (step if name == "u" else 0.0)
                v = self.v + (step if name == "v" else 0.0)
                return np.asarray((laws or self.element.tangent)(u, v, self.c)[order])

            return shifted

        own = type(self.element).third is not Element.third  # else they are differences already
        bent = self.element.curvature
        if own:
            self._compare("f_uuu", third[0], law(0, "u", bent), self.steps["u"])
        if moving and own:
            for i, name in enumerate(("f_uuv", "f_uvv", "f_vvv")):
                self._compare(name, third[i + 1], law(i, "v", bent), self.steps["v"])

        self._compare("f_u", tangent[1], law(0, "u"), self.steps["u"])
        self._compare("f_uu", curvature[0], law(1, "u"), self.steps["u"])
        if moving:
            self._compare("f_v", tangent[2], law(0, "v"), self.steps["v"])
            self._compare("f_uv", curvature[1], law(1, "v"), self.steps["v"])
            self._compare("f_vv", curvature[2], law(2, "v"), self.steps["v"])
        else:
            self._compare("f_v", np.zeros_like(self.u), law(0, "v"), self.steps["v"], np.abs(tangent[0]).max())

    def _coefficients(self, by_c: Any, f_cc: Any, moving: bool) -> None:
        names = self.element.coefficient_names
        for i, name in enumerate(names):
            step = self.coefficient_steps[i]

            def shifted(step: float, i: int = i) -> Array:
                c = self.c.copy()
                c[i] += step
                return c

            def force(step: float, order: int = 0) -> Array:
                return np.asarray(self.element.tangent(self.u, self.v, shifted(step))[order])

            self._compare(f"f_c[{name}]", by_c[0][i], force, step)
            self._compare(f"f_uc[{name}]", by_c[1][i], lambda h: force(h, 1), step)
            if moving:
                self._compare(f"f_vc[{name}]", by_c[2][i], lambda h: force(h, 2), step)
            for j, other in enumerate(names):

                def slope(step: float, j: int = j) -> Array:
                    return np.asarray(self.element.coefficient_tangent(self.u, self.v, shifted(step))[0][j])

                self._compare(f"f_cc[{other}, {name}]", f_cc[j, i], slope, step)

    def _compare(self, name: str, exact: Array, law: Callable[[float], Array], step: float, scale: float = 0.0) -> None:
        difference = (8.0 * (law(step) - law(-step)) - (law(2.0 * step) - law(-2.0 * step))) / (12.0 * step)
        size = max(float(np.max(np.abs(exact))), scale / step if scale else 0.0)
        noise = 1e-9 * float(np.max(np.abs(law(0.0)))) / step  # what differences of a constant would show
        largest = max(size, float(np.max(np.abs(difference))))
        error = float(np.max(np.abs(difference - exact)))
        self.errors[name] = 0.0 if error <= noise * self.rtol else error / largest

    def _pieces(self, tangent: Any) -> None:
        sampling = self.element.sampling(self.c)
        size = float(np.max(np.abs(tangent[0]))) or 1.0
        if isinstance(sampling, PolynomialSampling) and sampling.coefficients is not None:
            told = np.polynomial.polynomial.polyval(self.u, sampling.coefficients)
            self.errors["polynomial told"] = float(np.max(np.abs(told - tangent[0]))) / size
        if isinstance(sampling, SharpSampling) and sampling.steps is not None:
            told = sampling.constant + sampling.slope * self.u
            for point, width, step in zip(sampling.points, sampling.widths, sampling.steps, strict=True):
                y = self.u - point
                told += step / np.pi * (y * np.arctan(y / width) - 0.5 * width * np.log1p((y / width) ** 2))
            self.errors["arctan steps told"] = float(np.max(np.abs(told - tangent[0]))) / size
        if not isinstance(sampling, PiecewiseLinear):
            return
        total = np.zeros_like(self.u)
        for piece in sampling.pieces:
            distance = self.u - self.c[piece.gap]
            total += self.c[piece.stiffness] * distance * (piece.side * distance > 0.0)
        self.errors["sum of pieces"] = float(np.max(np.abs(total - tangent[0]))) / size
