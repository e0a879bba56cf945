"""Stability of a periodic motion from its monodromy matrix.

The linearised motion `M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = 0` is propagated over one period on
panels that follow the laws (`time_mesh`, `propagate`), in modes of the linear part, or blocks of such (`blocks`), with
the constant stiffnesses of contacts in them:

    y'' + C y' + K y = - sum_g left_g (k_g q_g + c_g q_g' + r_g),    q_g = right_g^T y,

For blocks that are too fast for the motion a few others stand in (`levels`), and their multipliers are those of the
motion with the means of stiffness and damping, to first order. How far that moves the others follows to first order
from the spectra of stiffness and damping (`left_out.moved_without`): it decides which blocks are meant, and belongs to
the errors, the more the less multipliers are apart. So does the share of the correction below that such blocks make.
Perturbations that decay while no channel acts need not be followed either: the period begins with the longest such
time.

Here r is the force that the motion leaves unbalanced. All elements along one direction are one channel. Laws that their
smoothness class is all of are evaluated in compiled code, all others at all nodes at once (`channels`).

A motion of H harmonics is not quite the true one: it leaves the force `r = sum d (f - P_H f)` unbalanced, P_H f the
part of the element forces within the basis. One step of Newton's method among periodic functions (Kantorovich),

    M y'' + (C + sum f_v d d^T) y' + (K + sum f_u d d^T) y = -r,   y periodic,

whose propagator is at hand, gives what the motion lacks: harmonics beyond H without end, and the shift that they cause
in those within. The multipliers are those of the motion so corrected, with an error of second order. How far they are
from those of the motion as it stands, propagated with fewer digits, is their error estimate: it covers what is left
many times over, and it also covers how far other discretisations of the motion, such as Hill's determinant, may differ.
It is at least the distance to the nearest of those: multipliers that meet on their way go farther than the first order
says. A step that moves the motion along a channel by more than a share of it, and the channel's stiffness or damping
by more than that share, is cut down to it. At a channel at rest rounding is many times the motion, and a step of that
size does nothing to the law.

At a limit point, which the multipliers of the motion as it stands tell, there is no such step: a motion of the same
frequency is far away, or there is none. What the step moves along the direction of the multiplier near +1 is then left
out, and belongs to the error: with the gap `g = 1 - mu` and the shift D of the multiplier to first order, the motions
near a fold leave `g^2 - 2 g D` for the square of the gap, so that the shift is at most about `sqrt(2 g |D|)`.

Where nothing drives a motion, it may be shifted in time: the multiplier of that direction is +1, and what the step
moves along it, which changes the phase alone, is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack

from suboctave.floquet.channels import BLIND, Channels
from suboctave.floquet.exponentials import TURNS, structure
from suboctave.floquet.forms import form_of, forms_along
from suboctave.floquet.left_out import Jumps, beyond, motions, of_the_rest, poles
from suboctave.floquet.levels import Along, levels_of
from suboctave.floquet.propagate import closed, march, multipliers_and_shifts, own_values, response
from suboctave.floquet.resolution import ACCURACY, divided, longest_rest, stretches, tolerated
from suboctave.floquet.result import FloquetResult
from suboctave.floquet.structural import with_structural_damping
from suboctave.floquet.time_mesh import (
    ORDER,
    along_panels,
    changed_laws,
    events_along,
    longest_panel,
    panels_between,
)
from suboctave.harmonic.aft.table import PackedLaws
from suboctave.harmonic.basis import Array, ComplexArray
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.quadrature import search_grid, singular_instants
from suboctave.interruption import check_time
from suboctave.lazy import lazy

#: how far what is left out of a structure may move multipliers, to first order, and how much further where a force is
#: left unbalanced altogether; beside grazing the correction by that force moves them hundreds of times as much
_NEGLECTED = (5e-6, 1.5e-5)
#: how many times that first order is stated: it is that of motions of single blocks, of which stiffness makes others
_ASSURED = 4.0
#: longest panels in units of the time scales of the forces, of the blocks as channels see them, and of the blocks; how
#: much less these count if they are seen little, as a power: with them multipliers are good for 1e-8
_LENGTHS = (1.2, 1.8, TURNS, 1.0 / 12.0)
#: logarithm of what is left of states that count no more: they need not be followed
_FORGOTTEN = math.log(1e-14)
#: how often panels are made shorter, as what is seen between their nodes needs it
_DIVIDED = 6
_TINY, _EPS = float(np.finfo(float).tiny), float(np.finfo(float).eps)
_NO_PASSAGES = np.zeros((2, 0))
_NO_MULTIPLIERS = np.empty(0, dtype=complex), np.empty(0)


class Linearised:
    """A motion as it stands, with stiffness, damping and unbalanced force of the elements along it, and one step of
    Newton's method from it.

    Attributes
    ----------
    size
        Number of states that the period begins with: a motion that decays while no channel acts has none.
    spans
        dt/ds on every panel, (P, ORDER).
    path, law, base
        See `time_mesh.along_panels`, with the elements that are not known in closed form.
    loose
        What of `base` is not within the forms of the structure.
    active
        The channels with a force, (A,).
    coupled
        Whether any channel has stiffness or damping.
    own
        How many of these are the structure's own, the first ones; others stand in for faster ones.
    missing
        How far what is left out of the structure moves multipliers, see `propagate.multipliers_and_shifts`.
    before
        Monodromy matrix along the motion as it stands, (size, size).
    """

    def __init__(self, state: BalanceState) -> None:
        balance = state.balance
        self.state = state
        own = self._own = Channels(state)
        self._levels = levels_of(state.linear, balance.all_groups)
        self._blocks = blocks = self._levels.blocks
        self._laws = laws = PackedLaws(state.laws.groups, own.probes) if own.probes else state.packed
        self._motions, self._forces, self.active = state.motions, state.force_spectra, blocks.active
        if own.probes:
            self._motions = np.concatenate((state.motions, own.motions))
            self._forces = np.concatenate((state.force_spectra[: own.first], own.forces))
            self.active = np.concatenate((np.arange(own.first), own.numbers))[blocks.active]
        degree = max(own.degree, laws.degree)
        longest = min(longest_panel(self._motions, degree), own.finest)
        self._kinked = laws.unknown_samples > 0 or own.unknown
        if laws.unknown_samples:
            longest = min(longest, BLIND / laws.unknown_samples)
        grid = search_grid(state.basis.harmonics)
        # singularities further away than the longest panel do not disturb it
        passed = [
            singular_instants(self._motions[g], points, widths, longest, grid.zr, grid.zi)
            for g, points, widths in laws.singularities
        ]
        passages = np.concatenate(passed, axis=1) if passed else _NO_PASSAGES
        self._held = np.empty((2, len(self.active)))
        self._beyond = (state.basis.harmonics + 0.5) * state.rate
        events = events_along(self._motions, laws.pieces, laws.owner, passages, grid.zr, grid.zi)
        events = own.marked(events, laws.owner)
        self.events = events[events[:, 0].argsort(kind="stable")]
        panels, start = panels_between(self.events, longest)
        self._evaluated(panels)
        self._choice = self._levels.fewest(self._along, self._beyond, self._tolerable)
        self._level = self._choice.level
        self._contacts()
        for _ in range(_DIVIDED):
            finer, begins = self._divided(panels, start)
            if len(finer) == len(panels):
                break
            panels, start = finer, begins
            self._evaluated(panels)
            self._contacts()
        rest = 0.0
        if self._level.steepest * 2.0 * math.pi < _FORGOTTEN * state.rate:
            first, rest = longest_rest(self.spans, self.law, self.base, self.active, start)
            panels, start = np.roll(panels, -first, axis=0), (start - first) % len(panels)
            self._evaluated(panels)
            self._contacts()
        self.start = start
        own.locate(self.events, start, laws.owner, len(panels))
        self._propagate(rest)

    def _along(self) -> Along:
        """What tells which blocks need states."""
        state, blocks = self.state, self._blocks
        known = motions(state.tangent_spectra, blocks.active, state.rate, poles(blocks), blocks.coupled)
        which = np.full(len(self._motions), -1)
        which[self.active] = np.arange(len(self.active))
        # where jumps may be anywhere none is known
        at = self.events[np.isinf(self.events[:, 1])] if not self._kinked else self.events[:0]
        channel = which[self._laws.owner[at[:, 5].astype(int)]]
        last = (state.tangent_spectra.shape[2] - 0.5) * state.rate
        return Along(known, state.rate, last, Jumps(at[channel >= 0, 0], channel[channel >= 0]))

    def _propagate(self, rest: float) -> None:
        """Perturbations over the period along the motion as it stands, and where the periodic response begins; no
        channel acts for a time `rest` at first.
        """
        level, channels = self._level, len(self.active)
        self._kept = np.arange(level.states)
        if rest > 0.0:
            self._kept = np.flatnonzero(np.repeat(level.decays * rest >= _FORGOTTEN, np.diff(level.first)))
        self.size = size = len(self._kept)
        self.own = int(self._kept.searchsorted(level.own))
        self.missing = (np.sqrt(_ASSURED * self._choice.shifts) * level.sizes)[:, self._kept[: self.own]]
        self._forms, self._turned = forms_along(self._level, self._sequence)
        self._structures = structure(self.spans, self._stretch, self._forms)
        panels = len(self.spans)
        self._acting = np.empty((panels, channels), dtype=bool)
        self._solved = np.empty((panels, channels * ORDER, size + 1))
        self._begins = np.empty((panels, level.states, size + 1))
        self._whole = self._march(self.law, np.zeros(self.base.shape), size + 1)
        self.before, self._start = np.empty((size, size)), np.empty((size, 1))
        closed(self._whole, self._kept, self.before, self._start)

    def _evaluated(self, panels: Array) -> None:
        """Evaluate all laws on panels."""
        laws, count, channels = self._laws, len(panels), len(self._motions)
        nodes = count * (ORDER - 1) + 1
        self.spans, self.path = np.empty((count, ORDER)), np.empty((channels, 2, nodes))
        self.law, self.base = np.zeros((channels, 4, nodes)), np.zeros((channels, count))
        along_panels(
            panels, self._motions, self._forces, self.state.rate, laws.pieces, laws.owner,
            laws.polynomial, laws.steps, laws.step_owner, laws.line, self.spans, self.path, self.law, self.base,
        )  # fmt: skip
        self._own.evaluate(self.path, self.law)
        self._tolerable, self._unbalanced, self.coupled = tolerated(
            self.spans, self._forces, self.law, self.base, self.active, self._held, _NEGLECTED
        )

    def _divided(self, panels: Array, start: np.ndarray) -> tuple[Array, np.ndarray]:
        """Panels as short as the structure needs, and which of them events begin with."""
        level = self._level
        finer: Array
        begins: np.ndarray
        finer, begins = divided(
            panels, start, self.spans, self.law, self.loose, self.active, level.rates, level.decays,
            level.flexibility, level.stiffening, self._choice.moved, self._kinked, _LENGTHS,
        )  # fmt: skip
        return finer, begins

    def _contacts(self) -> None:
        """The stiffnesses of pieces along the panels one after the other, those of their panels, and what of them no
        form of the structure has.
        """
        held, self._stretch = stretches(self.base, self.active)
        self._sequence, self.loose = tuple(map(tuple, held.tolist())), np.zeros(self.base.shape)
        for r, stiffness in enumerate(self._sequence):
            if form_of(self._level, stiffness) is None:
                self.loose[:, self._stretch == r] = self.base[:, self._stretch == r]

    def _march(self, law: Array, kick: Array, columns: int) -> Array:
        """States at the end of the period, (S, columns); see `propagate.march`."""
        total = np.zeros((self._level.states, columns))
        march(
            self._structures, self._stretch, self._forms, law, self.loose, kick, self.active, total, self._kept,
            self._acting, self._solved, self._begins,
        )  # fmt: skip
        return total

    def _changed(self, change: Array) -> tuple[Array, Array]:
        """Along the motion changed by (G, 2, N): no force, stiffness and damping (G, 3, N), kicks at the beginnings of
        panels (G, P).
        """
        laws, (channels, _, total) = self._laws, self.path.shape
        law, kick = np.zeros((channels, 3, total)), np.zeros(self.base.shape)
        changed_laws(
            self.path, self.law, change, self.state.rate, laws.pieces, laws.owner, laws.polynomial, laws.steps,
            laws.step_owner, self.events, self.start, law, kick,
        )  # fmt: skip
        self._own.changed(self.path, change, law, self.spans)
        return law, kick

    @lazy
    def _all_standing(self) -> ComplexArray:
        """Multipliers along the motion as it stands, (size,), those of what stands in for fast blocks last."""
        vectors = self.own < self.size
        real, imaginary, left, right, _ = lapack.dgeev(self.before, vectors, vectors)
        mu: ComplexArray = real + 1j * imaginary
        if not vectors:
            return mu
        own = own_values(imaginary, left, right, self.own)
        return np.concatenate((mu[own], mu[~own]))

    @lazy
    def standing(self) -> ComplexArray:
        """Multipliers along the motion as it stands, (own,)."""
        return self._all_standing[: self.own]

    @lazy
    def finite(self) -> bool:
        """Whether the monodromy matrix is made of numbers."""
        return bool(np.isfinite(self.before).all())

    @property
    def rounding(self) -> float:
        """Relative errors of multipliers due to eigenvectors that are nearly parallel."""
        return self._blocks.rounding + self._turned

    def others(self) -> tuple[ComplexArray, Array]:
        """Multipliers of what has no states at the beginning, as if channels had their mean stiffness and damping, and
        how far these may move them.
        """
        blocks = self._blocks
        if self.own == len(blocks.exponents):
            return _NO_MULTIPLIERS
        return of_the_rest(
            blocks.exponents, blocks.shifting, blocks.first, blocks.rates, blocks.yielding, blocks.active,
            self.state.tangent_spectra, self._held, self._kept[: self.own], self.state.rate, self.rounding,
        )  # fmt: skip

    def _still(self) -> Array:
        """Where the periodic response begins, (N, 1), with the least change of the phase: nothing along the singular
        vector of `1 - monodromy` that is the shift in time.
        """
        closing, kick = np.eye(self.size) - self.before, self._whole[self._kept, self.size]
        left, sizes, right = np.linalg.svd(closing)
        kept = sizes > _SHIFTED * sizes[0]
        kept[-1] = False
        return right[kept].T @ ((left.T @ kick)[kept] / sizes[kept])[:, None]

    def multipliers(self, weight: float) -> tuple[ComplexArray, Array, float]:
        """Multipliers, how far the correction has moved them, and blocks without states may, (2, N), and the share of
        the correction that was taken.

        weight: share of its part along the direction of the real multiplier nearest to +1.
        """
        share, start = 1.0, self._start
        change = np.zeros(self.path.shape)
        if len(self.active):
            if not self.state.driven:
                start = self._still()
            elif weight < 1.0:
                start = start - (1.0 - weight) * (projector(self.before, self._all_standing) @ start)
            excess = response(
                self._structures, self._stretch, self._forms, self.active, self._acting, self._solved, self._begins,
                start, self._whole, self._kept, self.path, _LARGEST, change,
            )  # fmt: skip
            if excess > 1.0:
                share = self._share(change)
                change = share * change if share > 0.0 else np.zeros(change.shape)
        law, kick = self._changed(change)
        after = self._march(law, kick, self.size)[self._kept]
        mu, shift = np.empty(self.size, dtype=complex), np.empty((2, self.size))
        real, imaginary, left, right, _ = lapack.dgeev(after, 1, 1)
        multipliers_and_shifts(
            real, imaginary, left, right, after, self.before, self.own, self.missing, self._doubt(change, share), mu,
            shift,
        )  # fmt: skip
        mu, shift = mu[: self.own], shift[:, : self.own]
        # where multipliers meet on their way the first order tells too little: each has at least come from the nearest
        np.maximum(shift[0], np.minimum.reduce(np.abs(mu[:, None] - self.standing), axis=1), out=shift[0])
        return mu, shift, share

    def _share(self, change: Array) -> float:
        """The share of a correction (C, 2, N) with which none moves the motion along a channel by more than `_LARGEST`
        of it, or its stiffness and damping by as much of theirs, whichever allows more: what is added to a channel at
        rest may be many times its motion and mean nothing to its law, or its law nothing beside the others. One that
        is not finite is left out.
        """
        if not np.isfinite(change).all():
            return 0.0
        after, kick = self._changed(change)
        worst, rate = 1.0, self.state.rate
        # rounding of the largest stiffness, or damping times the frequency
        least = _EPS * max(float(np.abs(self.law[:, 1]).max()), rate * float(np.abs(self.law[:, 2]).max()), _TINY)
        sizes = [np.maximum.reduce(np.abs(part[self.active, 0]), axis=1).tolist() for part in (change, self.path)]
        for g, most, motion in zip(self.active.tolist(), *sizes, strict=True):
            if most <= _LARGEST * motion:
                continue
            own = self._own.together(g)
            turned = math.inf if kick[own].any() else 0.0
            for part, smallest in ((1, least), (2, least / rate)):
                old, new = self.law[own, part], after[own, part]
                if (new != old).any():
                    turned = max(turned, float(np.abs(new - old).max() / max(np.abs(old).max(), smallest, _TINY)))
            worst = max(worst, min(most / max(motion, _TINY), turned) / _LARGEST)
        return 1.0 / worst

    def _doubt(self, change: Array, share: float) -> float:
        """Share of a correction that is wrong by what the level leaves out, of forces beyond the harmonics."""
        missing = self._level.left_out
        if missing is None:
            return 0.0
        size = float(np.abs(change[:, 0]).max(initial=0.0))
        alone = share * self._unbalanced * beyond(missing, self._beyond)
        return min(1.0, alone / size) if size > 0.0 else 0.0


#: singular value of `1 - monodromy`, as a share of the largest, of a direction that is left as it is
_SHIFTED = 1e-6
#: a correction that moves a channel's motion, and its stiffness or damping, by more than this share of them is cut
#: down to it
_LARGEST = 0.1
#: shift of a multiplier in units of its distance to +1 that leaves doubt whether the first order tells it
_DOUBTFUL = 0.1
#: distance to +1 up to which multipliers lie together with the nearest one, in units of its own
_TOGETHER = 3.0
#: natural vibrations in a period of the load beyond which a phase has no digits left
_MOST_TURNS = 1e15


class MonodromySpectrum:
    """A `Spectrum` of a solved motion by the monodromy matrix, over the motion's own period (`nu` load periods)."""

    def __init__(self, state: BalanceState) -> None:
        check_time()
        self._motion = Linearised(state)
        self._structural = not state.balance.system.structural.zero

    @lazy
    def standing(self) -> FloquetResult:
        return self.completed if self._structural else _result(self._motion, _as_it_stands)

    @lazy
    def completed(self) -> FloquetResult:
        result = _result(self._motion, _with_states)
        return with_structural_damping(self._motion.state, result) if self._structural else result


def floquet_multipliers(state: BalanceState) -> FloquetResult:
    """Multipliers, error estimates and verdict of a solved motion, over the motion's own period (`nu` load periods)."""
    return MonodromySpectrum(state).completed


def _result(motion: Linearised, with_states: Callable[[Linearised], tuple[ComplexArray, Array]]) -> FloquetResult:
    """Of the linear part's equation of motion; `with_states` gives multipliers and errors of the blocks with states."""
    mu, errors = motion.others()
    if not motion.finite:
        return _no_numbers(motion.state, motion.size + len(mu))
    if motion.own:
        own, own_errors = with_states(motion)
        mu, errors = (np.concatenate((own, mu)), np.concatenate((own_errors, errors))) if mu.size else (own, own_errors)
    order = (-np.abs(mu)).argsort(kind="stable")
    return FloquetResult(mu[order], errors[order])


def _as_it_stands(motion: Linearised) -> tuple[ComplexArray, Array]:
    """Multipliers of the blocks that have states along the motion as it stands, with the errors of computing them."""
    mu, errors = motion.standing, np.empty(motion.own)
    errors.fill(_least(motion) * max(1.0, float(np.maximum.reduce(np.abs(mu)))))
    return mu, errors


def _least(motion: Linearised) -> float:
    """Errors of computing multipliers, relative to the largest."""
    return (ACCURACY if motion.coupled else 0.0) + motion.rounding


def _with_states(motion: Linearised) -> tuple[ComplexArray, Array]:
    """Multipliers and errors of the blocks that have states, of the motion with what its harmonics leave out."""
    mu, shift, share = motion.multipliers(1.0)
    largest = max(1.0, abs(mu[0]))
    # that nearest to +1 is the motion's as it stands: a correction may have carried it off, to meet another one
    nearest = motion.standing[np.abs(1.0 - motion.standing).argmin()]
    gap = abs(1.0 - nearest)
    moved = shift[0, np.abs(mu - nearest).argmin()] / share if share > 0.0 else math.inf
    if motion.state.driven and moved > _DOUBTFUL * gap:
        mu, shift, share = _beside_fold(motion, gap, moved)
    # where the correction had to be cut, the motion is not near enough to a true one to say much
    cut = 1.0 / share - 1.0 if share > 0.0 else math.inf
    return mu, shift[0] * (1.0 + cut) + shift[1] + (_least(motion) + cut) * largest


def _no_numbers(state: BalanceState, count: int) -> FloquetResult:
    """Where a law gives no number between the samples of a motion; OverflowError for sizes beyond numbers."""
    mass, _, stiffness = state.linear.equation_of_motion()
    with np.errstate(all="ignore"):
        turns = math.sqrt(float(np.abs(np.linalg.solve(mass, stiffness)).max())) / state.omega
    if not turns < _MOST_TURNS:
        raise OverflowError(f"natural vibrations turn {turns:.0e} times in a period of the load")
    return FloquetResult.inapplicable(count, "monodromy", "The linearised motion is not finite")


def _beside_fold(motion: Linearised, gap: float, moved: float) -> tuple[ComplexArray, Array, float]:
    """Multipliers, shifts and share where a correction may have no meaning, as it does at a limit point.

    gap: distance to +1 of the multiplier nearest to it along the motion as it stands; moved: its shift by the whole
    correction.
    """
    ratio = 2.0 * moved / gap if gap > 0.0 else math.inf
    mu, shift, share = motion.multipliers(1.0 / (1.0 + min(ratio, 1e6) ** 4))
    left_out = moved * min(1.0, 2.0 / math.sqrt(ratio)) if math.isfinite(moved) else math.inf
    shift[0] += 2.0 * left_out
    return mu, shift, share


def _unsorted() -> None:
    """What LAPACK is given in the place of a choice that it asks for eigenvalue by eigenvalue."""


def projector(phi: Array, mu: ComplexArray) -> Array:
    """On the invariant subspace of the multipliers nearest to +1, one or several that lie together, (N, N); mu (N,):
    all of them.

    With `phi = Q [[A, X], [0, B]] Q^T`, A with these multipliers, it is `Q [[1, R], [0, 0]] Q^T`, `A R - R B = X`.
    """
    reach = _TOGETHER * float(np.abs(1.0 - mu).min())
    schur, _, real, imaginary, q, _, _ = lapack.dgees(_unsorted, phi)
    chosen = np.hypot(1.0 - real, imaginary) <= reach
    schur, q, _, _, count, *_ = lapack.dtrsen(chosen.astype(np.int32), schur, q, job="N")
    inside, coupling, outside = schur[:count, :count], schur[:count, count:], schur[count:, count:]
    beside = coupling
    if 0 < count < len(phi):
        beside, scale, _ = lapack.dtrsyl(inside, outside, coupling, isgn=-1)
        beside = beside / scale
    result: Array = q[:, :count] @ np.hstack((np.eye(count), beside)) @ q.T
    return result
