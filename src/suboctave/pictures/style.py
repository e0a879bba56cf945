"""How things look: one palette that colour-blind readers can tell apart, one marker for each kind of bifurcation.

The colours are those of Okabe and Ito (*Color Universal Design*, 2008). Shape carries the kind on its own, so that
a black-and-white print loses nothing: circles for limit points and triangles for period doublings, as in Alcorta
et al. (Nonlinear Dynamics 98, 2019, Figs 6 and 7), squares for Neimark-Sacker, diamonds for branch points. Grazing
contacts, which need not change the response, are crosses beneath the others.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CURVE_COLOURS", "INK", "KINDS", "STABLE_DASH", "UNSTABLE_DASH", "KindStyle", "kind_style"]

INK = "#1a1a1a"
GRID = "#d9d9d9"
CURVE_COLOURS = ("#0072B2", "#E69F00", INK, "#009E73", "#CC79A7", "#56B4E9")  # then again from the first

STABLE_DASH = "solid"
UNSTABLE_DASH = (0, (3.2, 1.6))  # in line widths: begins with a dash, so the change shows where it happens

LINE_WIDTH = 1.5
MARKER_SIZE = 6.5
SMALL, NORMAL, LARGE = 9.0, 10.0, 11.0  # font sizes in points


@dataclass(frozen=True)
class KindStyle:
    """How one kind of bifurcation is marked, and what it is called in a legend."""

    name: str
    marker: str
    colour: str
    size: float = MARKER_SIZE


KINDS = {
    "LP": KindStyle("limit point", "o", "#ffffff"),
    "PD": KindStyle("period doubling", "v", "#D55E00", MARKER_SIZE * 1.12),
    "NS": KindStyle("Neimark–Sacker", "s", "#009E73", MARKER_SIZE * 0.92),
    "BP": KindStyle("branch point", "D", "#F0E442", MARKER_SIZE * 0.88),
    "grazing": KindStyle("grazing contact", "x", INK, MARKER_SIZE * 1.4),
}


def kind_style(kind: str) -> KindStyle:
    """The style of a kind; one that is not in the table (a user's own event) gets a star and its own name."""
    return KINDS.get(kind, KindStyle(kind, "*", "#CC79A7", MARKER_SIZE * 1.4))
