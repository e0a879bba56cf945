"""What a computation gives: branches and diagrams, what is read off them, and their files."""

from suboctave.results import files
from suboctave.results.branch import Branch
from suboctave.results.diagram import BifurcationDiagram
from suboctave.results.tracked_branch import TrackedBranch

__all__ = ["BifurcationDiagram", "Branch", "TrackedBranch", "files"]
