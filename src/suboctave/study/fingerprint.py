"""Digests of a user's Python code: what has been computed with a function is taken over only while that is the same.

A function counts as its bytecode, its constants, defaults and closed-over values, and whatever of its own module it
names; what it takes from other modules counts by name. Digests are the same in every process of one version of Python.
"""

from __future__ import annotations

import functools
import hashlib
import pkgutil
import types
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

#: values that count as they are shown
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), range, slice)


def fingerprint(value: Any) -> str:
    """The digest of a function, of a class, or of an object that can be called."""
    digest = hashlib.sha256()
    for part in _parts(value, set()):
        digest.update(f"{len(part)}:{part}".encode(errors="surrogatepass"))
    return digest.hexdigest()


def code_in(described: Any) -> dict[str, str]:
    """The digests of the functions, and of the classes of a user's, that a description names: by `module:name`."""
    found: dict[str, str] = {}
    if isinstance(described, Mapping):
        for key, value in described.items():
            if key in ("callable", "type", "function") and isinstance(value, str) and ":" in value:
                with suppress(ImportError, AttributeError, ValueError):
                    found[value] = fingerprint(pkgutil.resolve_name(value))
            else:
                found |= code_in(value)
    elif isinstance(described, list | tuple):
        for value in described:
            found |= code_in(value)
    return found


def _parts(value: Any, seen: set[int]) -> Iterator[str]:
    """All that a value consists of, in a fixed order."""
    yield type(value).__name__
    if isinstance(value, _PLAIN):
        yield repr(value)
        return
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        yield from (array.dtype.str, str(array.shape))
        yield from ([repr(array.tolist())] if array.dtype.hasobject else [array.tobytes().hex()])
        return
    if id(value) in seen:  # it names itself
        return
    seen.add(id(value))
    if isinstance(value, set | frozenset):
        yield from sorted("\0".join(_parts(item, seen)) for item in value)
        return
    for part in _inside(value):
        yield from _parts(part, seen)


def _inside(value: Any) -> Iterator[Any]:
    """What a value holds that makes it what it is."""
    if isinstance(value, types.CodeType):
        yield from (value.co_code, value.co_consts, value.co_names, value.co_varnames, value.co_freevars)
    elif isinstance(value, types.FunctionType):
        yield from (value.__code__, value.__defaults__, value.__kwdefaults__)
        for cell in value.__closure__ or ():
            with suppress(ValueError):  # not filled yet
                yield cell.cell_contents
        for name in sorted(_names(value.__code__) & value.__globals__.keys()):
            yield from (name, _from(value.__globals__[name], value.__module__))
    elif isinstance(value, types.MethodType):
        yield from (value.__func__, value.__self__)
    elif isinstance(value, functools.partial):
        yield from (value.func, value.args, value.keywords)
    elif isinstance(value, type):
        yield value.__qualname__
        own = {n: item for n, item in vars(value).items() if not n.startswith("__") or callable(item)}
        yield from [part for name in sorted(own) for part in (name, own[name])]
        yield from [_from(base, value.__module__) for base in value.__bases__]
    elif isinstance(value, property | staticmethod | classmethod):
        yield from (getattr(value, name, None) for name in ("fget", "fset", "__func__"))
    elif isinstance(value, Mapping):
        yield from [part for key in value for part in (key, value[key])]
    elif isinstance(value, list | tuple):
        yield from value
    elif isinstance(value, types.ModuleType | types.BuiltinFunctionType | np.ufunc):
        yield value.__name__
    else:  # an object: its class, and what it holds
        yield _from(type(value), type(value).__module__) if _is_users(type(value)) else type(value).__qualname__
        yield getattr(value, "__dict__", None)


def _from(value: Any, module: str) -> Any:
    """A value that code of a module names: in full where it is of that module, else by its name."""
    home = getattr(value, "__module__", None)
    if isinstance(value, types.FunctionType | type) and home != module:
        return f"{home}:{value.__qualname__}"
    return value


def _is_users(kind: type) -> bool:
    """Whether a class is written in Python, outside of this package."""
    return bool(kind.__flags__ & (1 << 9)) and not kind.__module__.startswith("suboctave")


def _names(code: types.CodeType) -> set[str]:
    """The names of all that code, and the functions in it, look up."""
    inner = [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    return set(code.co_names).union(*map(_names, inner))
