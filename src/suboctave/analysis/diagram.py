"""The response with all branches that bifurcate from it, each once: `bifurcation_diagram`.

A response curve is followed, then the branches that leave it at its period doublings and branch points, then those that
leave these, as deep as asked. A branch that meets its parent at another bifurcation is not followed back from there.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any

from suboctave.analysis.branch import Branch
from suboctave.analysis.checks import is_number
from suboctave.analysis.junction import Junction, period_name
from suboctave.analysis.making import Harmonics
from suboctave.analysis.progress import reporting, timed
from suboctave.analysis.switching import switch_branch
from suboctave.analysis.verbs import frequency_response
from suboctave.bifurcation import Bifurcation
from suboctave.bifurcation.formulation import Formulation
from suboctave.continuation import Event, NewtonOptions, SteppingOptions
from suboctave.errors import ConvergenceError, InputError
from suboctave.model.system import System
from suboctave.stability import StabilityMethod

if TYPE_CHECKING:
    import pandas

__all__ = ["BifurcationDiagram", "DiagramBranch", "bifurcation_diagram"]

#: kinds at which other branches leave
_SWITCHED = ("PD", "BP")


@dataclass(eq=False)
class DiagramBranch:
    """A branch of a diagram with those that leave it.

    Attributes
    ----------
    branch
        The curve.
    origin
        The bifurcation of the parent that it leaves at; None for the response itself.
    depth
        0 for the response, 1 for what leaves it, ...
    children
        The branches that leave it, in the order in which it meets them.
    failures
        Bifurcations whose other branch could not be followed, and why.
    left
        Bifurcations that were not switched at, since the depth or the budget was reached.
    met
        The parent's branch points, some of which it may pass through.
    """

    branch: Branch
    origin: Bifurcation | None = None
    depth: int = 0
    children: list[DiagramBranch] = field(default_factory=list)
    failures: list[tuple[Bifurcation, str]] = field(default_factory=list)
    left: list[Bifurcation] = field(default_factory=list)
    met: list[Bifurcation] = field(default_factory=list, repr=False)

    def __iter__(self) -> Iterator[DiagramBranch]:
        """This one and all below it, parents first."""
        yield self
        for child in self.children:
            yield from child

    @property
    def label(self) -> str:
        """Its period and where it begins and ends: "2T, PD 3.993452 to PD 2.303153"."""
        branch = self.branch
        text = period_name(branch.nu)
        name = branch.name
        ends = [
            f"{j.kind} {j.parameter:.7g}" if j is not None else f"{name} {branch.parameter(name)[i]:.7g}"
            for j, i in ((branch.departs, 0), (branch.arrives, -1))
        ]
        if branch.closed:
            origin = self.origin
            through = "" if origin is None else f" through {origin.kind} {origin.parameter(name):.7g}"
            return f"{text}, closed{through}"
        return f"{text}, {ends[0]} to {ends[1]}"


class BifurcationDiagram:
    """A response and the branches that bifurcate from it, as a tree; print it to see all of it.

    Attributes
    ----------
    root
        The response, with `children` at every level (`DiagramBranch`).
    stopped
        Why not all branches were followed, in words; empty if they were.
    seconds
        How long it took.
    """

    def __init__(self, root: DiagramBranch, stopped: str = "") -> None:
        self.root = root
        self.stopped = stopped
        self.seconds = float("nan")

    def __iter__(self) -> Iterator[DiagramBranch]:
        """Every branch with its place in the tree, parents first."""
        return iter(self.root)

    def __len__(self) -> int:
        return sum(1 for _ in self.root)

    @property
    def system(self) -> System:
        """What vibrates."""
        return self.root.branch.system

    @property
    def branches(self) -> list[Branch]:
        """All curves, parents first."""
        return [node.branch for node in self]

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """All located bifurcations, branch by branch."""
        return [item for branch in self.branches for item in branch.bifurcations]

    def of_period(self, nu: int) -> list[Branch]:
        """The branches of motions of `nu` load periods."""
        return [branch for branch in self.branches if branch.nu == nu]

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per bifurcation: the branch it lies on, kind, place, amplitude."""
        import pandas as pd

        frames = []
        for number, node in enumerate(self):
            frame = node.branch.bifurcations_frame()
            frame.insert(0, "depth", node.depth)
            frame.insert(0, "nu", node.branch.nu)
            frame.insert(0, "branch", number)
            frames.append(frame)
        return pd.concat([f for f in frames if len(f)] or frames[:1], ignore_index=True)

    def plot(self, path: Any = None, **options: Any) -> Any:
        """Draw all branches, periods in their own colours; options are those of `suboctave.plot`."""
        from suboctave.pictures import plot

        return plot(self.branches, path, **options)

    def __repr__(self) -> str:
        lines = [f"Bifurcation diagram: {len(self)} branches, along {self.root.branch.name}"]
        lines += _drawn(self.root, "", "")
        if self.stopped:
            lines.append(self.stopped)
        return "\n".join(lines)


def _drawn(node: DiagramBranch, first: str, rest: str) -> list[str]:
    """The lines of a branch and those below it."""
    branch = node.branch
    counts = Counter(item.kind for item in branch.bifurcations)
    shown = ", ".join(
        f"{kind} " + " ".join(f"{b.parameter(branch.name):.6g}" for b in branch.bifurcations[kind]) for kind in counts
    )
    unstable = int((~branch.stable).sum())
    lines = [f"{first}{node.label}: {len(branch)} points, {unstable} unstable" + (f"; {shown}" if shown else "")]
    entries: list[Any] = [*node.children, *node.failures]
    for number, entry in enumerate(entries):
        last = number == len(entries) - 1
        head, tail = ("└─ ", "   ") if last else ("├─ ", "│  ")
        if isinstance(entry, DiagramBranch):
            lines += _drawn(entry, rest + head, rest + tail)
        else:
            item, why = entry
            lines.append(f"{rest}{head}{item.kind} {item.parameter(branch.name):.6g} not followed: {why}")
    return lines


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
) -> BifurcationDiagram:
    """The response over a range of frequencies with all branches that bifurcate from it, each once.

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
        Time after which no new branch is begun; None for as long as it takes.

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
    if seconds is not None and not (is_number(seconds) and seconds > 0.0):
        raise InputError(f"seconds must be a positive number, not {seconds!r}")
    begin = perf_counter()
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
        first = frequency_response(system, omega, harmonics, start=start, **options)
        root = DiagramBranch(first)
        stopped = _grown(root, depth, max_branches, seconds, begin, options, told)
    return BifurcationDiagram(root, stopped)


def _grown(
    root: DiagramBranch,
    depth: int,
    most: int,
    seconds: float | None,
    begin: float,
    options: dict[str, Any],
    told: _Told,
) -> str:
    """Follow what leaves the branches, level by level; why that ended early, in words."""
    waiting = deque([root])
    count, out_of = 1, ""
    if root.branch.ended.startswith("interrupted"):
        out_of = "interrupted"
    while waiting:
        node = waiting.popleft()
        switched = [b for b in node.branch.bifurcations if b.kind in _SWITCHED]
        known = _shared(node)
        span = _span(node.branch)
        for number, item in enumerate(switched):
            if any(end.same_place(item, span) for end in known):
                continue
            if not out_of and count >= most:
                out_of = f"max_branches={most} reached"
            if not out_of and seconds is not None and perf_counter() - begin > seconds:
                out_of = f"{seconds:g} seconds are over"
            if out_of or node.depth >= depth:
                node.left.append(item)
                continue
            if told.report is not None:
                where = f"{item.kind} {item.parameter(item.parameter_name):.6g}"
                options["progress"] = told.of(number, len(switched), where)
            try:
                branch = switch_branch(item, **options)
            except (ConvergenceError, InputError) as failure:
                node.failures.append((item, str(failure)))
                continue
            except KeyboardInterrupt:
                node.left.append(item)
                out_of = "interrupted"
                continue
            count += 1
            child = DiagramBranch(branch, item, node.depth + 1, met=node.branch.bifurcations["BP"])
            node.children.append(child)
            waiting.append(child)
            known += _shared(child)
            if branch.ended.startswith("interrupted"):
                out_of = "interrupted"
    left = [(node, item) for node in root for item in node.left]
    if out_of:
        return f"{out_of}: {len(left)} bifurcations were not switched at (see node.left)"
    if left:
        return f"depth={depth} reached: {len(left)} bifurcations of the deepest branches were not switched at"
    return ""


def _shared(node: DiagramBranch) -> list[Junction]:
    """Where a branch meets its parent: there is nothing new to switch to for either."""
    branch, origin = node.branch, node.origin
    found = [j for j in (branch.arrives, branch.departs) if j is not None]
    if origin is not None and origin.kind == "BP":
        # a branch that crosses its parent lists the points where it does, among others
        crossed = [Junction.of(b) for b in branch.bifurcations["BP"]]
        found += [j for j in crossed if any(j.same_place(b, _span(branch)) for b in node.met)]
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
