"""Ridges from a response: its highest point, followed in a second parameter (`curves.kinds.ridge`)."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from suboctave.analysis.options import TrackOptions
from suboctave.analysis.track import track
from suboctave.arguments import Range
from suboctave.curves.trace import BranchPoint
from suboctave.errors import InputError, is_number, shortened
from suboctave.harmonic.basis import Array
from suboctave.model.inputs import timed
from suboctave.options import with_options
from suboctave.results.branch import Branch, TrackedBranch


@with_options(TrackOptions)
@timed
def track_peak(
    response: Branch | BranchPoint,
    parameter: str,
    bounds: Range,
    *,
    harmonic: float | None = None,
    **options: Unpack[TrackOptions],
) -> TrackedBranch:
    """The resonance peak of a response, where the amplitude is largest along it, followed in a second parameter.

    Such curves are those of Raze, Volvert & Kerschen, Tracking amplitude extrema of nonlinear frequency responses using
    the harmonic balance method (2024). They go through limit points of the responses; other extrema of the amplitude,
    such as an antiresonance, are followed from a point beside them.

    Parameters
    ----------
    response
        A branch over omega, whose highest point is taken, or one of its `points` beside an extremum.
    parameter, bounds
        The second parameter and its range (from, to).
    harmonic
        The amplitude is that of the harmonic at this multiple of omega; by default the largest |x|.

    Raises
    ------
    InputError
        Wrong input, before any work.
    ConvergenceError
        If no extremum is found beside the point.
    """
    if harmonic is not None and not (is_number(harmonic) and harmonic > 0.0):
        raise InputError(f"harmonic must be a positive multiple of omega, not {shortened(harmonic)}")
    start: Any = response
    if isinstance(response, Branch):
        if response.name != "omega" or not len(response):
            raise InputError("the peak is that of a response over omega: give such a branch, or one of its points")
        heights = response.amplitude if harmonic is None else np.abs(response.harmonic(harmonic))
        highest = int(np.argmax(heights))
        if highest in (0, len(response) - 1) and not response.closed:
            raise InputError(_at_an_end(response, heights, highest))
        start = response.points[highest]
        if options.get("observe") is None:
            options["observe"] = response.observe
    onto: Any = "ridge" if harmonic is None else {"name": "harmonic_ridge", "harmonic": harmonic}
    return track(start, parameter, bounds, onto=onto, **options)


def _at_an_end(response: Branch, heights: Array, end: int) -> str:
    """What to do where the amplitude is largest at an end of a response."""
    peaks = [i for i in range(1, len(heights) - 1) if heights[i - 1] < heights[i] > heights[i + 1]]
    words = (
        f"the amplitude is largest at an end of the response, omega = {response.omega[end]:.6g}, which is no peak: "
        "follow it over a wider range"
    )
    if not peaks:
        return words
    best = max(peaks, key=lambda i: heights[i])
    return f"{words}, or give the point beside another peak: response.points[{best}], at {response.omega[best]:.6g}"
