"""What a computation gives: branches and diagrams, what is read off them, and their files."""

from suboctave.results import files
from suboctave.results.branch import Branch, TrackedBranch
from suboctave.results.diagram import BifurcationDiagram

__all__ = ["BifurcationDiagram", "Branch", "TrackedBranch", "files"]
