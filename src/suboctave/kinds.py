"""The table of kinds: what can be met along a curve of motions, what a curve can consist of, and how both are drawn.

Everything that is the same for every kind but for a word, a number or a colour is asked of this table. A kind whose
curves can be followed names its equations, a class in `curves.kinds`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from suboctave.errors import suggest

__all__ = ["KINDS", "MOTION_KINDS", "TRACKED_KINDS", "Kind", "plane_of_curve", "suggest_kind"]

_WHITE, _INK, _GREY = "#ffffff", "#1a1a1a", "#8c8c8c"


@dataclass(frozen=True)
class Kind:
    """One row.

    words, legend
        Its name in a sentence, and in a legend where that is another one.
    marker, fill, size
        How it is marked: a marker of matplotlib (one of `pictures.browser.SYMBOLS`), its colour, and its size as a
        multiple of the usual one.
    multiplier, critical
        The multiplier on the unit circle, None where it is any or none; how many are critical.
    equations
        Of a kind that can be followed: module in `curves.kinds` and class, "module:Class".
    choices
        Of a kind that is located nowhere, whose curves begin at any motion beside them: numbers, with defaults, that
        choose the curve; None for all others.
    line, width
        Of those that can be followed: colour of the curve in a plane of two parameters, empty for that of its period;
        width as a multiple of the usual one.
    free_phase
        Whether its curves consist of motions that no load drives, all those of a system over its last parameter.
    """

    words: str
    marker: str | tuple[int, int, int]
    fill: str
    size: float = 1.0
    legend: str = ""
    multiplier: float | None = None
    critical: int = 0
    equations: str = ""
    choices: Mapping[str, float] | None = None
    line: str = ""
    width: float = 1.0
    free_phase: bool = False


#: in the order of legends
KINDS: dict[str, Kind] = {
    "LP": Kind("limit point", "o", _WHITE, multiplier=1.0, critical=1, equations="singular:SingularOperator"),
    "PD": Kind(
        "period doubling", "v", "#D55E00", 1.12, multiplier=-1.0, critical=1, equations="singular:SingularOperator",
        width=1.35,
    ),
    "NS": Kind(
        "Neimark-Sacker", "s", "#009E73", 0.92, "Neimark–Sacker", critical=2, equations="singular:SingularOperator",
        line="#009E73",
    ),
    "BP": Kind(
        "branch point", "D", "#F0E442", 0.88, multiplier=1.0, critical=1, equations="branch_point:BranchPointUnfolded",
        line="#CC79A7",
    ),
    "grazing": Kind(
        "grazing contact", "x", _INK, 1.4, equations="grazing:GrazingContactEquations", line=_GREY, width=0.8
    ),
    "phase_resonance": Kind(
        "phase resonance", "H", "#56B4E9", equations="phase_resonance:PhaseResonance", choices={"harmonic": 1.0},
        line="#D55E00",
    ),
    "ridge": Kind("ridge", (6, 1, 0), "#56B4E9", equations="ridge:Ridge", choices={}, line="#CC79A7"),
    "harmonic_ridge": Kind(
        "ridge of a harmonic", (8, 1, 0), "#56B4E9", equations="ridge:Ridge", choices={"harmonic": 1.0}, line="#CC79A7"
    ),
    "limit_cycle": Kind(
        "limit cycle", (5, 1, 180), "#56B4E9", multiplier=1.0, critical=1, equations="limit_cycle:LimitCycle",
        choices={}, line="#0072B2", free_phase=True,
    ),
    "Hopf": Kind(
        "Hopf point", (5, 0, 180), "#009E73", 0.92, critical=2, equations="singular:SingularOperator", line="#009E73"
    ),
    "nonlinear_mode": Kind(
        "nonlinear mode", (7, 1, 0), "#56B4E9", multiplier=1.0, critical=2, equations="nonlinear_mode:NonlinearMode",
        choices={}, line="#D55E00", free_phase=True,
    ),
    "extremum": Kind("extremum of a parameter along a curve of bifurcations", "d", _WHITE, 0.9, "extremum"),
    "CP": Kind("cusp", "P", "#0072B2", 1.1),
    "GPD": Kind("generalised period doubling", "h", "#E69F00", 1.12),
    "GPF": Kind("generalised pitchfork", (6, 1, 30), "#E69F00", 1.12),
    "GH": Kind("generalised Hopf point (Bautin)", (5, 1, 0), "#E69F00", 1.12),
    "R1": Kind("1:1 resonance", "<", "#56B4E9"),
    "R2": Kind("1:2 resonance", ">", "#56B4E9"),
    "R3": Kind("1:3 resonance", "p", "#56B4E9", 1.1),
    "R4": Kind("1:4 resonance", "8", "#56B4E9"),
    "LPPD": Kind("fold-flip", "X", "#CC79A7", 1.05),
    "LPNS": Kind("fold-Neimark-Sacker", (3, 1, 0), "#009E73", 1.05, "fold–Neimark–Sacker"),
    "PDNS": Kind("flip-Neimark-Sacker", (3, 1, 180), "#D55E00", 1.05, "flip–Neimark–Sacker"),
    "NSNS": Kind("double Neimark-Sacker", (4, 1, 45), "#0072B2", 1.05, "double Neimark–Sacker"),
    "isola_centre": Kind("a closed branch shrinks to a point", (4, 1, 0), "#F0E442", 1.6, "isola is born"),
    "isola_merging": Kind("a closed branch meets another branch", "^", "#F0E442", 1.15, "isola merges"),
}  # fmt: skip

#: kinds by the labels of AUTO, MatCont, BifurcationKit and COCO, and by words, in small letters
_ELSEWHERE = {
    **dict.fromkeys(("sn", "fold", "lpc", "saddle-node", "limit point"), "LP"),
    **dict.fromkeys(("flip", "period doubling"), "PD"),
    **dict.fromkeys(("tr", "torus", "neimark-sacker"), "NS"),
    **dict.fromkeys(("bpc", "pitchfork", "branch point"), "BP"),
    **dict.fromkeys(("hb", "h"), "Hopf"),
    **dict.fromkeys(("cpc", "cusp"), "CP"),
}


def suggest_kind(name: str, known: Iterable[str] = tuple(KINDS)) -> str:
    """The tail of a message on an unknown kind: what another package's label of it is called here, or the closest."""
    own = _ELSEWHERE.get(name.strip().lower())
    return f": {own!r} is what it is called here" if own in (known := list(known)) else suggest(name, known)


#: kinds that are located, and whose curves can be followed in two parameters
TRACKED_KINDS = tuple(name for name, kind in KINDS.items() if kind.equations and kind.choices is None)
#: kinds whose curves begin at any motion beside them
MOTION_KINDS = tuple(name for name, kind in KINDS.items() if kind.choices is not None)


def plane_of_curve(kind: str, names: tuple[str, ...], turning: str = "") -> tuple[str, str] | None:
    """The two parameters over which a curve of bifurcations is drawn, by its free parameters: of a curve of extrema the
    third one and the extreme one. None of motions that no load drives, which are drawn over their parameter as
    responses are, and of these.
    """
    if turning:
        return names[-1], turning
    if len(names) < 2 or KINDS[kind].free_phase:
        return None
    return names[-2], names[-1]
