"""A beam under a pulsating axial force: at rest until a period doubling sets it swinging, from equations as text.

    x'' + c x' + (1 + eps cos(omega t)) x + gamma x^3 = 0

The axial force varies the stiffness. Nothing pushes sideways, so that rest is a motion at every frequency; around twice
the natural frequency it is unstable, and the beam swings at half the frequency of the force.

    python ex08_swinging_up.py [figure.png]
"""

import math

import suboctave as so
from suboctave.pictures import figure_file

DAMPING, PULSATION = 0.05, 0.2

beam = so.System.from_equations(
    "x'' + c*x' + (1 + eps*cos(omega*t))*x + gamma*x**3 = 0",
    {"c": DAMPING, "eps": PULSATION, "gamma": 0.3},
)
rest = so.frequency_response(beam, omega=(1.7, 2.3))
print(rest.bifurcations)

sweep = so.continue_branch(beam.with_parameters(eps=0.01), "eps", (0.01, 0.3), omega=2.0)
(tip,) = sweep.bifurcations["PD"]
print(f"at omega = 2 rest is stable up to eps = {tip.parameters['eps']:.6f}")

swinging = so.switch_branch(rest.bifurcations["PD"][0])
so.plot({"at rest": rest, "swinging": swinging}, figure_file())

# Nayfeh & Mook, Nonlinear Oscillations (1979), section 5.2: omega = 2 +- sqrt(eps^2 / 4 - c^2), the tip at eps = 2 c.
low, high = (doubling.omega for doubling in rest.bifurcations["PD"])
assert abs((high - low) - 2.0 * math.sqrt(PULSATION**2 / 4.0 - DAMPING**2)) < 2e-3
assert abs(tip.parameters["eps"] - 2.0 * DAMPING) < 1e-3
