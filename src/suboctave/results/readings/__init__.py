"""Quantities read off the motions of a branch."""
