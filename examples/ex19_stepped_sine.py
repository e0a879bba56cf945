"""A stepped-sine test of a hardening oscillator, as a rig would run it, with noise; and its branch held against time.

    x'' + c x' + x + alpha x^3 = F cos(omega t)

Every point of the response curve is confirmed by shooting. The test then steps up and down: it lies on the stable
parts of the curve and falls, or jumps, where those end.

    python ex19_stepped_sine.py [figure.png]
"""

import math

import suboctave as so
from suboctave.pictures import figure_file

DAMPING, ALPHA, FORCE = 0.1, 1.0, 0.3

oscillator = so.library.duffing(c=DAMPING, alpha=ALPHA, F=FORCE)
curve = so.frequency_response(oscillator, omega=(2.4, 0.6))
check = so.verify(curve, every=3)
print(check)
test = so.stepped_sine(
    oscillator, (0.8, 2.2), values=141, direction=("up", "down"), transient=120, periods=24, noise=0.01
)
print(test)
print(test.to_dataframe().iloc[::20, :4].to_string())

test.plot(figure_file(), curves=curve, size="double-column")

assert check.agrees, check
# One harmonic, as in ex09: the jump down, c omega a = F with omega^2 = 1 + 3/4 alpha a^2. The test falls within one of
# its steps of that, but for terms of order c^2.
y = (-1.0 + math.sqrt(1.0 + 3.0 * ALPHA * (FORCE / DAMPING) ** 2)) / (1.5 * ALPHA)
jump = math.sqrt(1.0 + 0.75 * ALPHA * y)
up = test.amplitude("up")
held = test.omega[up > 0.5 * up.max()].max()
assert abs(held / jump - 1.0) < 0.005 + 0.01 / jump, (held, jump)
