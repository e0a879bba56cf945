"""The response with all branches that bifurcate from it, each once: `bifurcation_diagram`.

A response curve is followed (and if it folds back and leaves the range where it began, that from the other end, too),
then the branches that leave it at its period doublings and branch points, then those that leave these, as deep as
asked. A branch that meets its parent at another bifurcation is not followed back from there.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, Unpack

from suboctave.analysis.branches import frequency_response, switch_branch
from suboctave.analysis.options import CurveOptions, SearchOptions, handed_on
from suboctave.arguments import Range
from suboctave.bifurcation.bifurcation import Bifurcation
from suboctave.curves.junction import Junction
from suboctave.curves.starts import Harmonics
from suboctave.errors import ConvergenceError, InputError
from suboctave.harmonic.orbit import PeriodicOrbit
from suboctave.interruption import Interruption
from suboctave.model.inputs import check_count, timed
from suboctave.model.system import System
from suboctave.options import with_options
from suboctave.progress import PartOf, Report, reporting
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram, DiagramBranch
from suboctave.store.layout import events_met

#: kinds at which other branches leave
_SWITCHED = ("PD", "BP")
#: number of the response from the other end for whoever keeps branches
_OTHER_END = -2


class Keeper(Protocol):
    """Storage of branches, with those of a run that was stopped.

    The key of a branch is the number of its parent and the index of the bifurcation that it leaves at among
    `events_met(parent)`; of the response -1 and -1, of that from the other end, which has the number -2 while branches
    are followed, -2 and -1.
    """

    def known(self, parent: int, event: int) -> Branch | None:
        """The branch, if an earlier run has kept it."""
        ...

    def keep(self, parent: int, event: int, branch: Branch) -> None:
        """A branch that has been followed to its end."""
        ...


@dataclass(frozen=True)
class Followed:
    """Which branches of a diagram are followed: those so many bifurcations deep, of whatever kind, or those of
    motions of up to so many load periods.

    In the second case branch points, where motions of the same period leave, are counted apart: on the way to a branch
    there may be as many as period doublings, and one in any case.
    """

    depth: int | None = None
    longest: int = 1

    def __call__(self, node: DiagramBranch, item: Bifurcation) -> bool:
        """Whether the branch that leaves another at a bifurcation is."""
        if self.depth is not None:
            return node.depth < self.depth
        if item.kind == "PD":
            return 2 * node.branch.nu <= self.longest
        return node.crossings < max(1, self.longest.bit_length() - 1)

    def __str__(self) -> str:
        return f"{self.longest} load periods" if self.depth is None else f"depth={self.depth}"


@with_options(CurveOptions)
@timed
def bifurcation_diagram(
    system: System,
    omega: Range,
    *,
    depth: int = 2,
    harmonics: Harmonics = "adaptive",
    max_branches: int = 32,
    start: Any = None,
    keeper: Keeper | None = None,
    **options: Unpack[CurveOptions],
) -> BifurcationDiagram:
    """The response over a range of frequencies with all branches that bifurcate from it, each once.

    Where it folds back and leaves the range at the end at which it began, the response from the other end is followed,
    too (unless `start` chooses a motion): branch 1, beside branch 0, with no bifurcation as its origin.

    Parameters
    ----------
    system, omega, harmonics, start
        As in `frequency_response`.
    depth
        How many bifurcations deep: 0 the response alone, 1 the branches that leave it, 2 those that leave these (along
        a cascade of period doublings 1 gives 2T, 2 gives 4T, ...).
    max_branches
        Branches after which no more are followed.
    keeper
        Keeps branches as they are computed, and knows those of an earlier run with the same arguments.

    What depth or budget left out is listed: `node.left` at every branch, and `stopped` in words. Ctrl-C or a time limit
    end it with the branches that are known.

    Raises
    ------
    InputError, ConvergenceError
        As `frequency_response`. A branch that cannot be followed does not end the diagram: it is listed as not
        followed.
    """
    depth, max_branches = check_count("depth", depth, 0), check_count("max_branches", max_branches)
    with reporting(options.get("progress"), "bifurcation diagram") as report:
        growth = _Growth(handed_on(options), Followed(depth), max_branches, report, keeper)
        return growth.diagram(system, omega, harmonics, start)


def diagram_of(
    system: System, omega: tuple[float, float], harmonics: Harmonics, followed: Followed, options: SearchOptions
) -> BifurcationDiagram:
    """As `bifurcation_diagram`, with another rule for the branches that are followed."""
    return _Growth(options, followed).diagram(system, omega, harmonics)


def grown_from(branch: Branch, followed: Followed, options: SearchOptions) -> BifurcationDiagram:
    """A branch that is known with what bifurcates from it."""
    root = DiagramBranch(branch)
    stopped, interruption = _Growth(options, followed).grown(root)
    return BifurcationDiagram(root, stopped, interruption)


@dataclass
class _Growth:
    """How the branches of a diagram are followed: options of the verbs, which and how many, progress, and a keeper."""

    options: SearchOptions
    followed: Followed
    most: int = sys.maxsize
    report: Report | None = None
    keeper: Keeper | None = None

    def _reporting(self, number: int, count: int, title: str) -> SearchOptions:
        """The options of one of `count` branches, whose progress is a part of the diagram's."""
        report = self.report
        if report is None:
            return self.options
        return {**self.options, "progress": PartOf(report, number, count, title)}

    def _kept(self, parent: int, event: int, follow: Callable[[], Branch]) -> Branch:
        """A branch from the keeper if that knows it, else followed now."""
        branch = None if self.keeper is None else self.keeper.known(parent, event)
        if branch is None:
            branch = follow()
            if self.keeper is not None and not branch.interrupted:
                self.keeper.keep(parent, event, branch)
        return branch

    def diagram(
        self, system: System, omega: tuple[float, float], harmonics: Harmonics, start: Any = None
    ) -> BifurcationDiagram:
        """The response, that from the other end if it is another one, and what bifurcates from them."""

        def response(number: int, ends: tuple[float, float], title: str) -> Branch:
            options = self._reporting(0, 1, title)
            return self._kept(
                number, -1, lambda: frequency_response(system, ends, harmonics=harmonics, start=start, **options)
            )

        first = response(-1, omega, "T")
        root = DiagramBranch(first)
        failure = ""
        # one that folds back and leaves the range where it began: the other end lies on another one
        whole = first.closed or first.interrupted or len(first) < 2
        if start is None and not whole and float(first.omega[-1]) == omega[0]:
            try:
                other = response(_OTHER_END, (omega[1], omega[0]), "T from the other end")
                root.children.append(DiagramBranch(other, number=_OTHER_END))
            except ConvergenceError as why:
                failure = f"the response from the other end was not found: {why}"
        stopped, interruption = self.grown(root)
        return BifurcationDiagram(root, "; ".join(reason for reason in (stopped, failure) if reason), interruption)

    def grown(self, root: DiagramBranch) -> tuple[str, Interruption | None]:
        """Follow what leaves the branches, level by level; why that ended early, in words, and what interrupted it."""
        count, full = 1, False
        interruption = next((node.branch.interruption for node in root if node.branch.interrupted), None)
        waiting = deque(root)
        while waiting:
            node = waiting.popleft()
            switched = [b for b in node.branch.bifurcations if b.kind in _SWITCHED]
            known = _shared(node)
            span = span_of(node.branch)
            for number, item in enumerate(switched):
                met = next((place for place in known if place[0].same_place(item, span, place[1])), None)
                if met is not None:
                    if item.multiplicity > 1:
                        # a branch uses up one of those that fall together
                        known = [place for place in known if place is not met]
                    continue
                full = full or count >= self.most
                if full or interruption is not None or not self.followed(node, item):
                    node.left.append(item)
                    continue
                title = f"{item.kind} {item.parameter(item.parameter_name):.6g}"
                try:
                    options = self._reporting(number, len(switched), title)
                    event = next(i for i, b in enumerate(events_met(node.branch)) if b is item) if self.keeper else -1
                    branch = self._kept(node.number, event, partial(switch_branch, item, **options))
                except (ConvergenceError, InputError) as failure:
                    node.failures.append((item, str(failure)))
                    continue
                except KeyboardInterrupt as cause:
                    node.left.append(item)
                    interruption = Interruption.of(cause)
                    continue
                crossings = node.crossings + (item.kind == "BP")
                points = node.branch.bifurcations["BP"]
                child = DiagramBranch(branch, item, node.depth + 1, count, met=points, crossings=crossings)
                count += 1
                node.children.append(child)
                waiting.append(child)
                # where it has left, others that fall together with it leave as well
                several = item.multiplicity > 1
                known += [
                    place for place in _shared(child) if not (several and place[0].same_place(item, span, place[1]))
                ]
                interruption = branch.interruption
        left = sum(len(node.left) for node in root)
        if full or interruption is not None:
            why = f"max_branches={self.most} reached" if full else interruption
            return f"{why}: {left} bifurcations were not switched at (see node.left)", interruption
        if left:
            return f"{self.followed} reached: {left} bifurcations of the deepest branches were not switched at", None
        return "", None


def _shared(node: DiagramBranch) -> list[tuple[Junction, PeriodicOrbit]]:
    """Where a branch meets its parent, with the motion there: there is nothing new to switch to for either."""
    branch, origin = node.branch, node.origin
    shared = branch.junctions
    if origin is not None and origin.kind == "BP":
        # a branch that crosses its parent lists the points where it does, among others
        crossed = [(Junction.of(b), b.orbit) for b in branch.bifurcations["BP"]]
        shared += [(j, here) for j, here in crossed if any(j.same_place(b, span_of(branch), here) for b in node.met)]
    return shared


def span_of(branch: Branch) -> float:
    """Width of the range in which a branch was followed."""
    first, last = branch.options["bounds"][branch.name]
    return abs(last - first)
