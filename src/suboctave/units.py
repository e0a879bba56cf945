"""Units that a system declares: names for axes and tables, and a check that they fit each other. Nothing is converted.

The equations hold in any consistent units, those in which the unit of force is that of mass times length over time
squared: of mm, N, s the mass is in t.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from suboctave.errors import InputError, shortened, suggest

#: units by what they measure, in those of the SI
_KNOWN: Mapping[str, Mapping[str, float]] = {
    "length": {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048},
    "mass": {
        "kg": 1.0, "t": 1e3, "g": 1e-3, "mg": 1e-6, "µg": 1e-9, "lb": 0.45359237,
        "slug": 4.4482216152605 / 0.3048, "slinch": 4.4482216152605 / 0.0254,
    },
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "µN": 1e-6, "nN": 1e-9, "dyn": 1e-5, "lbf": 4.4482216152605},
    "time": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
}  # fmt: skip
_MEANS = {unit: kind for kind, units in _KNOWN.items() for unit in units}
#: other spellings
_SPELT = {"um": "µm", "us": "µs", "uN": "µN", "ug": "µg", "sec": "s", "inch": "in", "\u03bcm": "µm", "\u03bcs": "µs"}
#: turns per unit of time
_CYCLES = {"s": "Hz", "ms": "kHz", "µs": "MHz", "ns": "GHz"}
#: relative difference of a force from mass times length over time squared up to which they are the same unit
_SAME = 1e-6
_EXAMPLE = '"mm, N, s"'


@dataclass(frozen=True)
class UnitSystem:
    """Units of length, force and time, and of mass, which follows from these."""

    length: str
    force: str
    time: str
    mass: str

    @classmethod
    def of(cls, given: Any) -> UnitSystem | None:
        """Units given as text, `"mm, N, s"`: length and time, and force or mass, or both; None for an empty text.

        Raises InputError for units that are not known, missing, or do not fit each other.
        """
        if given is None or isinstance(given, UnitSystem):
            return given
        if not isinstance(given, str):
            raise InputError(f"units are a text such as {_EXAMPLE}, not {shortened(given)}", ("units",))
        found: dict[str, str] = {}
        for word in filter(None, re.split(r"[,;\s]+", given)):
            unit = _SPELT.get(word, word)
            if unit not in _MEANS:
                raise InputError(f"units: {word!r} is no unit known here{suggest(unit, _MEANS)}", ("units",))
            kind = _MEANS[unit]
            if kind in found:
                raise InputError(f"units: {found[kind]} and {unit} are both units of {kind}; give one", ("units",))
            found[kind] = unit
        return cls._completed(found) if found else None

    @classmethod
    def _completed(cls, found: dict[str, str]) -> UnitSystem:
        missing = [kind for kind in ("length", "time") if kind not in found]
        missing += ["force or mass"] if "force" not in found and "mass" not in found else []
        if missing:
            raise InputError(f"units: no unit of {' and of '.join(missing)}; for example {_EXAMPLE}", ("units",))
        length, time = found["length"], found["time"]
        # force over mass
        acceleration = _KNOWN["length"][length] / _KNOWN["time"][time] ** 2
        if "force" not in found:
            force = _KNOWN["mass"][found["mass"]] * acceleration
            found["force"] = _named("force", force) or f"{found['mass']} {length}/{time}²"
        mass = _KNOWN["force"].get(found["force"], math.nan) / acceleration
        derived = _named("mass", mass) or f"{found['force']} {time}²/{length}"
        given = found.setdefault("mass", derived)
        if mass == mass and not _alike(_KNOWN["mass"].get(given, mass), mass):
            raise InputError(
                f"units: with {length}, {found['force']}, {time} masses are in {derived}, not in {given}: in other "
                f"units the equation of motion does not hold",
                ("units",),
            )
        return cls(length, found["force"], time, given)

    def __str__(self) -> str:
        # a force without a name of its own is that of its mass
        return ", ".join((self.length, self.force if self.force in _MEANS else self.mass, self.time))

    @property
    def angular(self) -> UnitSystem:
        """The same for a degree of freedom that is an angle: rad in the place of the length."""
        return replace(self, length="rad")

    @property
    def frequency(self) -> str:
        """That of circular frequencies."""
        return f"rad/{self.time}"

    @property
    def cycles(self) -> str:
        """That of turns per time: omega over 2 pi."""
        return _CYCLES.get(self.time, f"1/{self.time}")

    def name(self, dimension: str) -> str:
        """The unit of a dimension in words of length, force, energy, mass and time: "mm/s²" of "length / time^2", empty
        of "1".
        """
        own = {**vars(self), "energy": f"{self.force} {self.length}"}
        words = re.sub(r"[a-z]+", lambda word: own.get(word[0], word[0]), dimension)
        return "" if words == "1" else words.replace("^2", "²").replace(" / ", "/").replace(" * ", " ")


def _named(kind: str, size: float) -> str:
    """The unit of this size, empty if there is none."""
    return next((unit for unit, own in _KNOWN[kind].items() if _alike(own, size)), "")


def _alike(one: float, other: float) -> bool:
    return abs(one - other) <= _SAME * abs(other)
