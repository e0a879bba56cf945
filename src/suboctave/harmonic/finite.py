"""Whether a motion, or the way from one to another, crosses a place where a force or coefficient is not finite."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from suboctave.errors import InputError
from suboctave.harmonic.aft.general import GeneralLaw, force_of, not_finite
from suboctave.harmonic.aft.law import Member
from suboctave.harmonic.aft.poles import POINTS, unbounded
from suboctave.harmonic.basis import Array
from suboctave.harmonic.evaluation import BalanceState
from suboctave.model.elements.smoothness import AdaptiveSampling, CornerSampling
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.system import System


def unbounded_along(state: BalanceState) -> str | None:
    """Where a motion crosses a place at which a force is not finite, in words; None if it does not."""
    for law, member in _laws(state):
        place = law.unbounded_at(member)
        if place is not None:
            return not_finite(member, place)
    return None


def unbounded_between(one: BalanceState, other: BalanceState) -> str | None:
    """Where a force is not finite on the way from one motion of a system to another, in words; None if it is finite.

    Motions that lie on different sides of such a place, each of them all the time, do so at any instant.
    """
    ends = {member.number: law for law, member in _laws(other)}
    for law, member in _laws(one):
        last = ends.get(member.number)
        if last is None:
            continue
        (first, theta), (second, _) = (at.state_at(np.ones(1), np.zeros(1)) for at in (law, last))
        way = second - first

        def force(
            share: Array, member: Member = member, first: Array = first, way: Array = way, theta: Array = theta
        ) -> Array:
            return force_of(member, first + way * share, np.repeat(theta, len(share)))

        share = unbounded(force, np.linspace(0.0, 1.0, POINTS)) if way.any() else None
        if share is not None:
            return not_finite(member, float(first[0, 0] + share * way[0, 0]))
    return None


def _laws(state: BalanceState) -> Iterator[tuple[GeneralLaw, Member]]:
    """Every law along a motion of which it is not known that it is finite."""
    for channel in state.channels:
        for law, member in channel.members():
            if isinstance(law, GeneralLaw) and isinstance(member.kind, AdaptiveSampling | CornerSampling):
                yield law, member


@lru_cache(maxsize=32)
def quotients(system: System, names: tuple[str, ...]) -> list[tuple[str, Coefficient]]:
    """The coefficients of a system that depend on some parameters and may be infinite, with where they stand."""
    return [(where, c) for where, c, _ in system.expressions() if c.names.intersection(names) and c.may_be_infinite]


def infinite_between(
    system: System, names: tuple[str, ...], first: Mapping[str, float], last: Mapping[str, float]
) -> str | None:
    """Which coefficient is not finite between two values of some parameters, in words; None if all are finite."""
    for where, source in quotients(system, names):

        def values(shares: Array, source: Coefficient = source) -> Array:
            return np.array([_value(source, first, last, names, share) for share in shares.tolist()])

        share = unbounded(values, np.linspace(0.0, 1.0, POINTS))
        if share is not None:
            at = ", ".join(f"{n} = {first[n] + share * (last[n] - first[n]):.6g}" for n in names if n in source.names)
            return f"{where}, {source}, is not finite (at {at})"
    return None


def _value(
    source: Coefficient, first: Mapping[str, float], last: Mapping[str, float], names: tuple[str, ...], share: float
) -> float:
    at = {**first, **{name: first[name] + share * (last[name] - first[name]) for name in names}}
    try:
        return source.value(at)
    except InputError:
        return math.nan
