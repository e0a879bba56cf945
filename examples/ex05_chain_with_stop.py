"""Ten masses in a row, the last one against a stop: a bifurcation located twice, by methods that share nothing.

Unit masses and springs, a force on the first mass, a one-sided stop at the last. Around the second natural frequency
the contact makes the response unstable. Harmonic balance locates where; `verify` integrates the equations of motion
with the exact contact instants and locates the same period doubling by shooting.

    python ex05_chain_with_stop.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

MASSES = 10
FORCE = 0.15
STOP_STIFFNESS, GAP = 1.0, 1.0
OMEGA = (0.42, 0.50)

stiffness = 2.0 * np.eye(MASSES) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
stiffness[-1, -1] = 1.0  # the far end is free
system = so.System(
    mass=np.eye(MASSES),
    damping=0.01 * np.eye(MASSES) + 0.02 * stiffness,
    stiffness=stiffness,
    elements=[so.ElasticStop(dof=MASSES - 1, stiffness=STOP_STIFFNESS, gap=GAP)],
    loads=[so.HarmonicLoad(dof=0, amplitude=FORCE)],
)

curve = so.frequency_response(system, OMEGA, observe=MASSES - 1)
print(curve)

doubling = curve.bifurcations["PD"][0]
check = so.verify(doubling)
print(check)
assert check.agrees

curve.plot(figure_file())

# A curve computed by shooting alone, with no harmonics (benchmarks/chain_by_shooting.py).
assert abs(doubling.omega - 0.4343213975) < 1e-7, doubling.omega
