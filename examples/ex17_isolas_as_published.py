"""Where does an isola begin, if not at the largest gap of the period doublings? The published way, step by step.

Alcorta et al. (Nonlinear Dynamics 98, 2019, sections 3.6 and 5.2) follow the period doublings over the gap j, take the
largest gap on that curve for a generalised period doubling (GPD), and from there follow limit points in the basis of
twice the period, expecting those of the isola. But in that basis every period doubling of the plain motion is a limit
point: the Jacobian consists of J_0 and J_half, and the second is singular all along the curve. Limit points followed
from there are the period doublings once more, and their largest gap is the one known.

`find_isolas` follows limit points of motions that have a sub-harmonic part. The isola joins the doubled branch a little
below the largest gap; the curve of its limit points then has a cusp, and ends on the period doublings in a GPD that is
no extremum.

    python ex17_isolas_as_published.py [figure.png]
"""

from dataclasses import replace

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(p=0.55, regularization=3000.0)

# Steps 1 to 3: a period doubling, its curve, the extremum by the published system.
response = so.frequency_response(system, omega=(4.05, 3.9))
border = so.track(response.bifurcations["PD"][0], parameter="j", bounds=(0.0, 1.0))
(largest,) = (e for e in border.extrema if e.parameter_name == "j")
largest = so.locate_extremum(largest, formulation="alcorta2019")
print(f"largest gap of the period doublings   omega = {largest.omega:.6f}, j = {largest.parameter('j'):.6f}")


# Step 4: the same motion in the basis of twice the period, as a limit point from which to follow others.
def as_doubled(orbit):
    """A motion of the load's period written as one of twice that period."""
    basis = orbit.basis.doubled
    x = orbit.basis.resized(orbit.x, basis)
    balance = orbit.balance.with_basis(basis).settle(x, orbit.omega, orbit.values)
    return replace(orbit, balance=balance, x=x)


def singularity(orbit):
    """Smallest singular value of the Jacobian in units of the largest: zero at a limit point."""
    values = np.linalg.svd(orbit.state().jacobian, compute_uv=False)
    return values[-1] / values[0]


taken = as_doubled(largest.orbit)
start = so.Bifurcation("LP", taken, largest.floquet, largest.residual, largest.amplitude, "omega")
try:
    so.track(start, parameter="j", bounds=(0.0, 1.0))
    refused = ""
except so.InputError as why:
    refused = str(why)
print(f"limit points from there: {refused}")
along = border.orbits[::6]
plain, doubled = ([singularity(orbit) for orbit in orbits] for orbits in (along, [as_doubled(o) for o in along]))
print(f"J along the period doublings: at least {min(plain):.0e} as they are, at most {max(doubled):.0e} as 2T motions")

# What is right.
isolas = so.find_isolas(system, omega=(1.9, 4.2), parameter="j", bounds=(0.0, 1.0), values=2)
(isola,) = isolas
(folds,) = (curve for curve in isolas.limit_points if curve.bifurcations["CP"])
(cusp,), (gpd,) = folds.bifurcations["CP"], folds.bifurcations["GPD"]
print(isola)
for name, item in (("cusp", cusp), ("GPD", gpd)):
    print(f"{name} of its limit points  omega = {item.omega:.6f}, j = {item.parameter('j'):.6f}")

# finely, where all of this happens
window, gaps = (2.015, 2.04), (0.174, 0.1776)
doubling = so.frequency_response(system.with_parameters({"j": 0.1745}), omega=window).bifurcations["PD"][0]
fold = min(isola.at(0.1775).bifurcations["LP"], key=lambda item: item.omega)
near = [so.track(item, "j", gaps, omega=window, max_step=0.05) for item in (doubling, fold)]
so.plot(near, figure_file(), size="double-column", xlim=window, ylim=gaps, marks=["CP", "GPD", "extremum"])

# Shooting (no harmonic balance): four different points.
for item, expected in (
    (largest, (2.021701, 0.177129)),
    (isola.merges, (2.023364, 0.176829)),
    (isola.born, (2.355660, 0.579889)),
    (cusp, (2.022540, 0.176778)),
):
    assert np.allclose((item.omega, item.parameter("j")), expected, rtol=0.0, atol=2e-6), item
# The GPD lies beside them all, where the criticality of the doublings changes.
assert np.allclose((gpd.omega, gpd.parameter("j")), (2.0364, 0.17472), rtol=0.0, atol=5e-5), gpd
assert "repeats earlier" in refused
assert max(doubled) < 1e-6 < 1e-4 < min(plain)
