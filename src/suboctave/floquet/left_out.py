"""How far what is left out of a structure moves the multipliers of a motion.

A level (`levels`) leaves out `D = H - H_e - R`, H of all fast blocks, H_e of what stands in for them, R a spring. That
moves the exponent s of a slow motion. It makes forces at `s + i n omega` by the Fourier coefficients k_n of the
stiffness and c_n of the damping, so that to first order s moves by

    sum_n l (k_-n D(s_n) + c_-n D'(s_n)) (k_n r + c_n r'),    s_n = s + i n omega,

l and r what drives the motion and what channels read of it, r' and D' of rates. Between one and the same channel phases
of coefficients cancel, and signs of D count; between two its size does. D is tabulated, averaged over some of the
frequency; at resonance two motions repel each other, and move by no more than what couples them.

Behind the last coefficient that is known those of a stiffness that jumps follow, J / n. A jump meets itself in the
integral of `D J^2 / Omega^2`, which vanishes over all frequencies where D does so at rest with its first derivative:
the part beyond takes back that below. It meets one that comes a time t later in the free vibrations between,

    2 pi omega J^2 sum_k c_k exp(s_k t) / s_k^2,    D(s) = sum_k c_k / (s - s_k),

where soon after a jump those that stand in nearly cancel those that they stand in for; what earlier periods leave comes
in any phase. Of many pairs of jumps squares add.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from suboctave.compiled import kernel
from suboctave.floquet.blocks import Blocks, States, of_blocks
from suboctave.harmonic.basis import Array, ComplexArray

#: sums may be reordered; infinities keep their meaning
_FAST = {"reassoc", "contract", "nsz"}
_TINY = float(np.finfo(float).tiny)
#: multipliers up to this count as zero: that of a block may be wrong
_GONE = 1e-6
#: error of one that is nothing
_NOTHING = 1e-14
#: Fourier coefficients of stiffness and damping, relative to the largest, that couple nothing
_SILENT = 1e-8
#: how many frequencies of a table there are up to the slowest block left out, how many times this they reach, and the
#: ratio of those beyond, up to so many times the fastest
_PARTS, _REACH, _RATIO, _ABOVE = 8, 6, 1.25, 4.0
#: how much farther than those at the circle multipliers may be moved that decay to nothing in a period
_FREER = 30.0
#: over which share of a frequency D is averaged
_AVERAGED = 0.1
#: how far eigenvalues of a block are moved apart, relative to their sizes, where they are the same
_SPLIT = 1e-7


class Poles(NamedTuple):
    """Blocks, see `blocks.Blocks`: (B, 2, 2), (B + 1,), (S, G), (2, G, S), (S,)."""

    motion: Array
    first: np.ndarray
    driven: Array
    read: Array
    exponents: ComplexArray


def poles(blocks: Blocks) -> Poles:
    """Of the blocks what is wanted here."""
    return Poles(blocks.motion, blocks.first, blocks.driven, blocks.read, blocks.exponents)


class LeftOut(NamedTuple):
    """What a level leaves out.

    slow
        How many blocks it does not leave out.
    turns, decays
        Largest imaginary and real parts of the eigenvalues of those that it does, and of those that stand in for them,
        (B,).
    couples
        How far forces drive each of these, and how much channels read of it and of its rate, (B, 3, G).
    unit
        Distance of the frequencies Omega at which D is tabulated, from 0 on.
    own, sizes, rates
        The diagonal of D there, (nodes, G), |D| without it, and |D'|, (nodes, G, G).
    tails
        Integrals from there on of `Re D d Omega / Omega^2`, `2 Im D d Omega / Omega^3`, and with |D'| as the first, (3,
        nodes, G, G).
    average
        The largest entry of |D|, its mean from there on by `d Omega / Omega^2`, (nodes,).
    exponents, leaving
        Those of free vibrations, of two that are conjugate one, (K,), and the residues of D and of the same of rates
        there, by squares of the exponents, (2, G, G, K); of conjugate ones the sum is the real part.
    """

    slow: int
    turns: Array
    decays: Array
    couples: Array
    unit: float
    own: ComplexArray
    sizes: Array
    rates: Array
    tails: Array
    average: Array
    exponents: ComplexArray
    leaving: ComplexArray


def left_out(blocks: Blocks, slow: int, few: States, exponents: ComplexArray, flexible: Array) -> LeftOut:
    """What is left out of those blocks that take part where only the first `slow` are followed, a few others with these
    exponents stand in, and a spring has no states.
    """
    at, states = slice(slow, blocks.coupled), slice(blocks.first[slow], blocks.first[blocks.coupled])
    ends = np.concatenate((blocks.first[slow : blocks.coupled] - states.start, few.first + states.stop - states.start))
    values = np.concatenate((blocks.exponents[states], exponents))
    driven, read = (np.concatenate(pair) for pair in (
        (blocks.driven[states], few.driven), (blocks.read[:, :, states].T, few.read.T)
    ))  # fmt: skip
    turns, decays = (of_blocks(np.maximum, part, ends) for part in (np.abs(values.imag), values.real))
    # of two conjugate states each has half
    drives = np.sqrt(of_blocks(np.add, driven**2, ends)) / np.diff(ends)[:, None]
    reads = np.sqrt(of_blocks(np.add, read**2, ends)).transpose(0, 2, 1)
    couples = np.ascontiguousarray(np.concatenate((drives[:, None], reads), axis=1))

    unit, nodes = float(blocks.rates[slow]) / _PARTS, _PARTS * _REACH + 1
    steps = max(0, math.ceil(math.log(_ABOVE * blocks.rates[at].max() / (unit * (nodes - 1))) / math.log(_RATIO)))
    w = unit * np.concatenate((np.arange(nodes), (nodes - 1) * _RATIO ** np.arange(1, steps + 1)))
    coupling = np.concatenate((blocks.coupling[at], -few.coupling))
    motion = np.concatenate((blocks.motion[at], few.motion))
    missing = _responses(motion, ends, coupling, values, np.asarray((_AVERAGED + 1j) * w, dtype=complex)).reshape(
        len(w), 2, *flexible.shape
    )
    missing[:, 0] -= flexible
    own, sizes, rates = np.einsum("wgg->wg", missing[:, 0]), np.abs(missing[:, 0]), np.abs(missing[:, 1])
    # from each frequency to the next, and from the last one on
    upto = np.append(w[:-1] / w[1:], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_square, by_cube = ((1.0 - upto**power) / w**power for power in (1, 2))
    by_square[0] = by_cube[0] = 0.0
    parts = np.stack((by_square * missing[:, 0].real.T, by_cube * missing[:, 0].imag.T, by_square * rates.T))
    tails = parts[..., ::-1].cumsum(axis=-1)[..., ::-1].transpose(0, 3, 2, 1)
    average = w * (by_square * sizes.max(axis=(1, 2)))[::-1].cumsum()[::-1]
    np.einsum("wgg->wg", sizes)[:] = 0.0
    return LeftOut(
        slow, turns, decays, couples, unit, np.ascontiguousarray(own[:nodes]), sizes[:nodes], rates[:nodes],
        np.ascontiguousarray(tails[:, :nodes]), average[:nodes], *_leaving(ends, values, coupling, flexible.shape),
    )  # fmt: skip


def _leaving(
    ends: np.ndarray, values: ComplexArray, coupling: Array, shape: tuple[int, ...]
) -> tuple[ComplexArray, ComplexArray]:
    """`LeftOut.exponents` and `leaving` of blocks."""
    one, other = values[ends[:-1]], values[ends[1:] - 1]
    other = np.where(np.abs(one - other) > _SPLIT * np.abs(one), other, one * (1.0 - _SPLIT))
    own, turned = coupling.transpose(1, 2, 0)
    leaving = np.concatenate(
        (
            (turned - other * own) / ((one - other) * one**2),
            (one * own - turned) / ((one - other) * other**2),
        ),
        axis=1,
    )
    exponents = np.concatenate((one, other))
    leaving[:, exponents.imag > 0.0] *= 2.0
    kept = exponents.imag >= 0.0
    return exponents[kept], leaving[:, kept].reshape(2, *shape, -1)


def _responses(
    motion: Array, ends: np.ndarray, coupling: Array, exponents: ComplexArray, s: ComplexArray
) -> ComplexArray:
    """G (s - L)^-1 B of all blocks together, (W, 2 G G): `((s - tr L) G B + G L B) / det(s - L)` of two states."""
    double = np.diff(ends) == 2
    near = s[:, None] - exponents[ends[:-1]]
    far = np.where(double, s[:, None] - exponents[ends[1:] - 1], 1.0)
    trace = np.where(double, s[:, None] - motion[:, 0, 0] - motion[:, 1, 1], 1.0)
    own, turned = coupling.transpose(1, 0, 2)
    result: ComplexArray = (trace / (near * far)) @ own + (double / (near * far)) @ turned
    return result


class Jumps(NamedTuple):
    """Jumps of stiffness and damping along a motion that are known.

    at, channel
        Their phases, in the order of time, and which of the channels that act, (E,).
    """

    at: Array
    channel: np.ndarray


class Motions(NamedTuple):
    """The slow motions of a structure's blocks, one of each, B of them, and what stiffness and damping make of them;
    see `motions`.

    exponents, left
        Their exponents, and what of them a period leaves, (B,); of those that it leaves nothing of no more is known.
    force, back
        Sizes of the forces that a motion makes by the coefficients 0, 1, ..., (B, N, G), and of what drives it of
        displacements and rates by these, (B, N, 2, G).
    jumping, struck
        `force` and `back` of a coefficient 1 if they go on as those of a jump do, (B, 1, G), (B, 1, 2, G).
    damped, jumps
        Whether there is any damping, and any jump.
    """

    exponents: ComplexArray
    left: Array
    force: Array
    back: Array
    jumping: Array
    struck: Array
    damped: bool
    jumps: bool


@kernel(inner=True)
def _jumps(tangents, active):
    """n times the Fourier coefficients of stiffness and damping behind the last one that is known, if they go on as
    those of a jump do, (2, G), and the last coefficient that counts; nothing jumps where that comes before the others.
    """
    top = tangents.shape[2] - 1
    jumps, last = np.zeros((2, active.shape[0])), 0
    for part in range(2):
        for g in range(active.shape[0]):
            largest = squares = 0.0
            for n in range(top + 1):
                largest = max(largest, abs(tangents[part, active[g], n]))
            for n in range(top + 1):
                size = abs(tangents[part, active[g], n])
                if size > _SILENT * largest:
                    last = max(last, n)
                if 2 * n > top:
                    squares += (n * size) ** 2 / (top - top // 2)
            jumps[part, g] = math.sqrt(squares)
    if 2 * last <= top:
        jumps[:] = 0.0
    return jumps, last


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _motion(blocks, i, rate, drives, reads):
    """What drives a motion of block i, into drives (G,), and what channels read of it and of its rate, into reads (2,
    G); returns its exponent.
    """
    a, e = blocks.first[i], blocks.first[i + 1]
    value, m = blocks.exponents[a], blocks.motion[i]
    v0, v1, w0, w1 = 1.0 + 0.0j, 0.0j, 1.0 + 0.0j, 0.0j
    if e - a == 2:
        other = blocks.exponents[a + 1]
        apart = value - other
        # two that are the same go apart by what moves them, but not within a period
        if abs(apart) < rate / math.pi:
            apart = complex(0.0, rate / math.pi)
        p00, p01, p10, p11 = m[0, 0] - other, m[0, 1] + 0.0j, m[1, 0] + 0.0j, m[1, 1] - other
        if abs(p01) > abs(p10):
            v0, v1, w0, w1 = p01, p11, p00 / p01, 1.0 + 0.0j
        elif abs(p10) > 0.0:
            v0, v1, w0, w1 = p00, p10, 1.0 + 0.0j, p11 / p10
        elif abs(p00) > abs(p11):
            v0, v1, w0, w1 = p00, 0.0j, 1.0 + 0.0j, 0.0j
        else:
            v0, v1, w0, w1 = 0.0j, p11, 0.0j, 1.0 + 0.0j
        v0, v1 = v0 / apart, v1 / apart
    for g in range(drives.shape[0]):
        drives[g] = w0 * blocks.driven[a, g]
        for part in range(2):
            reads[part, g] = v0 * blocks.read[part, g, a]
        if e - a == 2:
            drives[g] += w1 * blocks.driven[a + 1, g]
            for part in range(2):
                reads[part, g] += v1 * blocks.read[part, g, a + 1]
    return value


@kernel()
def motions(tangents, active, rate, blocks, count):
    """What stiffness and damping along a motion make of the slow motions of the first `count` blocks; see `Motions`.

    tangents (2, C, top + 1): Fourier coefficients of stiffness and damping; active (G,): the channels that act; rate:
    omega; blocks: see `Poles`.
    """
    groups, damped = active.shape[0], False
    jumps, known = _jumps(tangents, active)
    exponents, left = np.empty(count, dtype=np.complex128), np.empty(count)
    force, back = np.empty((count, known + 1, groups)), np.empty((count, known + 1, 2, groups))
    jumping, struck = np.empty((count, 1, groups)), np.empty((count, 1, 2, groups))
    drives, reads = np.empty(groups, dtype=np.complex128), np.empty((2, groups), dtype=np.complex128)
    for i in range(count):
        exponents[i] = _motion(blocks, i, rate, drives, reads)
        left[i] = math.exp(min(0.0, exponents[i].real) * 2.0 * math.pi / rate)
        for g in range(groups if left[i] > _GONE else 0):
            drive, read, moving = abs(drives[g]), abs(reads[0, g]), abs(reads[1, g])
            for n in range(known + 1):
                stiff, damp = abs(tangents[0, active[g], n]), abs(tangents[1, active[g], n])
                force[i, n, g], back[i, n, 0, g], back[i, n, 1, g] = (
                    stiff * read + damp * moving,
                    stiff * drive,
                    damp * drive,
                )
                damped = damped or damp > 0.0
            jumping[i, 0, g] = jumps[0, g] * read + jumps[1, g] * moving
            struck[i, 0, 0, g], struck[i, 0, 1, g] = jumps[0, g] * drive, jumps[1, g] * drive
    return Motions(exponents, left, force, back, jumping, struck, damped, jumps.sum() > 0.0)


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _coupled(couples, b, force, back, i, n):
    """How much a block b, see `LeftOut`, couples the motion i with itself by the coefficient n, see `Motions`."""
    driven = read = 0.0
    for g in range(couples.shape[2]):
        driven += couples[b, 0, g] * force[i, n, g]
        read += couples[b, 1, g] * back[i, n, 0, g] + couples[b, 2, g] * back[i, n, 1, g]
    return driven * read


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _repelled(known, i, missing, rate):
    """How far blocks that are left out move the motion i at resonance, by coefficients that are known."""
    lines, nu, decay, total = known.force.shape[1], abs(known.exponents[i].imag), known.exponents[i].real, 0.0
    for b in range(missing.turns.shape[0]):
        turn, apart = missing.turns[b], missing.decays[b] - decay
        for side in range(2):
            at = (turn + nu if side else abs(turn - nu)) / rate
            if at < lines:
                n = int(at + 0.5)
                away = abs(at - n) * rate
                if n < lines and away < _AVERAGED * turn:
                    coupled = _coupled(missing.couples, b, known.force, known.back, i, n)
                    square = away * away + apart * apart
                    if coupled > 0.0:
                        nearer = math.sqrt(square) + coupled / math.sqrt(square + coupled)
                        nearer *= coupled / (square + coupled)
                        total += max(0.0, nearer - coupled / (_AVERAGED * turn))
    return total


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _answered(missing, frequency, force, back, damped):
    """What drives a motion, back (2, G), by what is left out of the answer to forces (G,) at a frequency: of channels'
    own forces, and a bound of the rest.
    """
    own, rest, where = 0.0j, 0.0, min(abs(frequency) / missing.unit, missing.average.shape[0] - 1.0)
    j = min(int(where), missing.average.shape[0] - 2)
    low, high = j + 1.0 - where, where - j
    for g in range(force.shape[0]):
        own += back[0, g] * force[g] * (low * missing.own[j, g] + high * missing.own[j + 1, g])
        by = moving = 0.0
        for h in range(force.shape[0]):
            by += (low * missing.sizes[j, g, h] + high * missing.sizes[j + 1, g, h]) * force[h]
        for h in range(force.shape[0] if damped else 0):
            moving += (low * missing.rates[j, g, h] + high * missing.rates[j + 1, g, h]) * force[h]
        rest += back[0, g] * by + back[1, g] * moving
    return own if frequency >= 0.0 else own.conjugate(), rest


@kernel(fastmath=_FAST, error_model="numpy")
def _echoes(missing, rate, last, jumps):
    """Free vibrations faster than `last` that jumps of channel h set off, as jumps of channel g meet them, of
    displacements and rates, (2, G, G) by g and h. The jumps of a channel count alike; where those of a channel are not
    known, the mean of |D| is a bound. See `moved_without`.
    """
    count, groups, states = jumps.at.shape[0], missing.own.shape[1], missing.exponents.shape[0]
    squares, share = np.zeros((2, groups, groups)), np.zeros(groups)
    for i in range(count):
        share[jumps.channel[i]] += 1.0
    free, now = np.zeros((count, states), dtype=np.complex128), np.empty(states, dtype=np.complex128)
    for k in range(states):
        s = missing.exponents[k]
        if abs(s) > last:
            for i in range(count):
                free[i, k] = np.exp(s * ((jumps.at[(i + 1) % count] - jumps.at[i]) % (2.0 * math.pi)) / rate)
            before = math.exp(s.real * 2.0 * math.pi / rate)
            before = (before / max(1.0 - before, _TINY)) ** 2
            for part in range(2):
                for g in range(groups):
                    for h in range(groups):
                        c = missing.leaving[part, g, h, k]
                        squares[part, g, h] += before * (c.real * c.real + c.imag * c.imag)
    for i in range(count):
        h = jumps.channel[i]
        now[:] = 1.0
        for step in range(1, count):
            j = (i + step) % count
            g = jumps.channel[j]
            for k in range(states):
                now[k] *= free[(j - 1) % count, k]
            for part in range(2):
                met = 0.0
                for k in range(states):
                    c = missing.leaving[part, g, h, k]
                    met += c.real * now[k].real - c.imag * now[k].imag
                squares[part, g, h] += met * met / (share[g] * share[h])
    anywhere = missing.average[min(int(last / missing.unit), missing.average.shape[0] - 1)] / (last * math.pi)
    for g in range(groups):
        for h in range(groups):
            if share[g] == 0.0 or share[h] == 0.0:
                squares[:, g, h] = anywhere * anywhere
    return math.pi * np.sqrt(squares)


@kernel(inner=True, fastmath=_FAST, error_model="numpy")
def _by_jumps(missing, echoes, last, nu, force, back):
    """The same by all coefficients behind the frequency `last`, as those of jumps, of a motion of the frequency nu."""
    nodes, groups, own, rest, squares = missing.average.shape[0], force.shape[0], 0.0j, 0.0, 0.0
    where = min(last / missing.unit, nodes - 1.0)
    j = min(int(where), nodes - 2)
    low, high = j + 1.0 - where, where - j
    for g in range(groups):
        for h in range(groups):
            before, after = missing.tails[:, j, g, h], missing.tails[:, j + 1, g, h]
            by = complex(low * before[0] + high * after[0], nu * (low * before[1] + high * after[1]))
            if g == h:
                own += back[0, g] * by * force[h]
            else:
                rest += back[0, g] * abs(by) * force[h]
            rest += back[1, g] * (low * before[2] + high * after[2]) * force[h]
            squares += ((back[0, g] * echoes[0, g, h] + back[1, g] * echoes[1, g, h]) * force[h]) ** 2
    return own, rest + math.sqrt(squares)


@kernel(fastmath=_FAST, error_model="numpy")
def moved_without(known, rate, last, jumps, missing, most, shifts):
    """How far what is left out moves multipliers, those that have decayed counting less, or more than `most`; how far
    it moves the exponents of all slow motions within a period into shifts (B,).

    known: see `Motions`; rate: omega; last: the frequency behind that of the last coefficient that is known; jumps: see
    `Jumps`; missing: see `LeftOut`.
    """
    worst = largest = 0.0
    echoes = _echoes(missing, rate, last, jumps) if known.jumps else np.zeros((0, 0, 0))
    for i in range(missing.slow):
        shifts[i] = largest
        if not known.left[i] > _GONE:
            continue
        nu, own, shift = abs(known.exponents[i].imag), 0.0j, 0.0
        for n in range(known.force.shape[1]):
            acts = False
            for g in range(known.force.shape[2]):
                acts = acts or known.force[i, n, g] != 0.0
            for side in range((2 if n > 0 else 1) if acts else 0):
                at = nu + n * rate if side else nu - n * rate
                answer, rest = _answered(missing, at, known.force[i, n], known.back[i, n], known.damped)
                own += answer
                shift += rest
        if known.jumps:
            answer, rest = _by_jumps(missing, echoes, last, nu, known.jumping[i, 0], known.struck[i, 0])
            own += 2.0 * rate * answer
            shift += 2.0 * rate * rest
        shifts[i] = (shift + _repelled(known, i, missing, rate) + abs(own)) * 2.0 * math.pi / rate
        largest = max(largest, shifts[i])
        far = 1.0 + _FREER * (1.0 - known.left[i])
        worst = max(worst, known.left[i] * math.expm1(min(shifts[i], 1.0)) / far)
        if worst > most:
            break
    return worst


@kernel()
def of_the_rest(exponents, shifting, first, rates, yielding, active, tangents, held, followed, rate, rounding):
    """Multipliers of the blocks' states that are not `followed`, as if channels had their mean stiffness and damping,
    and how far these may move them.

    exponents, shifting, first, rates, yielding, active: see `blocks.Blocks`; tangents (2, C, .): Fourier coefficients
    of stiffness and damping; held (2, G): integrals of their sizes; rate: omega; rounding: relative error by it.
    """
    mu, errors, count = np.empty(exponents.shape[0], dtype=np.complex128), np.empty(exponents.shape[0]), 0
    rest = np.ones(exponents.shape[0], dtype=np.bool_)
    rest[followed] = False
    for b in range(rates.shape[0]):
        forces = 0.0
        for g in range(held.shape[1]):
            forces += yielding[b, g] * (held[0, g] + rates[b] * held[1, g])
        moved = math.expm1(min(2.0 * rates[b] * forces, 1.0)) + rounding
        for s in range(first[b], first[b + 1]):
            if not rest[s]:
                continue
            exponent = exponents[s]
            for g in range(held.shape[1]):
                exponent += (
                    shifting[0, s, g] * tangents[0, active[g], 0].real
                    + shifting[1, s, g] * tangents[1, active[g], 0].real
                )
            exponent *= 2.0 * math.pi / rate
            mu[count] = np.exp(exponent)
            errors[count] = abs(mu[count]) * (moved + 1e-15 * abs(exponent)) + _NOTHING
            count += 1
    return mu[:count], errors[:count]


def beyond(missing: LeftOut, frequency: float) -> float:
    """The largest entry of D from a frequency on, in the mean of forces that fall as those of a stop do."""
    return float(missing.average[min(int(frequency / missing.unit), len(missing.average) - 1)])
