"""Whether a bifurcation lies in the layer behind a grazing, where a contact is too young to be smooth.

Behind a grazing at s = 0 (s: way along the curve) the force of the young contact changes R_X, and with it every test
function g, like the square root of s:

    g(s) = g_0 + c sqrt(s) + O(s).

Where that term carries g through zero, the bifurcation is one of the non-smooth system: it owes its place to the
contact that begins, and the critical multiplier crosses the circle in a sliver of the parameter. Newton's method for
such a g, `s <- 2 sqrt(s s_0) - s` with s_0 the zero, converges from every start between the grazing and 4 s_0 and
leaves the layer from any other. In r = sqrt(s) g is smooth: from g at the grazing and at one place behind it a secant
tells s_0, or that there is none, and Newton's method begins there (`behind_grazing`). The layer ends where the stop
turns the motion by itself: half the duration t of the contact is no longer small beside the stop's own time, `t
sqrt(k/m) = 1`, k its stiffness and m the mass that it meets.

With elastic stops the multipliers are continuous all the same: the force is continuous at a gap, so that no saltation
matrix stands between contact and flight (Leine, Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
Springer 2004). They jump in the limit of a rigid stop only. A layer thinner than the engine's smallest step is a jump
to whoever follows the curve, and called so (`Bifurcation.discontinuous`).
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from suboctave.bifurcation.bifurcation import CONTACT_KINDS, Bifurcation
from suboctave.bifurcation.bordered import bordered, weighted_operator
from suboctave.bifurcation.gaps import GrazingContact, gap_extrema, height_at, level_of, stiffness_jump
from suboctave.bifurcation.measures import upper
from suboctave.continuation.linear import Factor
from suboctave.continuation.newton import correct
from suboctave.curves.events.grazings import Grazing, Touch
from suboctave.curves.events.locate import NEWTON, Guess, Singular
from suboctave.curves.events.monitors import BifurcationKind
from suboctave.curves.motion import MotionEvaluation
from suboctave.curves.trace import BranchPoint
from suboctave.errors import ConvergenceError
from suboctave.floquet.result import FloquetResult
from suboctave.harmonic.basis import Array, HarmonicBasis
from suboctave.harmonic.evaluation import BalanceState
from suboctave.harmonic.perturbation import Kind
from suboctave.harmonic.truncation import motion_size, truncation

#: exponent of the test function's path from the grazing below which it counts as a square root (1/2; smooth: 1)
_SQUARE_ROOT = 0.75
#: largest force of a young contact, in units of the inertia force that turns the motion at the gap: (t sqrt(k/m))^2 / 2
_YOUNG = 0.05
#: excursion across the gap, in units of the motion, up to which grazings are looked for
_NEAR = 0.05
#: way from a grazing to a bifurcation that is started from there, in scaled arclength, at most
_REACH = 0.01
#: the same for one that is bracketed only
_BRACKETED = 1e-3
#: how many times as far as a grazing lies the first correction of Newton's method to it may lead
_STEP_TO_GRAZING = 4.0
#: way behind a grazing at which a test function is first looked at, and secants in its root
_FIRST, _SECANTS = 1e-8, 3
#: change of kappa, in units of the base frequency, that tells how det J_kappa depends on it
_TURN = 1e-6
#: bifurcations that a grazing may bring about at which a multiplier, or a pair, jumps across the unit circle, and where
_CRITICAL = {"LP": 1.0, "PD": -1.0, "NS": None}
#: distance of the places of one grazing, relative
_ONE = 1e-7


def layer_of(kind: BifurcationKind, solution: Singular, guess: Guess) -> GrazingContact | None:
    """The grazing in whose layer a located bifurcation lies, None for a smooth one; `guess`: its start."""
    if solution.vectors is None:
        return None
    best: GrazingContact | None = None
    here = replace(guess, state=solution.state)
    for touch, grazing, distance in _solved(here, _touches_near(here, young=True)):
        if best is not None and distance >= best.distance:
            continue
        if _exponent(kind, solution, grazing, guess) < _SQUARE_ROOT:
            best = replace(touch.contact(grazing, guess.name), change="", distance=distance)
    return best


def grazing_beside(guess: Guess) -> GrazingContact | None:
    """The grazing at a motion where a bifurcation could only be bracketed, if there is one that near."""
    for touch, grazing, distance in _beside(guess, _BRACKETED)[:1]:
        return replace(touch.contact(grazing, guess.name), change="", distance=distance)
    return None


def behind_grazing(kind: BifurcationKind, guess: Guess) -> Singular | None:
    """A bifurcation in the layer behind a grazing near the guess, started from that grazing; None if there is none."""
    for touch, grazing, _ in _beside(guess, _REACH):
        start = _start(kind, touch, grazing, guess)
        if start is None:
            continue
        try:
            solution = kind.solve(start)
        except ConvergenceError:
            continue
        if kind.genuine(solution, start) and not _far(solution, replace(guess, state=grazing.state)):
            return solution
    return None


def solve_or_behind(kind: BifurcationKind, guess: Guess) -> Singular:
    """Solve from a guess, or from the grazing beside it where Newton's method fails; raises ConvergenceError."""
    try:
        return kind.solve(guess)
    except ConvergenceError:
        behind = behind_grazing(kind, guess)
        if behind is None:
            raise
        return behind


def unresolved(
    kind: BifurcationKind, guess: Guess, contact: GrazingContact, coarser: tuple[int, float] | None = None
) -> float:
    """What the neglected harmonics may do to the place of a bifurcation behind a grazing, in the free parameter.

    A short push moves the place where it acts by a sum over 1/k^2, whose rest falls like 1/H: the place with fewer
    harmonics tells it. Where there is none with two thirds of them that of the grazing does, beside the thickness of
    the layer. `coarser`: a number of harmonics with which it was found before, and where.
    """
    basis, thickness = guess.state.basis, abs(guess.parameter - contact.parameter)
    if coarser is not None and 0.5 * basis.harmonics <= coarser[0] <= 0.75 * basis.harmonics:
        fewer, moved = coarser[0], abs(coarser[1] - guess.parameter)
    elif basis.harmonics == 1:
        return thickness
    else:
        other = HarmonicBasis(2 * basis.harmonics // 3, basis.nu)
        fewer, state = other.harmonics, guess.state
        x = basis.resized(state.x, other)
        balance = state.balance.with_basis(other).settle(x, state.omega, state.values)
        start = replace(guess, state=balance.at(x, state.omega, state.values))
        there: Singular | None = None
        with suppress(ConvergenceError):
            there = solve_or_behind(kind, start)
        if there is not None and _far(there, start):
            there = behind_grazing(kind, start)
        if there is None:
            return max(thickness, _grazing_moved(start, contact) / (basis.harmonics / fewer - 1.0))
        moved = abs(guess.value(there.state) - guess.parameter)
    return moved / (basis.harmonics / fewer - 1.0)


def _grazing_moved(start: Guess, contact: GrazingContact) -> float:
    """How far from a contact's grazing that of the same contact lies beside a motion, in the free parameter; where
    there is none as far as what the motion leaves out, in units of the parameter.
    """
    own = contact.element, contact.gap
    touches = [touch for touch in _touches_near(start, young=False) if _gap_of(touch, start.state) == own]
    places = [start.value(grazing.state) for _, grazing, _ in _solved(start, touches)]
    moved = (abs(place - contact.parameter) for place in places)
    return min(moved, default=truncation(start.state) * abs(start.parameter))


def behind_their_grazings(located: list[tuple[float, Bifurcation]]) -> list[Bifurcation]:
    """What was located in a step, each with its place on the way from 0 to 1, in the order met.

    Where a bifurcation and the grazing that brings it about lie too close to tell, the contact tells the side.
    """
    result = []
    for place, item in located:
        fraction, contact = place, None if item.kind in CONTACT_KINDS else item.contact
        grazings = [
            (at, other, other.contact)
            for at, other in located
            if contact is not None and other.contact is not None and other.kind in CONTACT_KINDS
            if other.contact.element == contact.element and abs(at - place) < 0.1
        ]
        if grazings:
            at, grazing, its = min(grazings, key=lambda entry: abs(entry[0] - place))
            # the contact exists after it begins and before it ceases
            side = 1.0 if its.change.startswith("begins") else -1.0
            if (place - at) * side <= 0.0:
                fraction, item = at + side * 1e-12, replace(item, arclength=grazing.arclength)
        result.append((fraction, item))
    return [item for _, item in sorted(result, key=lambda pair: pair[0])]


def jumps(items: list[Bifurcation], points: Sequence[BranchPoint]) -> tuple[list[Bifurcation], list[list[Bifurcation]]]:
    """The bifurcations of a curve with each jump at a grazing once, and what cannot be told: jumps there and back.

    Along the square root of one layer a test function comes to zero once at most. Of several discontinuous bifurcations
    of a kind at one grazing the harmonics make all but one, and that one only where the test changes its sign from one
    side of what they leave uncertain to the other. It reaches as far as the others do.
    """
    kept, back = list(items), []
    for run in _at_one_grazing(items):
        kept = [item for item in kept if all(item is not other for other in run)]
        sides = [_side(run[0].kind, point.floquet) for point in _around(run, kept, points)]
        if len(sides) == 2 and sides[0] == sides[1]:
            back.append(run)
            continue
        # one that is solved for before one of which a bracket is known
        best = min(run, key=lambda item: (item.null_vectors is None, item.uncertainty))
        name = best.parameter_name
        reach = max(abs(item.parameter(name) - best.parameter(name)) + item.uncertainty for item in run)
        insort(kept, replace(best, uncertainty=reach), key=lambda item: item.arclength)
    return kept, back


def _around(run: list[Bifurcation], others: list[Bifurcation], points: Sequence[BranchPoint]) -> list[BranchPoint]:
    """The last settled point before some bifurcations and the first behind them, up to the next of their kind: those
    beyond what they leave uncertain, where there are such.
    """
    name, kind = run[0].parameter_name, run[0].kind
    ends = run[0].arclength, run[-1].arclength
    before = max(
        (item.arclength for item in others if item.kind == kind and item.arclength < ends[0]), default=-math.inf
    )
    behind = min(
        (item.arclength for item in others if item.kind == kind and item.arclength > ends[1]), default=math.inf
    )
    settled = [point for point in points if point.floquet.decided]
    result = []
    for side in (
        [point for point in reversed(settled) if before < point.arclength < ends[0]],
        [point for point in settled if ends[1] < point.arclength < behind],
    ):
        clear = (
            p for p in side if all(abs(p.parameter(name) - item.parameter(name)) > item.uncertainty for item in run)
        )
        result += [next(clear, side[0])] if side else []
    return result


def _at_one_grazing(items: list[Bifurcation]) -> Iterator[list[Bifurcation]]:
    """Two and more discontinuous bifurcations of a kind, one after the other, that one grazing brings about."""
    run: list[Bifurcation] = []
    for item in (item for item in items if item.kind not in CONTACT_KINDS):
        if run and _one_jump(run[-1], item):
            run.append(item)
            continue
        if len(run) > 1:
            yield run
        run = [item]
    if len(run) > 1:
        yield run


def _one_jump(a: Bifurcation, b: Bifurcation) -> bool:
    if a.kind != b.kind or a.kind not in _CRITICAL or not (a.discontinuous and b.discontinuous):
        return False
    one, other, name = a.contact, b.contact, a.parameter_name
    assert one is not None
    assert other is not None
    apart = max(abs(one.parameter - other.parameter), abs(a.parameter(name) - b.parameter(name)))
    same = (one.element, one.gap) == (other.element, other.gap)
    return same and apart <= a.uncertainty + b.uncertainty + _ONE * abs(one.parameter)


def _side(kind: str, floquet: FloquetResult) -> bool:
    """On which side of a bifurcation of a kind a motion lies."""
    critical = _CRITICAL[kind]
    if critical is None:
        return np.count_nonzero(np.abs(upper(floquet.multipliers)) > 1.0) % 2 == 0
    return bool(np.prod(floquet.multipliers - critical).real > 0.0)


def _beside(guess: Guess, limit: float) -> list[tuple[Touch, Grazing, float]]:
    """Grazings up to some way off, the nearest first."""
    foretold = _foretold(guess, _touches_near(guess, young=False), _STEP_TO_GRAZING * limit)
    near = [item for item in _solved(guess, foretold) if item[2] <= limit]
    return sorted(near, key=lambda item: item[2])


def _foretold(guess: Guess, touches: list[Touch], limit: float) -> list[Touch]:
    """Those extrema whose grazing lies up to some way off, by the first correction of Newton's method to each.

    One factorisation serves all: along a curve an extremum rises at a rate that its tangent tells.
    """
    if not touches:
        return []
    state, weights = guess.state, _weights(guess.state, guess)
    rises = [_rise(state, touch, guess.name) for touch in touches]
    row = rises[0][1] / weights
    factor, rows = _above(state, guess, weights, row)
    if factor.singular:
        return touches
    size = len(row)
    along, off = factor.solve(np.eye(1, size, size - 1)[0]), factor.solve(np.append(-state.residual * rows, 0.0))
    kept = []
    for touch, (height, rise) in zip(touches, rises, strict=True):
        rate = float(rise / weights @ along)
        left = height + float(rise / weights @ off)
        if rate != 0.0 and np.linalg.norm(off - left / rate * along) <= limit:
            kept.append(touch)
    return kept


def _rise(state: BalanceState, touch: Touch, name: str) -> tuple[float, Array]:
    """Height of an extremum over its gap, and its gradient by coefficients and free parameter, (dimension + 1,)."""
    height = height_at(state, touch.element, touch.index, touch.tau, (name,))
    return height.height, np.append(height.by_x, height.by_names)


def _gap_of(touch: Touch, state: BalanceState) -> tuple[int, float]:
    """The element whose gap an extremum passes, and the gap."""
    return touch.element, level_of(state.local(touch.element), touch.index)


def _start(kind: BifurcationKind, touch: Touch, grazing: Grazing, guess: Guess) -> Guess | None:
    """Where a bifurcation lies in the layer behind a grazing, by secants of det J_kappa in the root of the way; None
    where it lies on the other side, or beyond the reach of a layer.
    """
    here, way = replace(guess, state=grazing.state), _way_behind(touch, grazing, guess)
    origin = here.vector(here.state)
    if way is None:
        return None
    sign, log = np.linalg.slogdet(weighted_operator(here.state, kind.operator, guess.kappa)[0])
    if sign == 0.0:
        return None

    def ratio(root: float, turn: float = 0.0) -> complex:
        """det J_kappa in units of that at the grazing: a young contact adds a term of rank one, in proportion to r."""
        there = here.moved(origin + root**2 * way).state
        kappa = guess.kappa + turn * here.state.rate
        its, larger = np.linalg.slogdet(weighted_operator(there, kind.operator, kappa)[0])
        return complex(its / sign * np.exp(larger - log))

    # a determinant that is real has no other unknown
    by_turn = (ratio(0.0, _TURN) - 1.0) / _TURN if kind.operator is Kind.FREE else 1j
    root, turn = math.sqrt(_FIRST), 0.0
    for _ in range(_SECANTS):
        by_root = (ratio(root) - 1.0) / root
        both = by_root.real * by_turn.imag - by_root.imag * by_turn.real
        if both == 0.0:  # the contact changes nothing
            return None
        root, turn = -by_turn.imag / both, by_root.imag / both
        if not 0.0 < root <= math.sqrt(_REACH):
            return None
    return replace(here.moved(origin + root**2 * way), kappa=guess.kappa + turn * here.state.rate)


def _way_behind(touch: Touch, grazing: Grazing, guess: Guess) -> Array | None:
    """The curve's tangent at a grazing, (dimension + 1,), of unit length in scaled arclength, to the side on which the
    contact is young; None where it has none.
    """
    state = grazing.state
    weights = _weights(state, guess)
    rise = touch.rise(grazing, guess.name) / weights
    factor, _ = _above(state, guess, weights, rise)
    if factor.singular:
        return None
    # along it the extremum rises through the gap at a rate of one: an excursion is a maximum above, a minimum below
    tangent = factor.solve(np.eye(1, len(rise), len(rise) - 1)[0])
    tangent *= (1.0 if touch.maximum else -1.0) / np.linalg.norm(tangent)
    return np.asarray(tangent / weights)


def _above(state: BalanceState, guess: Guess, weights: Array, row: Array) -> tuple[Factor, Array]:
    """The equations' derivatives above a row, both scaled, factorised; the weights of the equations."""
    dimension = state.balance.dimension
    rows = state.balance.row_weights(dimension) / max(state.balanced.scale, np.finfo(float).tiny)
    matrix = np.empty((dimension + 1, dimension + 1), order="F")
    matrix[:-1] = state.extended_jacobian(guess.name) * rows[:, None] / weights
    matrix[-1] = row / np.linalg.norm(row)
    return Factor.of(matrix, overwrite=True), rows


def _touches_near(guess: Guess, young: bool) -> list[Touch]:
    """Extrema beside the gaps of exact contacts on a motion; `young`: only of contacts that are, and young."""
    state, found = guess.state, list[Touch]()
    mass = state.linear.equation_of_motion()[0]
    for gap in gap_extrema(state):
        acting = state.linear.expand(state.balance.group_of[gap.element].direction)
        size = float(np.abs(gap.value).max(initial=0.0))
        for tau, value, curve in zip(gap.tau, gap.value, gap.curve, strict=True):
            beyond = value - gap.level
            if curve == 0.0 or abs(beyond) > _NEAR * size:
                continue
            stiffness = abs(stiffness_jump(state, gap.element, gap.index, float(tau)))
            if stiffness == 0.0:
                continue
            # the first basis function is one
            read = state.linear.expand(height_at(state, gap.element, gap.index, float(tau)).by_x[0])
            mobility = abs(float(read @ np.linalg.solve(mass, acting)))
            force = stiffness * mobility * abs(beyond / curve) / state.rate**2
            if young and (beyond * curve > 0.0 or force > _YOUNG):
                continue
            found.append(Touch(gap.element, gap.index, float(tau), 0.5, bool(curve < 0.0), bool(beyond > 0.0)))
    return found


def _solved(guess: Guess, touches: list[Touch]) -> Iterator[tuple[Touch, Grazing, float]]:
    """The grazings of extrema beside a motion, with the way there."""
    for touch in touches:
        try:
            grazing = touch.solve(guess)
        except ConvergenceError:
            continue
        yield touch, grazing, float(np.linalg.norm(_chord(grazing.state, guess.state, guess)))


def _weights(state: BalanceState, guess: Guess) -> Array:
    """Scaled arclength: coefficients in units of the motion, the free parameter in units of its range."""
    weight = state.balance.column_weights
    return np.append(weight / max(motion_size(state), np.finfo(float).tiny), 1.0 / guess.span)


def _chord(a: BalanceState, b: BalanceState, guess: Guess) -> Array:
    """From one motion to another, scaled."""
    return _weights(b, guess) * (guess.vector(b) - guess.vector(a))


def _far(solution: Singular, start: Guess) -> bool:
    """Whether a solution lies farther from its start than one that belongs to a grazing there."""
    return float(np.linalg.norm(_chord(start.state, solution.state, start))) > _REACH


def _exponent(kind: BifurcationKind, solution: Singular, grazing: Grazing, guess: Guess) -> float:
    """Exponent p of `|g - g_0| ~ s^p` between the grazing and the bifurcation, from a point at a quarter of the way."""
    assert solution.vectors is not None
    chord = _chord(grazing.state, solution.state, guess)
    length = float(np.linalg.norm(chord))
    if length < 1e-9:
        return 0.5
    weights = _weights(solution.state, guess)
    start = 0.75 * guess.vector(grazing.state) + 0.25 * guess.vector(solution.state)
    try:
        problem = replace(guess, state=solution.state).moved(start).problem()
        scale = problem.weights(start, 0.0)
        row = weights * chord / scale
        solved = correct(problem, start, row / float(np.linalg.norm(row)), scale, NEWTON).evaluation
    except ConvergenceError:
        return 0.5
    assert isinstance(solved, MotionEvaluation)
    # at the bifurcation itself g vanishes
    g = [bordered(s, kind.operator, solution.vectors, solution.kappa).g for s in (grazing.state, solved.state)]
    near, far = abs(g[1] - g[0]), abs(g[0])
    if near == 0.0 or far == 0.0:
        return 1.0
    return math.log(far / near) / math.log(4.0)
