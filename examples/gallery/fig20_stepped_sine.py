"""Alcorta et al. 2019, Fig. 20: the virtual stepped-sine test at j = 0.5, and a gentle tap that leads onto the isola.

Frequencies are stepped up from 2.0 and down from 2.7 on the small motion. At omega = 2.3 the velocity is changed by
0.9, and what follows is the motion of twice the period, to the ends of the isola.

    python fig20_stepped_sine.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, j=0.5, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(2.9, 1.9))
small = so.stepped_sine(oscillator, (2.0, 2.9), values=3, direction="down").ends[0, 0]
test = {"values": 71, "direction": ("up", "down"), "start": small}
plain = so.stepped_sine(oscillator, (2.0, 2.7), **test)
tapped = so.stepped_sine(oscillator, (2.0, 2.7), tap=(2.3, 0, 0.9), **test)
print(plain, tapped, sep="\n")
(isola,) = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.3, 0.7), values=[0.5])
loop = isola.at(0.5)

tapped.plot(figure_file(), curves=[response, loop], size="double-column", ylim=(0.05, 0.2))

# Shooting (no harmonic balance): the ends of the isola. Motions of twice the period are met up to the last step inside.
LOW, HIGH = 2.200149, 2.514902
assert (plain.period == 1).all()
for row, after in (("up", tapped.omega >= 2.3 - 1e-9), ("down", tapped.omega <= 2.3 + 1e-9)):
    on = tapped.period[tapped.of(row)] == 2
    assert (on == (after & (tapped.omega > LOW) & (tapped.omega < HIGH))).all(), row
# Harmonic balance from the states of the test: |X1| of every motion that was met. Behind a jump one may not be settled.
for run in (plain, tapped):
    assert (run.period == 0).sum() <= 1
    for s in range(2):
        for v in np.flatnonzero(run.period[s]):
            orbit = so.periodic_orbit(oscillator, run.omega[v], start=run.ends[s, v], subharmonic=int(run.period[s, v]))
            assert np.isclose(abs(run.response[s, v, 0]), abs(orbit.harmonic(1)), rtol=1e-3), (run.omega[v], s)
