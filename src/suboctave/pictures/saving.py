"""A figure to a file: the suffix says the form, and a reader never meets half a file."""

from __future__ import annotations

import io
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suboctave.errors import InputError, path_of, suggest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SUFFIXES", "png_bytes", "save_figure", "svg_text"]

SUFFIXES = (".png", ".svg", ".pdf")
# No time stamps: the same curve gives the same file.
_METADATA: dict[str, dict[str, Any]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
# Letters are part of the file: TrueType in PDF, as journals ask for, and outlines in SVG. No random names in SVG.
_EMBEDDED: dict[Any, Any] = {"pdf.fonttype": 42, "svg.fonttype": "path", "svg.hashsalt": "suboctave"}


def save_figure(figure: Figure, path: str | Path, *, dpi: float = 300.0) -> Path:
    """Writes the figure as PNG (at `dpi`), SVG or PDF, by the suffix of `path`; makes the folder where it is missing.

    Written beside its place and renamed, so that an interruption leaves what was there before.
    """
    import matplotlib

    target = path_of(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"cannot tell the form of {target.name!r} from its suffix{suggest(suffix, SUFFIXES)}")
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=suffix, dir=target.parent)
    os.close(handle)
    try:
        with matplotlib.rc_context(_EMBEDDED):
            figure.savefig(name, format=suffix[1:], dpi=dpi, metadata=_METADATA[suffix])
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return target


def png_bytes(figure: Figure, dpi: float = 110.0) -> bytes:
    """The figure as PNG in memory."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


def svg_text(figure: Figure) -> str:
    """The figure as SVG in memory."""
    import matplotlib

    buffer = io.StringIO()
    with matplotlib.rc_context(_EMBEDDED):
        figure.savefig(buffer, format="svg", metadata=_METADATA[".svg"])
    return buffer.getvalue()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
