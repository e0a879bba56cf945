"""What every verb has in common: what it refuses before any work, with what to do instead; a time limit, the seconds
that it took, and units that floating point cannot bear.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Any, ParamSpec, Protocol, TypeVar

import numpy as np

from suboctave.errors import ConvergenceError, InputError, chosen_dof, is_number, shortened, suggest
from suboctave.interruption import keeping, time_limit
from suboctave.model.elements.base import Array, numbers_of
from suboctave.model.system import System

#: the largest count of anything
_MOST = 100_000_000
#: DOFs of a free motion that a message names
_MOST_SHOWN = 4
#: DOFs up to which the stiffness is examined for motions that nothing holds
_MOST_EXAMINED = 400
#: condition of a stiffness that holds all motions beyond doubt
_HELD = 1e9


def check_is_system(system: Any) -> None:
    """Refuse what is no system."""
    if not isinstance(system, System):
        raise InputError(f"the first argument must be a System, not {type(system).__name__}")


def check_system(system: System, omega: tuple[float, ...] = ()) -> None:
    """Refuse what cannot vibrate periodically: no load (at the frequencies `omega`), or a body that nothing holds."""
    check_is_system(system)
    periodic = [c for c in system.load_components() if c.harmonic > 0]
    if not periodic and not system.excited_by_elements:
        raise InputError(
            "the system has no periodic load: add loads=[HarmonicLoad(dof=..., amplitude=...)], or an element that "
            "depends on time"
        )
    amplitudes = [c.amplitude.value({**system.parameters, "omega": w}) for c in periodic for w in omega]
    if omega and not any(amplitudes) and not system.excited_by_elements:
        names = sorted({name for c in periodic for name in c.amplitude.names} - {"omega"})
        values = ", ".join(f"{name}={system.parameters[name]:g}" for name in names)
        raise InputError(f"the periodic load is zero at these parameters ({values or 'a number'}): nothing moves")
    if system.n <= _MOST_EXAMINED:
        _check_held(system)


def _check_held(system: System) -> None:
    """Refuse a body that nothing holds: the mean of its motion is not determined."""
    mass, _, stiffness = system.matrices()
    scale = 1.0 / np.sqrt(np.diag(mass))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = stiffness * scale[:, None] * scale
    if not np.isfinite(scaled).all():
        raise InputError("the stiffness over the mass is larger than any number: check the units of both")
    if np.linalg.cond(scaled, 1) < _HELD:
        return
    _, sizes, vectors = np.linalg.svd(scaled)
    free = vectors[sizes <= 1e-13 * max(sizes[0], np.finfo(float).tiny)]
    if not len(free):
        return
    held = np.vstack([np.zeros((0, system.n)), *(e.inputs(system.n) * scale for e in system.elements)])
    _, resisted, ways = np.linalg.svd(held @ free.T)
    rank = int(np.count_nonzero(resisted > 1e-10 * max(1e-300, float(np.abs(held).max(initial=0.0)))))
    if rank < len(free):
        raise InputError(
            f"the structure can move freely: {_shape(ways[-1] @ free * scale, system.dof_names)}"
            f"{f' (one of {len(free) - rank} such motions)' if len(free) - rank > 1 else ''}. Its stiffness is "
            "singular and no element holds it, so that the mean position is not determined. Hold it by a spring, or "
            "write it in relative displacements"
        )


def _shape(shape: Array, names: Sequence[str]) -> str:
    """A shape by the degrees of freedom that move most in it."""
    order = np.argsort(-np.round(np.abs(shape) / np.abs(shape).max(), 6), kind="stable")
    shape = shape / shape[order[0]]
    moving = [f"{names[i] if names else f'DOF {i}'} by {shape[i]:.3g}" for i in order if abs(shape[i]) > 1e-6]
    return ", ".join(moving[:_MOST_SHOWN]) + ", ..." * (len(moving) > _MOST_SHOWN)


def check_parameter(system: System, name: str) -> None:
    """Refuse a name that is neither "omega" nor a parameter."""
    if not isinstance(name, str) or (name != "omega" and name not in system.parameters):
        raise InputError(f"unknown parameter {name!r}{suggest(str(name), ['omega', *system.parameters])}")


def check_count(name: str, value: Any, least: int = 1) -> int:
    """A whole number of at least so much."""
    exact = isinstance(value, int | np.integer) or (is_number(value) and float(value).is_integer())
    if isinstance(value, bool) or not exact or value < least:
        enough = f" of at least {least}" if least > 1 else ""
        raise InputError(f"{name} must be a {'positive ' * (least == 1)}whole number{enough}, not {shortened(value)}")
    if value > _MOST:
        raise InputError(f"{name}={shortened(int(value))} is more than {_MOST}, the largest count that is taken")
    return int(value)


def observed_dof(system: System, observe: Any, name: str = "observe") -> int:
    """The degree of freedom that is observed, by its number or its name; by default the system's."""
    return chosen_dof(observe, system.observed_dof, system.n, name, system.dof_names)


def check_element(system: System, element: Any, gapped: Sequence[int] | None = None) -> int:
    """The index of an element of a system; None stands for the only one (of those with a gap, if these are given)."""
    known = range(len(system.elements)) if gapped is None else gapped
    listed = "; ".join(f"{index}: {system.elements[index].label}" for index in known[:8])
    what = "elements" if gapped is None else "elements with a gap"
    if element is None and len(known) == 1:
        return known[0]
    if element is None:
        several = f"several {what}: choose one by its index ({listed})"
        raise InputError(several if known else f"the system has no {what}")
    if isinstance(element, bool) or not isinstance(element, int | np.integer):
        raise InputError(f"element must be an index, not {element!r} ({listed})")
    if not 0 <= element < len(system.elements):
        raise InputError(f"element={element} is out of range: {listed or 'the system has no elements'}")
    if int(element) not in known:
        raise InputError(f"{system.elements[element].label} has no gap; {what}: {listed or 'none'}")
    return int(element)


def check_omega(omega: Any) -> float:
    """One circular frequency of the load."""
    if not (is_number(omega) and omega > 0.0):
        raise InputError(f"omega must be a positive number, not {shortened(omega)}")
    return float(omega)


def check_bounds(system: System, name: str, bounds: Any) -> tuple[float, float]:
    """Two ends at each of which the system exists (a mass that vanishes or turns negative does not)."""
    first, last = check_range(name, bounds, positive=name == "omega")
    for end in (first, last) if name != "omega" else ():
        try:
            system.with_parameters({name: end})
        except InputError as failure:
            raise InputError(f"{name}=({first:g}, {last:g}): at {name}={end:g} {failure}") from None
    return first, last


def start_state(system: System, state: Any) -> Array:
    """A state (2n,): rest for None, that of a periodic motion at t = 0, or what is given."""
    check_is_system(system)
    if state is None:
        return np.zeros(2 * system.n)
    held = (getattr(state, name, None) for name in ("start", "state") if not isinstance(state, np.ndarray))
    given = next((one for one in held if one is not None), state)
    array = numbers_of(given() if callable(given) else given)
    if array.shape != (2 * system.n,) or not np.isfinite(array).all():
        raise InputError(
            f"start must be {2 * system.n} finite numbers, displacements and then velocities, or a motion, not "
            f"{shortened(state)}"
        )
    return array


def check_range(name: str, bounds: Any, positive: bool = False) -> tuple[float, float]:
    """(from, to) as two different finite numbers, positive where they must be."""
    try:
        first, last = (float(b) for b in bounds)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}={shortened(bounds)}: give two numbers, (from, to)") from None
    if not (math.isfinite(first) and math.isfinite(last)) or first == last:
        raise InputError(f"{name}=({first:g}, {last:g}): the range must have two different finite ends")
    if positive and min(first, last) <= 0.0:
        raise InputError(f"{name}=({first:g}, {last:g}): frequencies are positive, in rad per unit time")
    return first, last


#: modulus of a number whose fourth power is no float; the inverse of one
_EXTREME = 1e77

Arguments = ParamSpec("Arguments")
Curve = TypeVar("Curve", bound="Timed")


class Timed(Protocol):
    """Something that knows how long it took."""

    seconds: float


def timed(verb: Callable[Arguments, Curve]) -> Callable[Arguments, Curve]:
    """A verb with a time limit, `seconds`, whose result says in `seconds` how long it took, and whose failures are put
    in words.
    """

    @functools.wraps(verb)
    def measured(*positional: Arguments.args, **named: Arguments.kwargs) -> Curve:
        begin = perf_counter()
        try:
            with time_limit(named.get("seconds")):
                result = keeping(functools.partial(verb, *positional, **named))
        except (ZeroDivisionError, OverflowError, ConvergenceError) as failure:
            extreme = extreme_number(*positional, *named.values())
            if extreme is None or hasattr(failure, "__notes__"):  # a mistake of ours, or of a user's function
                raise
            raise ConvergenceError(
                f"the numbers left the range of floating point ({failure}), with {extreme} among them: choose units in "
                "which sizes are nearer to 1"
            ) from failure
        result.seconds = perf_counter() - begin
        return result

    return measured


def extreme_number(*given: Any) -> str | None:
    """The first number among a verb's arguments, those of its system included, whose powers leave the range of floats;
    with its name.
    """
    for item in given:
        for name, value in _numbers(item):
            if value and not 1.0 / _EXTREME <= abs(value) <= _EXTREME:
                return f"{name} = {value:g}"
    return None


def _numbers(item: Any) -> Iterator[tuple[str, float]]:
    system = getattr(getattr(item, "orbit", item), "system", item)
    if isinstance(system, System):
        yield from system.parameters.items()
        for matrix in system.linear_parts:
            value = matrix.compact(system.parameters)
            entries = value.data if matrix.sparse else value.ravel()
            yield from ((matrix.what, float(entry)) for entry in entries)
        for where, source, _ in system.expressions():
            yield where, source.value({**system.parameters, "omega": 1.0})
    elif isinstance(item, int | float | np.floating):
        yield "an argument", float(item)
    elif isinstance(item, tuple | list | np.ndarray):
        for part in item:
            yield from _numbers(part)
