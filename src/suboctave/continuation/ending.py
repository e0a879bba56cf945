"""Why a curve ends where it does: a reason that decides what follows, and the sentence that is printed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from suboctave.interruption import Interruption


class EndReason(StrEnum):
    """Why a curve ends at one of its two ends; files hold the values."""

    START = "start"  # it was followed from here, into the other direction only
    NOT_STARTED = "not started"
    RANGE_END = "range end"
    LEFT_RANGE = "left range"
    CLOSED = "closed"
    MET_BRANCH = "met branch"
    MOTIONS_END = "motions end"  # the motions that it consists of do not exist beyond
    NOT_FINITE = "not finite"  # the equations are not finite beyond
    STEP_TOO_SMALL = "step too small"
    MAX_POINTS = "max points"
    ASTRAY = "astray"  # it goes round and round without passing its start
    RETRACED = "retraced"  # it came back along itself
    FAILED = "failed"  # something of a point could not be computed
    NO_MEANING = "no meaning"  # what it consists of can no longer be told from other motions
    CUT = "cut"  # a part of a longer curve
    INTERRUPTED = "interrupted"
    TIME_LIMIT = "time limit"
    FUNCTION_FAILED = "function failed"  # a user's
    OTHER = "other"


#: those after which there may be more of the curve
_EARLY = {
    EndReason.NOT_STARTED,
    EndReason.LEFT_RANGE,
    EndReason.STEP_TOO_SMALL,
    EndReason.MAX_POINTS,
    EndReason.ASTRAY,
    EndReason.RETRACED,
    EndReason.FAILED,
    EndReason.NO_MEANING,
    EndReason.INTERRUPTED,
    EndReason.TIME_LIMIT,
    EndReason.FUNCTION_FAILED,
}

#: the sentences, from the place, the details and the seconds; where there is none here the details are the sentence
_SENTENCES = {
    EndReason.START: "",
    EndReason.NOT_STARTED: "not started",
    EndReason.RANGE_END: "reached the end of the range at {where}",
    EndReason.LEFT_RANGE: "left the range after {where}, without a solution on its end. Move the bound a little",
    EndReason.CLOSED: "the curve closed on itself",
    EndReason.NOT_FINITE: "the motions end at {where}: beyond it {detail}",
    EndReason.STEP_TOO_SMALL: (
        "step size fell below {detail}. Try more harmonics, a smoother law, or a smaller min_step"
    ),
    EndReason.MAX_POINTS: "{detail} points computed at {where}. Raise max_points to go on",
    EndReason.ASTRAY: (
        "came back to {where} without passing its start: it jumped to a neighbouring branch. Try a smaller max_step"
    ),
    EndReason.RETRACED: (
        "retraced itself back to {where}: a turn is sharper than its steps or its harmonics resolve. Try more "
        "harmonics, or a smaller max_step"
    ),
    EndReason.FAILED: "what follows {where} could not be computed: {detail}; what was computed is kept",
    EndReason.INTERRUPTED: "interrupted at {where}; what was computed is kept",
    EndReason.FUNCTION_FAILED: "beyond {where}: {detail}; what was computed is kept",
    EndReason.TIME_LIMIT: "the time limit of {seconds:g} s was reached at {where}; what was computed is kept",
}


@dataclass(frozen=True)
class Ending:
    """Why a curve ends: the reason, the place in words, what else is to be said; `seconds` of a time limit."""

    reason: EndReason
    where: str = ""
    detail: str = ""
    seconds: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", EndReason(self.reason))  # files hold its value

    @classmethod
    def stopped(cls, interruption: Interruption, where: str) -> Ending:
        """Where an interruption found a curve."""
        if interruption.failure:
            return cls(EndReason.FUNCTION_FAILED, where, interruption.failure)
        reason = EndReason.INTERRUPTED if interruption.seconds is None else EndReason.TIME_LIMIT
        return cls(reason, where, seconds=interruption.seconds)

    @property
    def early(self) -> bool:
        """Whether the curve would go on: it was stopped, or could not be followed further."""
        return self.reason in _EARLY

    @property
    def interruption(self) -> Interruption | None:
        """What stopped the curve before its end; None where it came to one."""
        if self.reason in (EndReason.INTERRUPTED, EndReason.TIME_LIMIT):
            return Interruption(self.seconds)
        if self.reason is EndReason.FUNCTION_FAILED:
            return Interruption(failure=f"beyond {self.where}: {self.detail}")
        return None

    def __str__(self) -> str:
        words = _SENTENCES.get(self.reason, "{detail}")
        return words.format(where=self.where, detail=self.detail, seconds=self.seconds or 0.0)


#: what goes on with a response that a time limit stopped
_GO_ON = ", or go on from curve.orbits[{}] with so.continue_branch(...)"


def sentence(endings: Sequence[Ending], go_on: str = _GO_ON) -> str:
    """Why a curve ends, at its one end or at both (first, last); after a time limit with what goes on from there."""
    sentences = list(dict.fromkeys(str(ending) for ending in endings if ending.reason is not EndReason.START))
    text = " in one direction, ".join(sentences) + (" in the other" if len(sentences) > 1 else "")
    late = [at for at, ending in zip((0, -1), endings, strict=False) if ending.reason is EndReason.TIME_LIMIT]
    return text + (f". Give more seconds={go_on.format(late[-1])}" if late else "")


def interruption_of(endings: Sequence[Ending]) -> Interruption | None:
    """What stopped a curve in one of its directions; None where it came to its ends."""
    return next((stop for ending in endings if (stop := ending.interruption) is not None), None)


def read_endings(text: str) -> tuple[Ending, ...]:
    """The endings that a sentence tells: for files that hold nothing else."""
    both = re.fullmatch(r"(.*) in one direction, (.*) in the other", text, re.DOTALL)
    return tuple(_read(part) for part in (both.groups() if both else (text,)))


def _read(text: str) -> Ending:
    for reason, words in _SENTENCES.items():
        pattern = re.escape(words)
        for name in ("where", "detail"):
            pattern = pattern.replace(re.escape(f"{{{name}}}"), f"(?P<{name}>.*)")
        match = re.fullmatch(pattern, text, re.DOTALL)
        if match:
            named = match.groupdict(default="")
            return Ending(reason, named.get("where", ""), named.get("detail", ""))
    return Ending(EndReason.OTHER, detail=text)
