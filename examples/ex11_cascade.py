"""How far does the doubling go? The cascade of a strongly forced oscillator between stops: T, 2T, 4T.

    x'' + 2 zeta x' + x + alpha x^3 + Fc(x) = p cos(omega t)

Far above its resonance the response doubles its period; the branch of twice the period doubles again, and so on. Every
branch that leaves is followed to where it meets its parent again, each once.

    python ex11_cascade.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
diagram = so.bifurcation_diagram(oscillator, omega=(4.5, 2.2), depth=2)
print(diagram)  # the tree: which branch leaves which, where, and what is on it

doubled = diagram["2T"].branch
first, last = doubled.bifurcations["PD"]
print(f"4T motions from omega = {last.omega:.8f} to {first.omega:.8f}")

# The same by hand, one branch at a time.
again = so.switch_branch(diagram.root.branch.bifurcations["PD"][0])
assert [item.omega for item in again.bifurcations["PD"]] == [first.omega, last.omega]

diagram.plot(figure_file(), xlim=(2.2, 3.8), ylim=(0.0, 1.7))

# Shooting on the same equations: the 2T motions double their period at omega = 3.02870285 and 2.44814534.
assert abs(first.omega - 3.02870285) < 1e-5
assert abs(last.omega - 2.44814534) < 1e-5
