"""A branch from what was followed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from suboctave.continuation.linear import one_thread
from suboctave.curves.junction import Junction
from suboctave.curves.trace import Settings, Trace
from suboctave.curves.verdicts import with_verdicts
from suboctave.model.system import System
from suboctave.results.branch import Branch

__all__ = ["make_branch"]


def make_branch(system: System, name: str, trace: Trace, settings: Settings, options: dict[str, Any]) -> Branch:
    """A branch along a parameter; `options` say how it was computed (`analysis.options.options_of`)."""
    with one_thread():
        trace = with_verdicts(trace, settings.stability, name)
    context = {"system": system, "parameter": name, **options}
    bifurcations, events = (
        [replace(b, context=context) for b in items] for items in (trace.bifurcations, trace.events)
    )
    return Branch(
        system,
        name,
        trace.points,
        bifurcations,
        events,
        trace.closed,
        trace.endings,
        settings.observe,
        options,
        tuple(trace.sentences),
        trace.audit,
        None if trace.departs is None else Junction.of(trace.departs),
        None if trace.arrives is None else Junction.of(trace.arrives),
    )
