"""Alcorta et al. 2019, Fig. 16: where motions of twice the period are born, and where they are isolas.

In region I the response doubles its period. In region II the motions of twice the period are a closed branch to which
no sweep leads: it is born at j = 0.579889 and merges with the doubled branch at 0.176829, not at the largest gap of the
doublings (../ex17_isolas_as_published.py shows that place).

    python fig16_isolas_over_symmetry.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=0.55, regularization=3000.0)
isolas = so.find_isolas(oscillator, omega=(1.9, 4.2), parameter="j", bounds=(0.0, 1.0), values=2)
(isola,) = isolas
(border,) = isolas.doublings
folds = [curve for curve in isolas.limit_points if curve.orbits[0].basis.nu == 2]
print(isola)

figure = so.plot([border, *folds], size="double-column", xlim=(1.9, 4.1), ylim=(0.0, 0.7), marks=["extremum", "GPD"])
axes = figure.axes[0]
# 2T motions on a branch that leaves the response exist beyond the doublings too, up to their limit points
(right,) = (curve for curve in folds if curve.bifurcations["CP"])
limits, every = (np.column_stack((curve.omega, curve.parameter("j"))) for curve in (isola.limit_points, right))
beside = every[every[:, 0] > limits[:, 0].max()]
upper = limits[np.argmax(limits[:, 0])]
lower = [(isola.merges.omega, isola.merges), (border.omega[[0, -1]].min(), 0.0)]
for corners, colour in (
    (np.column_stack((border.omega, border.parameter("j"))), "#d9eaf3"),
    (np.vstack((beside, upper, *lower)), "#d9eaf3"),
    (limits, "#ccece3"),
):
    axes.fill(*corners.T, color=colour, linewidth=0, zorder=1)
axes.text(2.55, 0.05, "I", fontsize=9)
axes.text(2.4, 0.35, "II", fontsize=9)
figure.savefig(figure_file(), dpi=300)

# Shooting (no harmonic balance).
assert np.allclose((isola.born.omega, isola.born), (2.355660, 0.579889), rtol=0.0, atol=2e-6)
assert np.allclose((isola.merges.omega, isola.merges), (2.023364, 0.176829), rtol=0.0, atol=2e-6)
