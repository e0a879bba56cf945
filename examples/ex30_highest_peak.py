"""The resonance peak over a tolerance: how high may it become, and where is it lowest?

A vibration absorber of a twentieth of the mass, on a mass that a load shakes. How much its damping matters is asked of
the ridge, the curve of the resonance peaks over the damping: one computation in place of a response for every value.
Where the peaks are lowest is an event of that curve. Beside it the backbone of a Duffing oscillator over its load, by
phase resonance, and its peaks.

    python ex30_highest_peak.py [figure.png]
"""

import numpy as np

import suboctave as so
from suboctave.pictures import figure_file

m, f = 0.05, 1.0 / 1.05  # mass of the absorber, and its frequency as den Hartog tunes it
absorber = so.System(
    np.diag([1.0, m]),
    {"zeta": 2.0 * m * f * np.array([[1.0, -1.0], [-1.0, 1.0]])},
    [[1.0 + m * f**2, -m * f**2], [-m * f**2, m * f**2]],
    loads=[so.HarmonicLoad(0, 1.0)],
    parameters={"zeta": 0.1},
)
response = so.frequency_response(absorber, (0.93, 1.15), harmonics=1)
ridge = so.track_peak(response, "zeta", (0.05, 0.3))
(lowest,) = [event for event in ridge.extrema if event.parameter_name == "amplitude"]
print(ridge)
print(f"lowest peak {lowest.amplitude:.5f} at zeta = {lowest.parameters['zeta']:.5f}")

duffing = so.library.duffing(c=0.05, alpha=1.0, F=0.1)
curve = so.frequency_response(duffing, (0.7, 2.0))
backbone = so.phase_resonance(duffing, parameter="F", bounds=(0.01, 0.3), omega=(0.7, 2.0))
peaks = so.track_peak(curve, "F", (0.01, 0.3))
ends = [float(np.interp(0.2, one.parameter("F"), one.amplitude)) for one in (backbone, peaks)]
print(f"F = 0.2: in quadrature {ends[0]:.5f}, highest {ends[1]:.5f}")

labels = ["response", "in quadrature", "highest"]
so.plot([curve, backbone, peaks], figure_file(), x="omega", labels=labels, size="double-column")

# den Hartog: of this tuning the peaks are lowest where they are as high as the points that all responses pass.
assert abs(lowest.amplitude - np.sqrt(1.0 + 2.0 / m)) < 1e-6
