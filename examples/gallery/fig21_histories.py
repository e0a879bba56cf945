"""Alcorta et al. 2019, Fig. 21: two coexisting motions over two periods of the load, here at omega = 2.25 and j = 0.5.

The figure of the paper is measured; these are the same two motions, computed: that which a sweep meets, and that on the
isola.

    python fig21_histories.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

OMEGA = 2.25

oscillator = so.library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
swept = so.frequency_response(oscillator, omega=(3.0, OMEGA)).orbits[-1]
(isola,) = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.3, 0.7), values=[0.5])
loop = isola.at(0.5)
near = loop.orbits[int(np.argmin(np.where(loop.stable, abs(loop.omega - OMEGA), np.inf)))]
isolated = so.continue_branch(near, "omega", (near.omega, OMEGA)).orbits[-1]

so.plot_history([swept, isolated], figure_file(), size="double-column", overlay=True)

# Shooting (no harmonic balance) from the same states arrives at both; the amplitude on the isola.
for orbit in (swept, isolated):
    assert so.verify(orbit).agrees
assert abs(isolated.amplitude() - 0.88906) < 1e-5
