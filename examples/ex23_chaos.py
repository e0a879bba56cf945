"""Is it chaos? The exponents of a motion that never repeats, by the derivative of its flow and by two trajectories.

An oscillator with a stop on one side and another one further away, driven hard. Neighbouring motions part by a factor
of 1.4 in every period of the load.

    python ex23_chaos.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

ZETA = 0.03

system = so.library.reference_oscillator(p=1.6, Kc=4.2, j=0.0, zeta=ZETA)
found = so.lyapunov_exponents(system, omega=2.6, periods=400)
print(found)
print(f"dimension of the attractor in the section: {found.dimension:.3f}")
by_two = so.lyapunov_exponents(
    system, omega=2.6, method=so.TwoTrajectories(steps_per_period=tuple(range(300, 500, 10)), periods=200)
)
print(by_two)

found.plot(figure_file())

# All exponents together are the rate at which volumes of states shrink: -2 zeta, whatever the motion (Liouville).
assert abs(found.exponents.sum() + 2.0 * ZETA) < 1e-9
assert found.chaotic
# One value by two trajectories is uncertain by its spread; their mean agrees.
assert abs(by_two.exponent - found.exponents[0]) < 4.0 * by_two.spread / 20**0.5 + 4.0 * found.standard_errors[0]
