"""Whether two motions are one: the same, shifted in time, mirrored, or another; and whether a motion lies on a curve.

The load repeats after T = 2 pi / omega, so a motion of nu load periods comes with its shifts x(t + j T), j = 0 .. nu -
1: one motion, begun at another period of the load. Where the equations have a symmetry,

    x_i(t) -> s_i x_i(t + m T / 2),    s_i = +1 or -1,

as those of an oscillator with odd forces have with s = -1, m = 1, the image of a motion is a motion as well: another
one, with the same frequencies, harmonics by modulus, multipliers and bifurcations. No modulus tells the two apart, so
complex amplitudes are compared,

    c_k(x_i(t + m T / 2)) = c_k exp(i pi m k / nu),

in the norm in which DOFs count by the square roots of their masses, relative to the motion. That the equations have a
symmetry need not be asked where both motions are solutions: an image of one that is the other shows it.

Harmonics that one of two motions was not solved with cannot tell them apart and are left out; a motion of nu load
periods is written in a basis of any multiple of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.continuation.problem import Array
from suboctave.curves.trace import BranchPoint
from suboctave.harmonic.basis import ComplexArray, to_complex, to_real
from suboctave.harmonic.orbit import PeriodicOrbit

#: two motions are one if they differ by less, relative to their size: solved twice they differ by the harmonics
#: neglected and by Newton's tolerance, both smaller
TOLERANCE = 1e-4
#: a motion lies on a curve if it is off by no more than this, relative to its size, and the error of the interpolation
_ON_CURVE = 1e-3
#: amplitude, unit of length, up to which a motion is rest here: that of located branch points of rest is rounding
_NOTHING = 1e-12
#: cosine of two null vectors beyond which they are one
_PARALLEL = 0.99
#: distance of the multipliers of two Neimark-Sacker points of one motion beyond which they are two
_OTHER_PAIR = 1e-3
#: steps in which the nearest place between two points of a curve is found (Gauss-Newton, from the chord)
_PROJECTIONS = 4


class Relation(Enum):
    """What one motion is to another."""

    SAME = "same"
    SHIFTED = "shifted"
    MIRRORED = "mirrored"
    OTHER = "other"

    @property
    def one(self) -> bool:
        """Whether the two are one motion: the same, at the same instants or shifted by whole periods of the load."""
        return self in (Relation.SAME, Relation.SHIFTED)


def relation(one: PeriodicOrbit, other: PeriodicOrbit, tolerance: float = TOLERANCE) -> Relation:
    """What a motion is to another of the same system at the same frequency and parameters.

    Mirrored: an image under a change of signs of DOFs and a shift by half periods of the load (see the module).
    Permutations of identical masses are not among them: such images are others.
    """
    nu, a, b, size = _together(one, other)
    room = (tolerance * size) ** 2
    images = a * _turns(len(a), nu)
    plus, minus = (np.sum(np.abs(images - sign * b) ** 2, axis=1) for sign in (1.0, -1.0))
    off = plus.sum(axis=1)[::2]
    if off[0] <= room:
        return Relation.SAME
    if off.min() <= room:
        return Relation.SHIFTED
    return Relation.MIRRORED if np.minimum(plus, minus).sum(axis=1).min() <= room else Relation.OTHER


def apart(one: PeriodicOrbit, other: PeriodicOrbit) -> float:
    """Distance of two motions relative to the larger one, shifted against each other such that it is least."""
    nu, a, b, size = _together(one, other)
    off = np.linalg.norm((a * _turns(len(a), nu)[::2] - b).reshape(nu, -1), axis=1)
    return float(off.min()) / (size or 1.0)


def image_of(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """-x(t + T / 2), whether it solves the equations or not."""
    k = np.arange(orbit.basis.harmonics + 1)[:, None]
    c = -to_complex(orbit.x) * np.exp(1j * np.pi * k / orbit.basis.nu)
    return replace(orbit, x=to_real(c))


def mirrored(orbit: PeriodicOrbit) -> PeriodicOrbit | None:
    """-x(t + T / 2), if that is another motion of the system; None where it is none, or the motion itself."""
    image = image_of(orbit)
    if relation(orbit, image).one:
        return None
    state = image.state()
    # by the symmetry the residual is the motion's own; without it that of a motion that solves nothing
    solves = state.balanced.size <= TOLERANCE * state.balanced.scale
    return image if solves else None


# ----------------------------------------------------------------------------------------------------- motion and curve
def lies_on(orbit: PeriodicOrbit, points: Sequence[BranchPoint], name: str = "", images: bool = False) -> bool:
    """Whether a motion, or a shift of it, lies on the curve through others; arguments as of `gap_to`."""
    return gap_to(orbit, points, name, images) is not None


def gap_to(orbit: PeriodicOrbit, points: Sequence[BranchPoint], name: str = "", images: bool = False) -> float | None:
    """How far a motion lies off the curve through others in order, in units of what is allowed; None if farther.

    What is compared is the motion, its frequency, and with a name the parameter of that name. Between two points the
    curve is the cubic through them and their neighbours; what is allowed is a share of the motion's size and the
    difference of the two parabolas that the cubic is made of.

    Parameters
    ----------
    points
        Points of a branch over omega or, with a name, of a curve of bifurcations over omega and a parameter.
    images
        Whether -x(t + T / 2) on the curve will do as well: motions whose frequencies and bifurcations are the same.
    """
    orbits = [point.orbit for point in points]
    if not orbits:
        return None
    nu = math.lcm(orbit.basis.nu, *(o.basis.nu for o in orbits))
    top = min(o.basis.harmonics * nu // o.basis.nu for o in (orbit, *orbits))
    scales = orbit.balance.scales[0]
    c = _written(orbit, nu, top, scales)
    unit = float(np.linalg.norm(c)) or 1.0
    names = {name: float(np.ptp([o.values[name] for o in orbits])) or 1.0} if name else {}

    def vector(amplitudes: ComplexArray, of: PeriodicOrbit) -> Array:
        flat = amplitudes.ravel() / unit
        places = [of.omega / orbit.omega, *(of.values[n] / size for n, size in names.items())]
        return np.concatenate((flat.real, flat.imag, places))

    curve = np.array([vector(_written(o, nu, top, scales), o) for o in orbits])
    turns = _turns(top + 1, nu)
    shifted = [vector(turn * c, orbit) for turn in turns[::2]]
    reflected = [vector(-turn * c, orbit) for turn in turns[1::2]] if images else []
    return min((gap for target in (*shifted, *reflected) for gap in _gaps(target, curve)), default=None)


def _gaps(target: Array, curve: Array) -> Iterator[float]:
    """Distances between a place and a curve, in units of what is allowed, where the curve comes that close."""
    if len(curve) == 1:
        off = float(np.linalg.norm(curve[0] - target)) / _ON_CURVE
        yield from [off] if off <= 1.0 else []
        return
    steps = np.diff(curve, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    squares = np.where(lengths > 0.0, lengths**2, 1.0)
    shares = np.clip(np.einsum("ij,ij->i", target - curve[:-1], steps) / squares, 0.0, 1.0)
    chords = np.linalg.norm(curve[:-1] + shares[:, None] * steps - target, axis=1)
    places = np.concatenate(([0.0], np.cumsum(lengths)))
    # a curve leaves its chord by less than half of it, or its points say nothing of what is between them
    for i in np.flatnonzero(chords <= 0.5 * lengths + _ON_CURVE):
        off, error = _nearest(target, curve, places, int(i), float(shares[i]))
        gap = off / (_ON_CURVE + min(error, 0.5 * float(lengths[i])))
        if gap <= 1.0:
            yield gap


def _nearest(target: Array, curve: Array, places: Array, i: int, share: float) -> tuple[float, float]:
    """Distance to the interpolated curve between the points i and i + 1, and how far the interpolation may be off."""
    length = float(places[i + 1] - places[i])
    near = [j for j in range(max(i - 1, 0), min(i + 3, len(curve))) if j in (i, i + 1) or _distinct(places, i, j)]
    if not length:
        return float(np.linalg.norm(curve[i] - target)), 0.0
    s = (places[near] - places[i]) / length
    whole = _polynomial(s, curve[near])
    for _ in range(_PROJECTIONS):
        powers = share ** np.arange(len(s))
        slope = (np.arange(1, len(s)) * powers[:-1]) @ whole[1:]
        share = min(1.0, max(0.0, share + float(slope @ (target - powers @ whole)) / (float(slope @ slope) or 1.0)))
    off = float(np.linalg.norm(share ** np.arange(len(s)) @ whole - target))
    lower = [_polynomial(s[part], curve[near][part]) for part in (slice(0, -1), slice(1, None))]
    ends = [share ** np.arange(len(s) - 1) @ coefficients for coefficients in lower]
    return off, float(np.linalg.norm(ends[0] - ends[1])) if len(s) > 2 else 0.5 * length


def _distinct(places: Array, i: int, j: int) -> bool:
    """Whether a neighbour is far enough from the points i and i + 1 to say how the curve bends between them."""
    reach = 1e-3 * float(places[i + 1] - places[i])
    return min(abs(float(places[j] - places[k])) for k in (i, i + 1)) > reach


def _polynomial(s: Array, values: Array) -> Array:
    """Coefficients, lowest first, of the polynomial through values (m, D) at s."""
    return np.asarray(np.linalg.solve(np.vander(s, increasing=True), values))


# ---------------------------------------------------------------------------------------------------------- amplitudes
def _written(orbit: PeriodicOrbit, nu: int, top: int, scales: Array) -> ComplexArray:
    """Complex amplitudes at k omega / nu, k = 0 .. top, DOFs multiplied by the square roots of their masses."""
    stride = nu // orbit.basis.nu
    kept = top // stride + 1
    c = np.zeros((top + 1, orbit.x.shape[1]), dtype=complex)
    c[: stride * (kept - 1) + 1 : stride] = to_complex(orbit.x)[:kept]
    c *= scales
    return c


def _together(one: PeriodicOrbit, other: PeriodicOrbit) -> tuple[int, ComplexArray, ComplexArray, float]:
    """Two motions in one basis, with the harmonics that both were solved with: nu, amplitudes, size of the larger."""
    nu = math.lcm(one.basis.nu, other.basis.nu)
    top = min(o.basis.harmonics * nu // o.basis.nu for o in (one, other))
    # a structure's masses are those of its projection, which may be another one for each
    a, b = (_written(o, nu, top, one.balance.scales[0]) for o in (one, other))
    return nu, a, b, max(float(np.linalg.norm(a)), float(np.linalg.norm(b)))


def _turns(count: int, nu: int) -> ComplexArray:
    """Factors of the harmonics 0 .. count - 1 in shifts by m half periods of the load, m = 0 .. 2 nu - 1; shape
    (2 nu, count, 1).
    """
    return np.exp(1j * np.pi / nu * np.multiply.outer(np.arange(2 * nu), np.arange(count)))[:, :, None]


def same_event(a: Bifurcation, b: Bifurcation) -> bool:
    """Whether two located bifurcations are one, met twice."""
    if (a.kind, a.parameter_name) != (b.kind, b.parameter_name):
        return False
    if a.kind == "grazing" and len({item.contact and item.contact.element for item in (a, b)}) > 1:
        return False
    if a.kind == "NS" and abs(a.critical_multiplier() - b.critical_multiplier()) > _OTHER_PAIR:
        return False
    if a.multiplicity > 1 and a.multiplicity == b.multiplicity and not _along_one(a, b):
        return False
    same_place = all(np.isclose(a.parameter(name), b.parameter(name), rtol=1e-9) for name in a.free_names)
    if not (same_place and np.isclose(a.amplitude, b.amplitude, rtol=1e-6)):
        return False
    # the mirror image of a motion has its amplitude; at rest there is nothing to compare
    return max(a.amplitude, b.amplitude) <= _NOTHING or relation(a.orbit, b.orbit).one


def _along_one(a: Bifurcation, b: Bifurcation) -> bool:
    """Whether two bifurcations that fall together with others have one null vector."""
    count = min(len(item.null_vectors.right) for item in (a, b))
    return bool(abs(np.vdot(a.null_vectors.right[:count], b.null_vectors.right[:count])) > _PARALLEL)


def drop_seam(items: list[Bifurcation]) -> None:
    """What lies on the seam of a closed curve is met at both ends: keep the first."""
    # several contacts may graze at once
    while len(items) > 1 and any(same_event(items[-1], first) for first in items[: min(3, len(items) - 1)]):
        items.pop()
