"""Third derivatives of a force along a motion, as weights at instants: see `harmonic.bends`."""

from __future__ import annotations

from dataclasses import dataclass

from suboctave.harmonic.basis import Array


@dataclass(frozen=True)
class Third:
    """W and V (Q, Q, Q, N) at instants `z = exp(i tau)`; V is None where there is no corner."""

    zr: Array
    zi: Array
    weights: Array
    slopes: Array | None
