"""A resonance that no sweep of the frequency meets: the absorber's detached branch.

At F = 0.19 the response goes on from the two low peaks to large motions. Lower the force and these come off: at
F = 0.15 a sweep meets small motions only, while others, more than ten times as large at the same frequency, live on a
closed curve of their own. To reach it, follow one of the large motions down in force, then around in frequency.

    python ex03_isolated_response.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file, plot_response

ATTACHED, DETACHED = 0.19, 0.15  # forces
OMEGA = (0.8, 2.7)
INSIDE = 1.8  # a frequency at which both coexist

attached = so.frequency_response(so.library.nltva(F=ATTACHED), OMEGA)
large = np.flatnonzero(attached.amplitude > 1.0)
start = large[np.argmin(np.abs(attached.omega[large] - INSIDE))]

down = so.continue_branch(attached.orbits[start], "F", (ATTACHED, DETACHED))
loop = so.continue_branch(down.orbits[-1], "omega", OMEGA)
sweep = so.frequency_response(so.library.nltva(F=DETACHED), OMEGA)
print(loop)

plot_response([sweep.to_xarray(), loop.to_xarray()], figure_file(), labels=["swept", "detached"])

# The curve returns to where it began. Its right end is a limit point; shooting finds 2.3037802598.
assert loop.closed
right = max(point.omega for point in loop.bifurcations["LP"])
assert abs(right - 2.3037802598) < 1e-6, right
