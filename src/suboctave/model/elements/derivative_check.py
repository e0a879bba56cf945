"""Are the derivatives of an element those of its force? Finite differences answer, for whoever writes an element."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.arguments import Positive, checked
from suboctave.errors import InputError, check_numbers, shortened
from suboctave.model.elements.base import STEP, Array, BaseElement, Element, central_difference, shifted, step_of
from suboctave.model.elements.coupled import as_coupled
from suboctave.model.elements.smoothness import CornerSampling, PiecewiseLinear, WholeLaw, levels, widths_of

#: distance from a corner, in steps: differences reach two of them. Half powers that begin there are steep beside it
_BESIDE, _BESIDE_ROUGH = 4.0, 100.0


@dataclass(frozen=True)
class DerivativeReport:
    """Worst error of every derivative, relative to the largest value it takes; `ok` if none exceeds `rtol`.

    `errors` maps names such as "f_u" or "f_c[gap]" to errors; `messages` lists what is wrong beyond numbers (shapes,
    values that are not finite, a missing `f_v`).
    """

    element: str
    rtol: Positive
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


@checked
def check_derivatives(
    element: BaseElement,
    *,
    parameters: Mapping[str, float] | None = None,
    u: ArrayLike | None = None,
    v: ArrayLike | None = None,
    tolerance: Positive = 1e-6,
) -> DerivativeReport:
    """Compare every derivative that an element provides with central differences of fourth order.

    `u`, `v` (N,): where to look (default: around the gaps or sharp points, on both sides of each). Those closer to
    a corner of a piecewise-linear law than the step are left out. `parameters` gives the element's expressions their
    numbers. Errors are relative to the largest value that the derivative takes there; `tolerance` bounds them. Of a
    coupled element, u and v are (m, N), one row per input.
    """
    if not isinstance(element, BaseElement):
        raise InputError(f"the first argument must be an element such as CubicSpring(..), not {shortened(element)}")
    if parameters is not None and not isinstance(parameters, Mapping):
        raise InputError(f"parameters must be a mapping {{name: number}}, not {shortened(parameters)}")
    check_numbers(**{str(name): value for name, value in (parameters or {}).items()})
    c = element.coefficient_values(parameters or {})
    at = _places(element, c, u, v)
    messages = _wrong_shapes(element, at, c)
    errors = {} if messages else {**_derivative_errors(element, at, c), **_smoothness_errors(element, at, c)}
    return DerivativeReport(repr(element), tolerance, errors, tuple(messages))


@dataclass(frozen=True)
class _Places:
    """States q (Q, N) and phases (N,) at which derivatives are compared, steps of q and of the coefficients.

    Of an element with one input, q is displacement and velocity, whether it depends on that or not.
    """

    q: Array
    theta: Array
    steps: list[float]
    coefficient_steps: Array


def _places(element: BaseElement, c: Array, u: ArrayLike | None, v: ArrayLike | None) -> _Places:
    """Around the gaps or sharp points of the first input, on both sides of each; those beside a corner are left out."""
    kind, m = element.sampling(c), as_coupled(element).count
    points, velocities = levels(kind, c), getattr(kind, "velocities", ())
    widths, slow = widths_of(kind)
    moving = element.depends_on_velocity or isinstance(element, Element)
    reach = max(map(abs, points), default=0.0) or max(widths, default=1.0)
    fast = max(map(abs, velocities), default=0.0) or reach
    if u is None:
        near = [width * np.geomspace(0.1, 30.0, 9) for width in widths]
        beside = [side for point, d in zip(points, near, strict=False) for side in (point - d, point + d)]
        first = np.concatenate([np.linspace(-2.1, 2.3, 23) * reach, *beside])
        count = np.arange(1, len(first) + 1)
        rows = [first, *(2.1 * reach * np.sin((1.3 + 0.7 * i) * count + i) for i in range(1, m))]
    else:
        rows = list(np.atleast_2d(np.asarray(u, dtype=float)))
        count = np.arange(1, len(rows[0]) + 1)
    if moving:
        own = [1.7 * fast * np.cos((1.7 + 0.6 * i) * count) for i in range(m)]
        rows += own if v is None else list(np.atleast_2d(np.asarray(v, dtype=float)))
    lengths = {len(row) for row in rows}
    if (
        len(rows) != m * (1 + moving)
        or len(lengths) > 1
        or not len(count)
        or not np.all(np.isfinite(np.concatenate(rows)))
    ):
        raise InputError(f"u and v must be finite, with one row of equal length per input, not of {sorted(lengths)}")
    q: Array = np.array(rows)
    if isinstance(kind, PiecewiseLinear | CornerSampling):
        margin = STEP * (_BESIDE_ROUGH if isinstance(kind, CornerSampling) and kind.rough else _BESIDE)
        for row, size, corners in ((0, reach, points), (m, fast, velocities)):
            for corner in corners:
                size = max(size, float(np.max(np.abs(q[row]), initial=0.0)))
                q = q[:, np.abs(q[row] - corner) > margin * size]
        if not q.size:
            raise InputError("every place given lies on a corner of the law; give some away from it")
    steps = [step_of(row, {0: widths, m: slow}.get(i, ())) for i, row in enumerate(q)]
    by_c = STEP * np.array([abs(float(value)) or reach for value in c])
    # a gap moves the whole law: its step follows the width of the law, not its own size
    by_c = np.where(np.isin(c, points), np.minimum(by_c, steps[0]), by_c)
    return _Places(q, 0.37 + 0.9 * np.arange(q.shape[1], dtype=float), steps, by_c)


#: laws of an element with one input, and of a coupled one: method and what it gives
_ONE_INPUT = {
    "tangent": "f f_u f_v",
    "curvature": "f_uu f_uv f_vv",
    "third": "f_uuu f_uuv f_uvv f_vvv",
    "coefficient_tangent": "f_c f_uc f_vc",
    "coefficient_curvature": "f_cc",
}
_COUPLED = dict(zip(_ONE_INPUT, ("f f_q", "f_qq", "f_qqq", "f_c f_qc", "f_cc"), strict=True))


def _wrong_shapes(element: BaseElement, at: _Places, c: Array) -> list[str]:
    """What is wrong with derivatives beyond numbers."""
    one_input = isinstance(element, Element)
    state = at.q if one_input else (at.q, at.theta)
    messages = []
    for method, names in (_ONE_INPUT if one_input else _COUPLED).items():
        values = getattr(element, method)(*state, c)
        for name, value in zip(names.split(), values if " " in names else [values], strict=True):
            shape = (len(c),) * name.count("c") + (len(at.q),) * name.count("q") + at.theta.shape
            there = element.depends_on_velocity or "v" not in name
            if (value is not None) != there:
                wrong = "missing" if there else "not None"
                messages.append(f"{name} is {wrong} although depends_on_velocity is {element.depends_on_velocity}")
            elif there and np.shape(value) != shape:
                messages.append(f"{name} has shape {np.shape(value)} instead of {shape}")
            elif there and not np.all(np.isfinite(value)):
                messages.append(f"{name} is not finite everywhere")
    return messages


def _derivative_errors(element: BaseElement, at: _Places, c: Array) -> dict[str, float]:
    """Errors of all derivatives of the law `f(q, theta; c)` by states and coefficients."""
    law, theta, errors = as_coupled(element), at.theta, dict[str, float]()
    names = ["u", "v"] if isinstance(element, Element) else [f"{kind}{i}" for kind in "uv" for i in range(law.count)]
    names = names if element.depends_on_velocity else names[: law.count]
    q = at.q[: len(names)]

    def compare(name: str, exact: Array, tensor: Any, pick: tuple[int, ...], step: float) -> None:
        def part(h: float) -> Array:
            return np.asarray(tensor(h)[pick])

        difference = central_difference(part, step)
        noise = 1e-15 * float(np.max(np.abs(part(0.0)), initial=0.0)) / step  # what rounding of a constant would show
        largest = max(float(np.max(np.abs(some), initial=0.0)) for some in (exact, difference))
        error = float(np.max(np.abs(difference - exact), initial=0.0))
        errors[name] = max(errors.get(name, 0.0), 0.0 if error <= noise else error / largest)

    tensors: list[Callable[[Array, Array], Array]] = [
        lambda q, c: law.tangent(q, theta, c)[0],
        lambda q, c: law.tangent(q, theta, c)[1],
        lambda q, c: law.curvature(q, theta, c),
        lambda q, c: law.third(q, theta, c),
        lambda q, c: law.coefficient_tangent(q, theta, c)[0],
    ]
    differences_already = isinstance(element, Element) and type(element).third is Element.third
    for order in range(2 if differences_already else 3):
        exact = tensors[order + 1](q, c)
        for index in itertools.product(range(len(names)), repeat=order + 1):
            *lower, i = index
            name = "f_" + "".join(names[j] for j in sorted(index))
            compare(
                name, exact[index], lambda h, i=i, f=tensors[order]: f(shifted(q, i, h), c), tuple(lower), at.steps[i]
            )
    if isinstance(element, Element) and not element.depends_on_velocity:
        u, v = at.q
        unmoved = central_difference(lambda h: element.tangent(u, v + h, c)[0], at.steps[1]) * at.steps[1]
        errors["f_v"] = float(np.max(np.abs(unmoved))) / (float(np.max(np.abs(element.tangent(u, v, c)[0]))) or 1.0)
    f_c, f_qc = law.coefficient_tangent(q, theta, c)
    f_cc = law.coefficient_curvature(q, theta, c)
    for k, (name, step) in enumerate(zip(element.coefficient_names, at.coefficient_steps, strict=True)):
        by_c = [lambda h, k=k, tensor=tensor: tensor(q, shifted(c, k, h)) for tensor in tensors]
        compare(f"f_c[{name}]", f_c[k], by_c[0], (), step)
        for i, state in enumerate(names):
            compare(f"f_{state}c[{name}]", f_qc[k, i], by_c[1], (i,), step)
        for j, other in enumerate(element.coefficient_names):
            compare(f"f_cc[{other}, {name}]", f_cc[j, k], by_c[-1], (j,), step)
    if element.depends_on_time:
        f, again = (law.tangent(q, phase, c)[0] for phase in (theta, theta + 2.0 * np.pi))
        errors["period"] = float(np.max(np.abs(again - f))) / (float(np.max(np.abs(f))) or 1.0)
    return errors


def _smoothness_errors(element: BaseElement, at: _Places, c: Array) -> dict[str, float]:
    """Errors of the force that the smoothness class declares, where that is the whole law."""
    kind = element.sampling(c)
    if not (isinstance(element, Element) and isinstance(kind, WholeLaw) and kind.whole):
        return {}
    name = {"PolynomialSampling": "polynomial", "SharpSampling": "arctan steps"}.get(type(kind).__name__, "pieces")
    declared, f = kind.tangent(at.q[0], c)[0], element.tangent(at.q[0], at.q[1], c)[0]
    return {name: float(np.max(np.abs(declared - f))) / (float(np.max(np.abs(f))) or 1.0)}
