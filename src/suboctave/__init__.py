"""Vibrating structures with nonlinear parts, in the frequency domain.

How does the structure respond, which of those responses are stable, where does the response double its period, split,
jump or go quasi-periodic? The method is harmonic balance with numerical continuation.

    import suboctave as so

    system = so.library.reference_oscillator(p=0.55, j=0.0)
    curve = so.frequency_response(system, omega=(4.5, 1.3))
    print(curve.bifurcations)

The public names are listed in `__init__.pyi`. They are loaded when they are first used, so that importing the package
costs next to nothing.
"""

from __future__ import annotations

from suboctave.frontdoor import attached
from suboctave.version import __version__ as __version__

__getattr__, __dir__, __all__ = attached(__name__, __file__)
