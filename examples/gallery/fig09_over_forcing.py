"""Alcorta et al. 2019, Fig. 9: the period doublings over frequency and forcing amplitude, one gap closed.

The first doubling, T to 2T, happens at any forcing. The second, 2T to 4T, needs a strong one: its curve has a lowest
point.

    python fig09_over_forcing.py [plane.png [space.png]]
"""

import suboctave as so
from suboctave.pictures import figure_file

FORCING = (0.05, 2.0)

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(4.2, 2.2))
doubled = so.switch_branch(response.bifurcations["PD"][0])
first = [so.track(doubling, "p", FORCING) for doubling in response.bifurcations["PD"]]
second = so.track(doubled.bifurcations["PD"][0], "p", FORCING)
lowest = min((e for e in second.extrema if e.parameter_name == "p"), key=lambda e: e.parameter("p"))
for curve in (*first, second):
    print(curve)

figure = so.plot([*first, second], size="double-column", xlim=(2.1, 4.4), ylim=(0.0, 2.0))
for x, p, name in ((2.2, 0.9, "T"), (4.2, 0.9, "T"), (3.1, 0.6, "2T"), (2.8, 1.75, "4T and longer")):
    figure.axes[0].text(x, p, name, ha="center", fontsize=8)
figure.axes[0].plot(2.6, 1.6, "k+")
figure.axes[0].text(2.62, 1.55, "B", fontsize=8)
figure.savefig(figure_file(), dpi=300)
systems = [oscillator.with_parameters({"p": p}) for p in (0.5, 1.0, 1.5, 2.0)]
diagrams = [so.bifurcation_diagram(system, omega=(4.4, 2.25)) for system in systems]
so.plot_space([*diagrams, *first, second], figure_file(2), size="double-column")

# Shooting (no harmonic balance): the lowest point of the second curve. The first one spans all of the range.
assert abs(lowest.omega - 2.81934917) < 1e-5
assert abs(lowest.parameter("p") - 1.20535208) < 1e-6
assert all(sorted(curve.parameter("p")[[0, -1]]) == sorted(FORCING) for curve in first)
