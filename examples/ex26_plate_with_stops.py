"""A plate with a clearance: 1040 degrees of freedom, a stop at one of them, and where the vibration doubles its period.

A cantilever plate of finite elements meets a stop in the middle of its free edge, once per two load periods where the
load is about twice as fast as the first resonance. The response doubles its period, the motions of twice the period
reach far above it and far beyond the range of the doubling, and the border of that range in frequency and gap says how
far the stop must be moved away so that no doubling is left.

    python ex26_plate_with_stops.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

# no units: mass and first natural frequency are 1
system = so.structures.clearance_plate(nx=20, ny=12, stops=1, Kc=1.0, gap=0.1, p=0.2)
print(system)
(stop,) = system.elements
touched = int(stop.direction(system.n).argmax())

response = so.frequency_response(system, omega=(2.8, 2.0), observe=touched)
print(response)
doubling = response.bifurcations["PD"][0]
doubled = so.switch_branch(doubling)
print(doubled)
border = so.track(doubling, parameter="gap", bounds=(0.09, 0.2))
print(border)
farthest = next(event for event in border.extrema if event.parameter_name == "gap")
print(f"no vibration doubles its period beyond the gap {farthest.parameter('gap'):.5f} (omega = {farthest.omega:.4f})")

so.plot([response, doubled], figure_file(), labels=["T", "2T"])

# by shooting, with the fourteen lowest modes and what stop and load deflect: 2.29943
assert abs(doubling.omega - 2.29943) < 5e-5, doubling.omega
