"""How far must a stop be moved away so that the vibration never doubles its period?

The rattling oscillator doubles its period between two frequencies. The border of that region is followed in frequency
and gap, from one of the two doublings to the other: its extremum is the gap beyond which there is none. The motions of
twice the period have a border of their own, their limit points: they coexist with the plain motion far beyond, which no
response curve from rest shows.

    python ex15_border_of_doubling.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(p=0.55, regularization=3000.0)
response = so.frequency_response(system, omega=(4.05, 3.9))
border = so.track(response.bifurcations["PD"][0], parameter="j", bounds=(0.0, 1.0))
print(border)

border.plot(figure_file(), title="Where the vibration doubles its period")

# Shooting (no harmonic balance) puts the extremum at omega = 2.021701, j = 0.177129.
farthest = next(e for e in border.extrema if e.parameter_name == "j")
assert abs(farthest.omega - 2.021701) < 1e-5, farthest
assert abs(farthest.parameter("j") - 0.177129) < 1e-6, farthest
