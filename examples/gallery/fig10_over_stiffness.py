"""Alcorta et al. 2019, Fig. 10: the period doublings over frequency and contact stiffness under strong forcing.

Both curves of doublings have a lowest point: the first just above zero stiffness, where the stops vanish, the second
far above.

    python fig10_over_stiffness.py [plane.png [space.png]]
"""

import suboctave as so
from suboctave.pictures import figure_file

STIFFNESS = (0.0, 6.0)

oscillator = so.library.reference_oscillator(p=1.7, regularization=3000.0)
response = so.frequency_response(oscillator, omega=(4.2, 2.2))
doubled = so.switch_branch(response.bifurcations["PD"][0])
first = so.track(response.bifurcations["PD"][0], "Kc", STIFFNESS)
second = so.track(doubled.bifurcations["PD"][0], "Kc", STIFFNESS)
lowest = [next(e for e in curve.extrema if e.parameter_name == "Kc") for curve in (first, second)]
for curve in (first, second):
    print(curve)

figure = so.plot([first, second], size="double-column", ylim=(0.0, 6.0))
for x, stiffness, name in ((2.1, 4.0, "T"), (3.8, 2.4, "T"), (2.7, 1.7, "2T"), (2.75, 5.0, "4T and longer")):
    figure.axes[0].text(x, stiffness, name, ha="center", fontsize=8)
figure.axes[0].plot(2.6, 4.2, "k+")
figure.axes[0].text(2.62, 4.1, "B", fontsize=8)
figure.savefig(figure_file(), dpi=300)
systems = [oscillator.with_parameters({"Kc": stiffness}) for stiffness in (2.0, 3.0, 4.5, 6.0)]
diagrams = [so.bifurcation_diagram(system, omega=(4.4, 2.22)) for system in systems]
so.plot_space([*diagrams, first, second], figure_file(2), size="double-column")

# Shooting (no harmonic balance).
for found, expected in zip(lowest, ((2.15720393, 0.22363402), (2.520651, 2.92809977)), strict=True):
    assert abs(found.omega - expected[0]) < 1e-5, found
    assert abs(found.parameter("Kc") - expected[1]) < 1e-6, found
