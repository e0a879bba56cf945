"""Some values of a parametrised test are run by `make test-all` alone: the matrix of all steppings takes long."""

from __future__ import annotations

from typing import Any

import pytest


def slow(*values: Any) -> list[Any]:
    """These values, marked as slow."""
    return [pytest.param(value, marks=pytest.mark.slow) for value in values]
