"""The response with all branches that bifurcate from it, each once: `bifurcation_diagram`.

A response curve is followed (and if it folds back and leaves the range where it began, that from the other end, too),
then the branches that leave it at its period doublings and branch points, then those that leave these, as deep as
asked. A branch that meets its parent at another bifurcation is not followed back from there.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from suboctave.analysis.branch import Branch
from suboctave.analysis.junction import Junction
from suboctave.analysis.making import Harmonics
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.switching import switch_branch
from suboctave.analysis.tree import BifurcationDiagram, DiagramBranch
from suboctave.analysis.verbs import frequency_response
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.formulation import Formulation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption
from suboctave.model.system import System
from suboctave.stability import StabilityMethod
from suboctave.store.layout import events_met

__all__ = ["BifurcationDiagram", "DiagramBranch", "Keeper", "bifurcation_diagram"]

#: kinds at which other branches leave
_SWITCHED = ("PD", "BP")
#: number of the response from the other end for whoever keeps branches
_OTHER_END = -2


class Keeper(Protocol):
    """Somebody who keeps branches as they are found, and knows those of a run that was stopped.

    A branch is told by the number of its parent and the index of the bifurcation that it leaves at among
    `events_met(parent)`; the response by -1 and -1. That from the other end has the number -2 while branches are
    followed: it is told by -2 and -1.
    """

    def known(self, parent: int, event: int) -> Branch | None:
        """The branch, if an earlier run has found it."""
        ...

    def keep(self, parent: int, event: int, branch: Branch) -> None:
        """A branch that has been followed to its end."""
        ...


@timed
def bifurcation_diagram(
    system: System,
    omega: tuple[float, float],
    depth: int = 2,
    *,
    harmonics: Harmonics = "adaptive",
    max_branches: int = 32,
    seconds: float | None = None,
    start: Any = None,
    max_step: float | None = None,
    observe: int | None = None,
    events: Sequence[Event] = (),
    progress: Any = None,
    newton: NewtonOptions | None = None,
    stepping: SteppingOptions | None = None,
    stability: StabilityMethod | str | None = None,
    formulation: Formulation | str | None = None,
    keeper: Keeper | None = None,
) -> BifurcationDiagram:
    """The response over a range of frequencies with all branches that bifurcate from it, each once.

    Where it folds back and leaves the range at the end at which it began, the response from the other end is followed,
    too (unless `start` chooses a motion): branch 1, beside branch 0, with no bifurcation as its origin.

    Parameters
    ----------
    system, omega
        As in `frequency_response`.
    depth
        How many bifurcations deep: 0 the response alone, 1 the branches that leave it, 2 those that leave these (along
        a cascade of period doublings 1 gives 2T, 2 gives 4T, ...).
    max_branches
        Branches after which no more are followed.
    seconds
        Time limit, after which what has been found is given.
    keeper
        Keeps branches as they are found, and knows those that an earlier run with the same arguments has found.

    Other parameters as `frequency_response`. What depth or budget left out is listed: `node.left` at every branch, and
    `stopped` in words. Ctrl-C ends it politely with what was found.

    Raises
    ------
    InputError, ConvergenceError
        As `frequency_response`. A branch that cannot be followed does not end the diagram: it is listed as not
        followed.
    """
    if isinstance(depth, bool) or not isinstance(depth, int) or depth < 0:
        raise InputError(f"depth must be a whole number, 0 or more, not {depth!r}")
    if isinstance(max_branches, bool) or not isinstance(max_branches, int) or max_branches < 1:
        raise InputError(f"max_branches must be a whole number of at least 1, not {max_branches!r}")
    with reporting(progress, "bifurcation diagram") as report:
        told = _Told(report)
        options: dict[str, Any] = {
            "max_step": max_step,
            "observe": observe,
            "events": events,
            "newton": newton,
            "stepping": stepping,
            "stability": stability,
            "formulation": formulation,
            "progress": told.of(0, 1, "T") if report is not None else None,
        }
        first = None if keeper is None else keeper.known(-1, -1)
        if first is None:
            first = frequency_response(system, omega, harmonics, start=start, **options)
            if keeper is not None and not first.interrupted:
                keeper.keep(-1, -1, first)
        root = DiagramBranch(first)
        missed = ""
        if start is None and _returned(first, omega):
            options["progress"] = told.of(0, 1, "T from the other end") if report is not None else None
            try:
                other = _from_other_end(system, omega, harmonics, options, keeper)
                root.children.append(DiagramBranch(other, number=_OTHER_END))
            except ConvergenceError as failure:
                missed = f"the response from the other end was not found: {failure}"
        stopped, interruption = _grown(root, depth, max_branches, options, told, keeper)
    return BifurcationDiagram(root, "; ".join(reason for reason in (stopped, missed) if reason), interruption)


def grown_from(branch: Branch, depth: int, options: dict[str, Any]) -> BifurcationDiagram:
    """A branch that is known with what bifurcates from it, so many bifurcations deep; `options` of the verbs."""
    root = DiagramBranch(branch)
    stopped, interruption = _grown(root, depth, sys.maxsize, dict(options), _Told(None), None)
    return BifurcationDiagram(root, stopped, interruption)


def _returned(branch: Branch, omega: tuple[float, float]) -> bool:
    """Whether a response folds back and leaves the range where it began, so that it says nothing of the other end."""
    return len(branch) > 1 and not branch.closed and not branch.interrupted and float(branch.omega[-1]) == omega[0]


def _from_other_end(
    system: System, omega: tuple[float, float], harmonics: Harmonics, options: dict[str, Any], keeper: Keeper | None
) -> Branch:
    """The response that begins at the other end of the range, from the keeper if that knows it."""
    branch = None if keeper is None else keeper.known(_OTHER_END, -1)
    if branch is None:
        branch = frequency_response(system, (omega[1], omega[0]), harmonics, **options)
        if keeper is not None and not branch.interrupted:
            keeper.keep(_OTHER_END, -1, branch)
    return branch


def _grown(
    root: DiagramBranch,
    depth: int,
    most: int,
    options: dict[str, Any],
    told: _Told,
    keeper: Keeper | None,
) -> tuple[str, Interruption | None]:
    """Follow what leaves the branches, level by level; why that ended early, in words, and what interrupted it."""
    waiting = deque(root)
    count, full = 1, False
    interruption = next((node.branch.interruption for node in root if node.branch.interrupted), None)
    while waiting:
        node = waiting.popleft()
        switched = [b for b in node.branch.bifurcations if b.kind in _SWITCHED]
        known = _shared(node)
        span = _span(node.branch)
        for number, item in enumerate(switched):
            if any(end.same_place(item, span, beside) for end, beside in known):
                continue
            full = full or count >= most
            if full or interruption is not None or node.depth >= depth:
                node.left.append(item)
                continue
            if told.report is not None:
                where = f"{item.kind} {item.parameter(item.parameter_name):.6g}"
                options["progress"] = told.of(number, len(switched), where)
            try:
                branch = _switched(node, item, options, keeper)
            except (ConvergenceError, InputError) as failure:
                node.failures.append((item, str(failure)))
                continue
            except KeyboardInterrupt as cause:
                node.left.append(item)
                interruption = Interruption.of(cause)
                continue
            child = DiagramBranch(branch, item, node.depth + 1, count, met=node.branch.bifurcations["BP"])
            count += 1
            node.children.append(child)
            waiting.append(child)
            known += _shared(child)
            interruption = branch.interruption
    left = [(node, item) for node in root for item in node.left]
    if full or interruption is not None:
        why = f"max_branches={most} reached" if full else interruption
        return f"{why}: {len(left)} bifurcations were not switched at (see node.left)", interruption
    if left:
        why = f"depth={depth} reached: {len(left)} bifurcations of the deepest branches were not switched at"
        return why, None
    return "", None


def _switched(node: DiagramBranch, item: Bifurcation, options: dict[str, Any], keeper: Keeper | None) -> Branch:
    """The branch that leaves another at a bifurcation, from the keeper if that knows it."""
    if keeper is None:
        return switch_branch(item, **options)
    event = next(i for i, other in enumerate(events_met(node.branch)) if other is item)
    branch = keeper.known(node.number, event)
    if branch is None:
        branch = switch_branch(item, **options)
        if not branch.interrupted:
            keeper.keep(node.number, event, branch)
    return branch


def _shared(node: DiagramBranch) -> list[tuple[Junction, PeriodicOrbit]]:
    """Where a branch meets its parent, with the motion there: there is nothing new to switch to for either."""
    branch, origin = node.branch, node.origin
    found = branch.junctions
    if origin is not None and origin.kind == "BP":
        # a branch that crosses its parent lists the points where it does, among others
        crossed = [(Junction.of(b), b.orbit) for b in branch.bifurcations["BP"]]
        found += [(j, here) for j, here in crossed if any(j.same_place(b, _span(branch), here) for b in node.met)]
    return found


def _span(branch: Branch) -> float:
    first, last = branch.options["bounds"][branch.name]
    return abs(last - first)


class _Told:
    """Progress of a diagram from that of its branches."""

    def __init__(self, report: Callable[[float, str], None] | None) -> None:
        self.report = report

    def of(self, number: int, count: int, title: str) -> Callable[[float, str], None]:
        """The `progress=` of one branch."""
        report = self.report

        def said(share: float, where: str) -> None:
            if report is not None:
                report((number + share) / count, f"{title}, {where}")

        return said
