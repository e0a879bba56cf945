"""Experiments in time: trajectories, sections, brute force, exponents, basins, stepped sine, measured curves."""

from suboctave.experiments import files
from suboctave.experiments.basins import Basins, basins
from suboctave.experiments.brute_force import BruteForceDiagram, brute_force_diagram
from suboctave.experiments.lyapunov import LyapunovExponents, Separation, TwoTrajectories, lyapunov_exponents
from suboctave.experiments.lyapunov_map import LyapunovMap, lyapunov_map
from suboctave.experiments.measured import Measured, read_measured
from suboctave.experiments.poincare import Attractor, PoincareSections, poincare_sections
from suboctave.experiments.stepped_sine import SteppedSine, stepped_sine
from suboctave.experiments.trajectories import Trajectory, integrate

__all__ = [
    "Attractor",
    "Basins",
    "BruteForceDiagram",
    "LyapunovExponents",
    "LyapunovMap",
    "Measured",
    "PoincareSections",
    "Separation",
    "SteppedSine",
    "Trajectory",
    "TwoTrajectories",
    "basins",
    "brute_force_diagram",
    "files",
    "integrate",
    "lyapunov_exponents",
    "lyapunov_map",
    "poincare_sections",
    "read_measured",
    "stepped_sine",
]
