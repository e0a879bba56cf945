"""Experiments in time: trajectories, sections, brute force, exponents, basins, stepped sine, measured curves."""

from suboctave.experiments import files as files
