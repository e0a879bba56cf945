"""Results as datasets and back, each by the codec of its class: what `save`, `load` and journals use.

A codec says how one class is written as datasets, the one named "" first, and read again. It is registered beside the
class; nothing here knows one. The attribute `contents` of the first dataset names the codec.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suboctave.arguments import checked
from suboctave.atomic import free_place
from suboctave.errors import InputError
from suboctave.harmonic.linear_part import LinearPart
from suboctave.interruption import Interruption
from suboctave.store import files
from suboctave.version import __version__

if TYPE_CHECKING:
    import xarray


Datasets = Mapping[str, "xarray.Dataset"]


@dataclass(frozen=True)
class Codec:
    """How the results of one class are written and read.

    `contents`: what files call them; `made`: the class, and what derives from it without a codec of its own; `write`:
    from a result to its datasets, the one named "" first; `read`: from datasets, whether the modules of a user's own
    laws may be imported, and the linear part of the computation, to the result.
    """

    contents: str
    made: type
    write: Callable[[Any], dict[str, xarray.Dataset]]
    read: Callable[[Datasets, bool, LinearPart | None], Any]


#: by what files call their contents
CODECS: dict[str, Codec] = {}


def register(codec: Codec) -> None:
    """Make a codec known."""
    CODECS[codec.contents] = codec


def to_datasets(item: Any, details: Mapping[str, Any] | None = None) -> dict[str, xarray.Dataset]:
    """A result as datasets that a file or a journal can hold, `details` among the attributes of the one named "".

    Raises InputError where its class has no codec.
    """
    by_class = {codec.made: codec for codec in CODECS.values()}
    codec = next((by_class[cls] for cls in type(item).__mro__ if cls in by_class), None)
    if codec is None:
        raise InputError(f"{type(item).__name__} cannot be written to a file")
    (first, head), *parts = codec.write(item).items()
    return {first: head.assign_attrs({**(details or {}), "contents": codec.contents}), **dict(parts)}


def from_datasets(
    groups: Datasets, allow_code: bool = False, linear: LinearPart | None = None
) -> tuple[Any, dict[str, Any]]:
    """The result that `to_datasets` wrote, and the attributes of the dataset named ""; InputError where it is none."""
    details = {str(name): value for name, value in groups[""].attrs.items()}
    codec = CODECS.get(str(details.get("contents")))
    if codec is None:
        raise InputError(f"a part of the file holds {details.get('contents')!r}, which this version does not know")
    try:
        return codec.read(groups, allow_code, linear), details
    except InputError:  # which is a ValueError
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, StopIteration) as error:
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"what is stored as {codec.contents!r} cannot be read: {reason}") from None


def parts_of(groups: Datasets, names: Iterable[str], whole: str) -> dict[str, xarray.Dataset]:
    """The datasets of these names; InputError where one is missing, `whole` being what it is a part of."""
    wanted = list(names)
    if missing := [name for name in wanted if name not in groups]:
        raise InputError(f"{missing[0]} of the {whole} is missing")
    return {name: groups[name] for name in wanted}


@checked(result=True)
class Stored:
    """A result that has a codec."""

    #: how long it took; nan where nobody measured
    seconds: float = float("nan")
    #: what stopped it before its end, Ctrl-C or a time limit (`seconds`); None if nothing did
    interruption: Interruption | None = None

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C or a time limit stopped it; what had been computed is there."""
        return self.interruption is not None

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """All of it as a NetCDF file (.nc), which `load` gives back bit for bit (layout: docs/results.md).

        Raises
        ------
        InputError
            If the file exists and `overwrite` is not given, or cannot be written there.
        """
        target = free_place(path, overwrite, (".nc",))
        files.write(target, to_datasets(self), provenance())
        return target


def provenance() -> dict[str, str]:
    """Origin of a file: version, interpreter, platform, time."""
    return {
        "suboctave": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "platform": platform.platform(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }
