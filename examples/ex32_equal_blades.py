"""Six equal blades on a disk: which pattern around the disk doubles its period first, and under how large a load.

Driven alike, the blades move alike. That motion doubles its period to all of them together, or to a pattern with one,
two or three nodal diameters. Patterns with one or two come in pairs, by the symmetry, and so do the multipliers that
pass -1: two period doublings fall together. Each border in the plane of frequency and load is a tongue with a lowest
point, below which the pattern never comes about.

    python ex32_equal_blades.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

BLADES, COUPLING = 6, 0.01
ring = 2 * np.eye(BLADES) - np.roll(np.eye(BLADES), 1, axis=0) - np.roll(np.eye(BLADES), -1, axis=0)
disk = so.System(
    np.eye(BLADES),
    0.03 * np.eye(BLADES),
    np.eye(BLADES) + COUPLING * ring,
    [so.PolynomialSpring(blade, {2: 0.5, 3: 0.2}) for blade in range(BLADES)],
    [so.HarmonicLoad(blade, "p") for blade in range(BLADES)],
    {"p": 0.4},
    name="six equal blades",
)
response = so.frequency_response(disk, (1.8, 2.02))
print(response)

# the first of those that fall together stands for all
doublings = list({round(event.omega, 6): event for event in reversed(response.bifurcations["PD"])}.values())[::-1]
borders = [so.track(event, "p", (0.02, 0.6), omega=(1.8, 2.3)) for event in doublings]
print("nodal diameters    doublings that fall together    lowest load")
for diameters, (event, border) in enumerate(zip(doublings, borders, strict=True)):
    lowest = min(extremum.parameters["p"] for extremum in border.extrema if extremum.parameter_name == "p")
    print(f"{diameters:>15}{event.multiplicity:>32}{lowest:>15.5f}")

labels = [f"{diameters} nodal diameters" for diameters in range(len(borders))]
so.plot(borders, figure_file(), labels=labels, marks=["extremum"], size="double-column")

# One mass alone has the tongue of all blades together, with its stiffness raised by the coupling's eigenvalue.
assert [event.multiplicity for event in response.bifurcations] == [1, 2, 2, 2, 2, 1]
assert not response.audit.unsettled
assert all(so.verify(event).agrees for event in doublings)
