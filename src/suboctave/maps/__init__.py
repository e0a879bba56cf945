"""Searches over a design parameter: isolas and regimes."""

from suboctave.maps import files as files
