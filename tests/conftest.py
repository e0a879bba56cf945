"""What holds for all tests: kernels are compiled when they are first called, so that none runs interpreted for long."""

from __future__ import annotations

from suboctave.compiled import compile_at_once

compile_at_once()
