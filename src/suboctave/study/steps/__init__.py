"""The steps that a study can take, in files by subject; whatever is in this folder is a step."""

from __future__ import annotations

import importlib
import pkgutil

from suboctave.study.steps.base import STEPS, CheckContext, Context, Known, Step

__all__ = ["STEPS", "CheckContext", "Context", "Known", "Step"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
