"""Which vibrations are possible at which frequency and gap?

The rattling oscillator answers its load with the load's period, with twice or four times that, or with one of several:
which one depends on how it was started. The map says for every frequency and gap which stable motions there are. It is
made of curves of bifurcations, and then doubted: at random points trajectories are integrated in time from random
states. Those that end on motions that no branch leads to are reported.

    python ex22_regimes.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(regularization=3000.0)
regimes = so.regime_map(system, omega=(1.9, 3.3), parameter="j", bounds=(0.0, 0.7), depth=1)
print(regimes)
checked = regimes.check(points=12, seed=5, starts=2)
print(checked)

regimes.plot(figure_file(), title="Stable motions of the rattling oscillator")

# At j = 0.3 shooting (no harmonic balance) puts the limit points of the isola at these frequencies.
for omega, inside in ((2.0824, False), (2.0826, True), (2.7856, True), (2.7858, False)):
    assert ((2, True) in regimes.label(omega, 0.3).motions) is inside, omega
# Every stable motion of the map was confirmed in time; what disagrees are motions that it does not know.
assert {landing.verdict for landing in checked.disagreements} <= {"unknown motion"}, checked
assert checked.rate > 0.9, checked
