"""Which of two motions will a start lead to? Basins of a hardening oscillator between its jumps.

    x'' + c x' + x + alpha x^3 = F cos(omega t)

Two stable motions, a large and a small one, at the same load. Their basins wind about each other, and the unstable
motion in between lies on their border.

    python ex24_basins.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

OMEGA = 1.5

system = so.library.duffing(c=0.1, alpha=1.0, F=0.3)
response = so.frequency_response(system, omega=(3.0, 0.5))
found = so.basins(system, omega=OMEGA, box=((-2.5, 2.5), (-3.0, 3.0)), grid=(80, 80), attractors={"response": response})
print(found)
print(found.to_dataframe().to_string(index=False))

found.plot(figure_file())

# Nothing but the two stable motions of the response attracts, and what was stopped early ended as foretold.
assert len(found.attractors) == 2
assert found.contradicted == 0
assert abs(sum(found.shares.values()) - 1.0) < 1e-12
# Trajectories of 400 periods end where the basins say.
cells = [(8, 10), (23, 60), (40, 40), (55, 31), (71, 66)]
states = [[found.x[i], found.y[j]] for i, j in cells]
sections = so.poincare_sections(system, start=states, omega=OMEGA, transient=400, periods=6)
for number, (i, j) in enumerate(cells):
    expected = found.attractors[found.labels[j, i]]
    assert abs(sections.attractor(number).amplitude - expected.amplitude) < 1e-4
