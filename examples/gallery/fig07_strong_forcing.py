"""Alcorta et al. 2019, Fig. 7: successive period doublings under strong forcing, one gap closed.

The branch of twice the period doubles its period again: motions of four load periods between two frequencies.

    python fig07_strong_forcing.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
diagram = so.bifurcation_diagram(oscillator, omega=(4.2, 1.9), depth=2)
print(diagram)
doubled, again = diagram["2T"].branch, diagram["4T"].branch

diagram.plot(figure_file(), size="double-column", marks=["LP", "PD"])

# Shooting (no harmonic balance): where 4T motions begin and end on the 2T branch, and where they double once more.
assert [round(b.omega, 5) for b in doubled.bifurcations["PD"]] == [3.02870, 2.44815]
assert sorted(round(b.omega, 5) for b in again.bifurcations["PD"]) == [2.45211, 2.98047]
