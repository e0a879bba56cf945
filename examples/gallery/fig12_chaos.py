"""Alcorta et al. 2019, Fig. 12 (from de Langre and Lebreton): where the motion is chaotic, one gap closed.

The largest Lyapunov exponent over frequency and forcing, with the border of 4T motions: chaos begins soon beyond.

    python fig12_chaos.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(4.2, 2.2))
doubled = so.switch_branch(response.bifurcations["PD"][0])
second = so.track(doubled.bifurcations["PD"][0], "p", (0.9, 2.0), max_step=0.02)
chart = so.lyapunov_map(oscillator, (2.2, 3.2), parameter="p", bounds=(0.9, 2.0), grid=(50, 34))
print(chart)

chart.plot(figure_file(), curves=second, size="double-column")

# Point B of the paper's section 5.1 is chaotic, here with Kc = 4.7, too; far from the border next to nothing is: few
# motions from rest reach what is chaotic there beside the periodic ones.
b = int(np.argmin(abs(chart.values - 1.6))), int(np.argmin(abs(chart.omega - 2.6)))
assert chart.chaotic[b]
assert chart.chaotic[:, chart.omega < 2.3].mean() < 0.02
# Most of what is chaotic lies within the border of 4T motions.
inside = np.zeros_like(chart.chaotic)
for j, value in enumerate(chart.values):
    at = second.parameter("p") - value
    crossings = np.flatnonzero(at[:-1] * at[1:] < 0.0)
    ends = second.omega[crossings]
    if len(ends) >= 2:
        inside[j] = (chart.omega > ends.min()) & (chart.omega < ends.max())
assert (chart.chaotic & inside).sum() > 0.85 * chart.chaotic.sum()
