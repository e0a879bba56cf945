"""What a shaker test would show: the jumps of a hardening oscillator, its velocity, and what reaches the ground.

    x'' + c x' + x + alpha x^3 = F cos(omega t)

Swept up in frequency the response climbs along the upper branch and falls at its end; swept down it stays low and jumps
up later. Between the two jumps the answer depends on the direction.

    python ex09_jumps_of_a_sweep.py [figure.png]
"""

import math

import suboctave as so
from suboctave.pictures import figure_file

DAMPING, ALPHA, FORCE = 0.1, 1.0, 0.3

curve = so.frequency_response(so.library.duffing(c=DAMPING, alpha=ALPHA, F=FORCE), omega=(3.0, 0.5))
up, down = curve.sweep_path("up"), curve.sweep_path("down")
print(up, down, sep="\n")
((low, high),) = curve.hysteresis()
print(f"between {low / (2 * math.pi):.5f} and {high / (2 * math.pi):.5f} Hz the direction of the sweep decides")
print(curve.to_dataframe(readings=["velocity", "rms", "phase_1", "transmissibility"]).iloc[::12, -4:].to_string())

curve.plot(figure_file(), quantity="velocity", frequency="Hz", unit="m/s", size="single-column")

# One harmonic, y = a^2: F^2 = y [(1 - omega^2 + 3/4 alpha y)^2 + (c omega)^2]. At the jump down the damping force takes
# up all of the load, c omega a = F with omega^2 = 1 + 3/4 alpha y, but for terms of order c^2. (Any textbook.)
y = (-1.0 + math.sqrt(1.0 + 3.0 * ALPHA * (FORCE / DAMPING) ** 2)) / (1.5 * ALPHA)
expected = math.sqrt(1.0 + 0.75 * ALPHA * y)
assert abs(up.jumps[0].value / expected - 1.0) < 0.005, (up.jumps[0].value, expected)
