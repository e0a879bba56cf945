"""Alcorta et al. 2019, Fig. 6: frequency responses under weak forcing, both gaps equal and one of them closed.

With equal gaps (j = 1) there are two limit points. With one gap closed (j = 0) the response also doubles its period
between two frequencies; the branch of twice the period has two limit points and no period doubling.

    python fig06_weak_forcing.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

symmetric, asymmetric = (so.library.reference_oscillator(p=0.55, j=j, regularization=3000.0) for j in (1.0, 0.0))
equal = so.frequency_response(symmetric, omega=(4.2, 1.25))
closed = so.bifurcation_diagram(asymmetric, omega=(4.2, 1.25))
plain, doubled = closed["T"].branch, closed["2T"].branch
for curve in (equal, plain, doubled):
    print(curve.bifurcations)

so.plot([equal, plain, doubled], figure_file(), size="double-column", marks=["LP", "PD"])

# Shooting (no harmonic balance).
assert abs(equal.bifurcations["LP"][1].omega - 2.42383602) < 1e-6
assert abs(plain.bifurcations["PD"][0].omega - 3.99345233) < 1e-6
assert abs(plain.bifurcations["PD"][1].omega - 2.30315297) < 1e-6
assert [round(fold.omega, 5) for fold in doubled.bifurcations["LP"]] == [2.94603, 3.14018]
assert not doubled.bifurcations["PD"]
