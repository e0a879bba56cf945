"""Keyword options that several verbs share: declared once, with types and meanings, for signatures, help and checks.

A verb takes `**options: Unpack[Declared]`, where `Declared` is a TypedDict whose fields carry their meanings,

    class Declared(RunOptions, total=False):
        max_step: Annotated[float | None, "Largest distance between neighbours."]

and is decorated with `with_options(Declared)`. Its signature then lists the options as keywords, its docstring ends
with their meanings and, unless it says more of its errors, with that of wrong input; a name that is not declared is
refused.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Annotated, Any, ParamSpec, TypedDict, TypeVar, get_args, get_type_hints

from suboctave.arguments import Count, Positive, Progress, checked

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class RunOptions(TypedDict, total=False):
    """Options of every verb that may take long."""

    progress: Annotated[Progress, "None, True (a bar), or a callable taking (share done, text)."]
    seconds: Annotated[
        Positive | None,
        "Time limit. What was computed by then is given, as after Ctrl-C (`interrupted`); a TimeLimitError where that "
        "is nothing.",
    ]


class ParallelOptions(RunOptions, total=False):
    """Options of verbs whose work has independent parts."""

    workers: Annotated[
        Count | None,
        "How many cores compute, as threads or as processes of their own; default all (SUBOCTAVE_WORKERS of the "
        "environment, where it is set). The result is the same bits.",
    ]


def with_options(declared: Any) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Declare the `**options` of a verb by a TypedDict; all of them are None where they are not given.

    The verb raises a TypeError for other names.
    """
    hints, kinds = get_type_hints(declared, include_extras=True), get_type_hints(declared)
    meanings = {name: next(one for one in get_args(hint) if isinstance(one, str)) for name, hint in hints.items()}

    def decorated(verb: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        own = [p for p in inspect.signature(verb).parameters.values() if p.kind is not p.VAR_KEYWORD]
        taken = {p.name for p in own}
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_short(kind))
            for name, kind in kinds.items()
            if name not in taken
        ]
        known = {**getattr(verb, "__hints__", {}), **{p.name: hints[p.name] for p in more}}
        signature = inspect.Signature([*own, *more], return_annotation=inspect.signature(verb).return_annotation)
        described: Any = checked(verb, hints=known, signature=signature)
        described.__signature__, described.__hints__ = signature, known
        if verb.__doc__ is not None:
            fill = textwrap.TextWrapper(108, initial_indent="    ", subsequent_indent="    ").fill
            listed = "".join(f"{p.name}\n{fill(meanings[p.name])}\n" for p in more)
            section = f"Other Parameters\n----------------\n{listed}"
            if "Raises\n" not in verb.__doc__:
                section += "\nRaises\n------\nInputError\n    Wrong input, before any work.\n"
            section = textwrap.indent(section, "    ")
            described.__doc__ = f"{verb.__doc__.rstrip()}\n\n{section}    "
        return described

    return decorated


def _short(kind: Any) -> str:
    """A type by the names of its classes alone."""
    text = re.sub(r"\b(?:\w+\.)+", "", inspect.formatannotation(kind))
    return re.sub(r"^Optional\[(.*)\]$", r"\1 | None", text)
