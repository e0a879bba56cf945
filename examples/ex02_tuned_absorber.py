"""A Duffing oscillator with a nonlinear tuned absorber: a flattened resonance with quasi-periodic motions inside.

The absorber splits the resonance into two low peaks of about equal height. Between two Neimark-Sacker points the
periodic motion is unstable: its amplitude begins to beat at a second frequency, kappa, that has nothing to do with
that of the force. The narrow tongue beyond holds two limit points.

    python ex02_tuned_absorber.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

FORCE = 0.11
OMEGA = (0.9, 1.35)

curve = so.frequency_response(so.library.nltva(F=FORCE), OMEGA, max_step=0.05)
print(curve)

for point in curve.bifurcations["NS"]:
    beat = point.omega / point.kappa
    print(f"beating begins at omega = {point.omega:.5f}, once in {beat:.1f} periods of the force")

curve.plot(figure_file())

# Shooting finds 1.1096015201. The system is that of Detroux, Habib, Masset, Kerschen, Mechanical Systems and Signal
# Processing 60-61 (2015).
first = min(point.omega for point in curve.bifurcations["NS"])
assert abs(first - 1.1096015201) < 1e-6, first
