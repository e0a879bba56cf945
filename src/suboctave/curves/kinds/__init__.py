"""The kinds of curves, one file each: the equations that single their motions out."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from suboctave.kinds import KINDS

if TYPE_CHECKING:
    from suboctave.curves.augmentation import Augmentation


@cache
def equations_of(kind: str) -> type[Augmentation]:
    """The equations of a kind that can be followed, as its row in the table of kinds names them."""
    module, _, name = KINDS[kind].equations.partition(":")
    equations: type[Augmentation] = getattr(import_module(f"{__name__}.{module}"), name)
    return equations
