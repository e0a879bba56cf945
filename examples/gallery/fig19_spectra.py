"""Alcorta et al. 2019, Fig. 19: what three coexisting motions consist of, here at omega = 2.25 and j = 0.5.

The small motion touches no stop and is almost a single harmonic. On the isola the largest component is that at half the
frequency of the load. The large motion has the load's period.

    python fig19_spectra.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

OMEGA = 2.25

oscillator = so.library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
small = so.frequency_response(oscillator, omega=(3.0, OMEGA)).orbits[-1]
large = so.frequency_response(oscillator, omega=(1.2, OMEGA)).orbits[-1]
(isola,) = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.3, 0.7), values=[0.5])
loop = isola.at(0.5)
near = loop.orbits[int(np.argmin(np.where(loop.stable, abs(loop.omega - OMEGA), np.inf)))]
medium = so.continue_branch(near, "omega", (near.omega, OMEGA)).orbits[-1]
for orbit in (small, medium, large):
    parts = [
        f"{k:g} omega: {abs(orbit.harmonic(k)):.4f}" for k in (0.5, 1.0, 1.5, 2.0, 3.0) if k * orbit.basis.nu % 1 == 0
    ]
    print(f"max |x| = {orbit.amplitude():.5f}  {', '.join(parts)}")

so.plot_spectrum([small, medium, large], figure_file(), size=(6.85, 4.4), highest=6)

# Shooting (no harmonic balance): the largest |x| of the two motions that touch the stops.
assert abs(medium.amplitude() - 0.88906) < 1e-5
assert abs(large.amplitude() - 3.09017) < 1e-5
assert all(so.stability(orbit).stable for orbit in (small, medium, large))
assert abs(medium.harmonic(0.5)) > 2.0 * abs(medium.harmonic(1))
