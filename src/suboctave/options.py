"""Keyword options that several verbs share: declared once, with types and meanings, for signatures, help and checks.

A verb takes `**options: Unpack[Declared]`, where `Declared` is a TypedDict whose fields carry their meanings,

    class Declared(RunOptions, total=False):
        max_step: Annotated[float | None, "Largest distance between neighbours."]

and is decorated with `with_options(Declared)`. Its signature then lists the options as keywords, its docstring ends
with their meanings and, unless it says more of its errors, with that of wrong input; a name that is not declared is
refused.
"""

from __future__ import annotations

import functools
import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Annotated, Any, ParamSpec, TypedDict, TypeVar, get_args, get_type_hints

from suboctave.errors import suggest

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class RunOptions(TypedDict, total=False):
    """Options of every verb that may take long."""

    progress: Annotated[Any, "None, True (a bar), or a callable taking (share done, text)."]
    seconds: Annotated[
        float | None,
        "Time limit. What was computed by then is given, as after Ctrl-C (`interrupted`); a TimeLimitError where that "
        "is nothing.",
    ]


def with_options(declared: Any) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Declare the `**options` of a verb by a TypedDict; all of them are None where they are not given.

    The verb raises a TypeError for other names.
    """
    types = {name: get_args(hint) for name, hint in get_type_hints(declared, include_extras=True).items()}

    def decorated(verb: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        own = [p for p in inspect.signature(verb).parameters.values() if p.kind is not p.VAR_KEYWORD]
        taken = {p.name for p in own}
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_short(kind))
            for name, (kind, _) in types.items()
            if name not in taken
        ]
        known = {*taken, *types}

        @functools.wraps(verb)
        def checked(*positional: Arguments.args, **named: Arguments.kwargs) -> Result:
            unknown = next((name for name in named if name not in known), None)
            if unknown is not None:
                tail = suggest(unknown, known, limit=len(known))
                raise TypeError(f"{verb.__name__}() got an unexpected keyword argument {unknown!r}{tail}")
            return verb(*positional, **named)

        returns = inspect.signature(verb).return_annotation
        described: Any = checked
        described.__signature__ = inspect.Signature([*own, *more], return_annotation=returns)
        if verb.__doc__ is not None:
            fill = textwrap.TextWrapper(108, initial_indent="    ", subsequent_indent="    ").fill
            listed = "".join(f"{p.name}\n{fill(types[p.name][1])}\n" for p in more)
            section = f"Other Parameters\n----------------\n{listed}"
            if "Raises\n" not in verb.__doc__:
                section += "\nRaises\n------\nInputError\n    Wrong input, before any work.\n"
            section = textwrap.indent(section, "    ")
            described.__doc__ = f"{verb.__doc__.rstrip()}\n\n{section}    "
        return described

    return decorated


def _short(kind: Any) -> str:
    """A type by the names of its classes alone."""
    return re.sub(r"\b(?:\w+\.)+", "", inspect.formatannotation(kind))
