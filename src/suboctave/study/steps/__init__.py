"""The steps that a study can take, each in a file of its own; whatever is in this folder is found."""

from __future__ import annotations

import importlib
import pkgutil

from suboctave.study.steps.base import STEPS, Context, Known, Step, Surroundings

__all__ = ["STEPS", "Context", "Known", "Step", "Surroundings"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
