"""Flutter: a wing section begins to oscillate by itself in a faster wind, and goes on to in a slower one.

    h'' + xa a'' + 2 zeta w h' + w^2 h                           + L = 0        plunge
    xa h'' + r2 a'' + 2 zeta r2 a' + r2 (a - k3 a^3 + k5 a^5) - e L = 0        pitch
    L = beta (U^2 a + U h')                                                     quasi-steady lift

The stiffness in pitch softens before it hardens. At rest the section is stable up to the Hopf point, U = 1.4133; this
is subcritical, and oscillations of a quarter of a radian remain down to the limit point of the cycles, U = 1.3797. The
border of flutter that a designer needs is that of the limit point, here over the damping.

    python ex29_flutter.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

wing = so.System.from_equations(
    [
        "h'' + xa*a'' + 2*zeta*w*h' + w**2*h + beta*U**2*a + beta*U*h' = 0",
        "xa*h'' + r2*a'' + 2*zeta*r2*a' + r2*(a - k3*a**3 + k5*a**5) - beta*e*U**2*a - beta*e*U*h' = 0",
    ],
    {"xa": 0.2, "r2": 0.25, "zeta": 0.01, "w": 0.5, "beta": 0.1, "e": 0.2, "k3": 2.0, "k5": 20.0, "U": 0.5},
    name="wing section",
)
rest = so.equilibria(wing, "U", (1.0, 2.0), observe="a")
(hopf,) = rest.bifurcations["Hopf"]
cycles = so.limit_cycles(hopf, observe="a")
(fold,) = cycles.bifurcations["LP"]
print(rest)
print(cycles)

border = so.track(fold, "zeta", (0.002, 0.03))
onset = so.track(hopf, "zeta", (0.002, 0.03))
print("   zeta    rest stable below U    no flutter below U")
for zeta in (0.005, 0.01, 0.02):
    ends = [float(np.interp(zeta, curve.parameter("zeta"), curve.parameter("U"))) for curve in (onset, border)]
    print(f"{zeta:7.3f}{ends[0]:17.4f}{ends[1]:22.4f}")

so.plot([rest, cycles], figure_file(), x="U", size="double-column")

# By shooting with free period, a second multiplier of the cycle at the limit point is +1; rest by its eigenvalues.
assert abs(hopf.parameters["U"] - 1.4132680) < 1e-6
assert hopf.criticality == "subcritical"
assert abs(fold.parameters["U"] - 1.3797317) < 1e-6
assert so.verify(fold).agrees
