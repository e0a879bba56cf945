"""Alcorta et al. 2019, Fig. 13: 5000 stroboscopic points at point B, (omega, p, Kc) = (2.6, 1.6, 4.2), from rest.

python fig13_chaos.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0, regularization=3000.0)
accurate, newmark = (
    so.poincare_sections(oscillator, omega=2.6, transient=1000, periods=5000, method=method)
    for method in ("accurate", "newmark")
)
print(accurate, newmark, sep="\n")

accurate.plot(figure_file(), size=(5.2, 4.2))

# Nothing repeats within 1600 periods. Two integrators, whose trajectories part within some tens of periods, fill the
# same set: the same shares of their points lie in the cells of a grid, as far as 5000 points can tell.
assert accurate.periods[0] == newmark.periods[0] == 0
low, high = accurate.points[0].min(axis=0), accurate.points[0].max(axis=0)
cells = [
    np.histogramdd(run.points[0], bins=6, range=list(zip(low, high, strict=True)))[0] for run in (accurate, newmark)
]
assert abs(cells[0] - cells[1]).sum() / 10000 < 0.1
