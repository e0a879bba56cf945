"""Two masses with a stop between them: when do they begin to touch, and what does the first touch do?

Mass 0 is driven, mass 1 hangs on it; a stiff stop limits how far they come apart. Until it touches, the structure is
linear, so that the first touch is known in closed form. Coming down in frequency, the response folds back a sliver
behind it: at the first touch the motion jumps. `smooth` tells such a fold from those of a smooth system, and shooting
finds it at the same place.

    python ex07_first_touch.py [figure.png]
"""

import numpy as np
from scipy.optimize import brentq

import suboctave as so
from suboctave.pictures import figure_file

STIFFNESS = np.array([[2.0, -1.0], [-1.0, 1.0]])
DAMPING = 0.05 * STIFFNESS
GAP = 1.5

system = so.System(
    mass=np.diag([1.0, 0.5]),
    damping=DAMPING,
    stiffness=STIFFNESS,
    elements=[so.ElasticStop(dof=(0, 1), stiffness=10.0, gap=GAP)],
    loads=[so.HarmonicLoad(dof=0, amplitude=0.5)],
)


def linear_distance(omega):
    """Amplitude of x_0 - x_1 without the stop."""
    dynamic = STIFFNESS - omega**2 * np.diag([1.0, 0.5]) + 1j * omega * DAMPING
    x = np.linalg.solve(dynamic, [0.5, 0.0])
    return abs(x[0] - x[1])


curve = so.frequency_response(system, (2.8, 1.2))
print(curve)
for bifurcation in curve.bifurcations:
    if not bifurcation.smooth:
        check = so.verify(bifurcation)
        print(f"{bifurcation.kind} brought about by {bifurcation.contact.label}\n{check}")
        assert check.agrees

curve.plot(figure_file())

# Closed form: the linear amplitude equals the gap.
first = curve.bifurcations["grazing"][0]
expected = brentq(lambda w: linear_distance(w) - GAP, 1.9, 2.8, xtol=1e-14)
assert abs(first.omega - expected) < 1e-9, first.omega - expected
