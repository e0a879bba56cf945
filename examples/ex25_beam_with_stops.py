"""A clamped beam whose tip swings between two stops: a finite-element model from its dimensions to its jumps.

A steel beam, 0.7 m long, of twenty elements; a shaker acts at its tip, two stops stand 1 mm above and below it at 90 %
of its length. Units are N, m, kg, s. The stops stiffen the beam: the resonance bends to higher frequencies and falls
down in a jump.

    python ex25_beam_with_stops.py [figure.png]
"""

import math

import suboctave as so
from suboctave.pictures import figure_file

ELEMENTS = 20
FORCE = 1.0  # N
STOP_STIFFNESS, GAP = 1e4, 1e-3  # N/m, m
RATIO = 0.01  # damping of the first two modes

beam = so.structures.beam(
    length=0.7, width=0.014, height=0.014, young=2.05e11, density=7800.0, elements=ELEMENTS, supports="clamped-free"
)
print(beam)
modes = beam.natural_frequencies(3)
print(modes)

first, second, _ = modes.omega

tip = beam.dof(ELEMENTS, "z")
stopped = beam.dof(9 * ELEMENTS // 10, "z")
system = beam.system(
    elements=[
        so.ElasticStop(dof=stopped, stiffness=STOP_STIFFNESS, gap=GAP, side="right"),
        so.ElasticStop(dof=stopped, stiffness=STOP_STIFFNESS, gap=-GAP, side="left"),
    ],
    loads=[so.HarmonicLoad(dof=tip, amplitude=FORCE)],
    damping=so.Rayleigh(alpha=2.0 * RATIO * first * second / (first + second), beta=2.0 * RATIO / (first + second)),
    name="beam between stops",
    units="m, N, s",
)

curve = so.frequency_response(system, omega=(130.0, 240.0), observe=tip)
print(curve)
jump = curve.bifurcations["LP"][0]
print(f"the resonance ends at {jump.omega / (2.0 * math.pi):.4f} Hz, without stops it lies at {modes.hertz[0]:.4f} Hz")

curve.plot(figure_file(), frequency="Hz")

# by shooting, with the four lowest modes and what stops and load deflect: 206.91863
assert abs(jump.omega - 206.91863) < 1e-4, jump.omega
