"""Where a computation is watched: in a notebook, at a prompt, or nowhere."""

from __future__ import annotations

import sys
from typing import Any


def in_notebook() -> bool:
    """Whether cells of a notebook show what is displayed."""
    shell = _shell()
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


def at_prompt() -> bool:
    """Whether somebody types at a prompt in a terminal, or will when the script is over (`python -i`)."""
    return not in_notebook() and bool(sys.flags.interactive or hasattr(sys, "ps1"))


def _shell() -> Any:
    """IPython's shell, None outside of one; not imported for this."""
    module = sys.modules.get("IPython")
    return None if module is None else module.get_ipython()
