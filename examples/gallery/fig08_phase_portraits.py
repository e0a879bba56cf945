"""Alcorta et al. 2019, Fig. 8: phase portraits before and after the period doubling at the lowest frequency.

A, just below that doubling, closes after one period of the load. B, just above it, needs two: one more loop.

    python fig08_phase_portraits.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(4.2, 2.2))
first, last = response.bifurcations["PD"]
doubled = so.switch_branch(first)
a = response.orbits[int(np.argmin(abs(response.omega - (last.omega - 0.06))))]
b = doubled.orbits[int(np.argmin(abs(doubled.omega - (last.omega + 0.04))))]
print(f"doubling at omega = {last.omega:.6f}; A {a}, B {b}")

so.plot_phase([a, b], figure_file(), size="double-column")

# Shooting: the doubling, and both motions are what they seem, stable motions of one and of two load periods.
assert abs(last.omega - 2.39144003) < 1e-6
for orbit, periods in ((a, 1), (b, 2)):
    assert orbit.basis.nu == periods
    assert so.stability(orbit).stable
    assert so.verify(orbit).agrees
assert abs(b.harmonic(0.5)) > 0.1
