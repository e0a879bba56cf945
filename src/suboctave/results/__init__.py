"""What a computation gives: branches and diagrams, what is read off them, and their files.

The classes of everything that verbs give are found here, wherever they are made: a front door like that of the package.
`__init__.pyi` lists them, and each is loaded when it is first used.
"""

from __future__ import annotations

from suboctave.frontdoor import attached
from suboctave.results import files as files

__getattr__, __dir__, __all__ = attached(__name__, __file__)
