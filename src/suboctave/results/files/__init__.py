"""Branches and diagrams as datasets, and back."""

from suboctave.results.files import branch, diagram

__all__ = ["branch", "diagram"]
