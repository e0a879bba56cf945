"""Alcorta et al. 2019, Fig. 14: the distance of two trajectories that begin 1e-14 apart, at point B.

Omega = 2.6, p = 1.6, Kc = 4.2, j = 0. The paper reads a Lyapunov exponent of 0.1918 off one such run. Here the same is
done with a hundred step sizes, and the exponent is computed by the derivative of the flow, with a standard error.

    python fig14_exponent.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0, regularization=3000.0)
by_two = so.lyapunov_exponents(oscillator, omega=2.6, method="two_trajectories")
exponents = so.lyapunov_exponents(oscillator, omega=2.6, periods=2500)
print(by_two)
print(exponents)
print(f"runs that give the paper's 0.1918 or more: {np.mean(by_two.rates >= 0.1918):.0%}")

by_two.plot(figure_file(), size="double-column")

# 0.136 +- 0.0003 by variational equations in another program, 0.131 with a standard deviation of 0.018 by two
# trajectories with 200 step sizes of Newmark's method there.
assert abs(exponents.exponents[0] - 0.136) < 3.0 * np.hypot(exponents.standard_errors[0], 0.0003)
assert abs(by_two.exponent - 0.131) < 0.01
assert 0.013 < by_two.spread < 0.026
