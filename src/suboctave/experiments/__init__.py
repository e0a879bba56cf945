"""Experiments in time: verbs that integrate, their results, and the codecs of these."""

from suboctave.experiments import (
    basins as basins,
    brute_force as brute_force,
    lyapunov_map as lyapunov_map,
    stepped_sine as stepped_sine,
    trajectories as trajectories,
)
