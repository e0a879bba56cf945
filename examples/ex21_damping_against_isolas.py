"""How much damping keeps a structure clear of isolated resonances?

The rattling oscillator has an isolated resonance at twice the period of its load for gaps between the one at which it
merges with the rest and the one at which it is born. Both move with the damping, and where they meet there is no isola
any more, at any gap. Such a resonance lies on no sweep: a map of it has to be followed, not measured.

    python ex21_damping_against_isolas.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(regularization=3000.0)
isolas = so.find_isolas(system, omega=(1.3, 4.5), parameter="j", bounds=(0.0, 1.0), values=[0.1])
regions = so.isola_map(isolas, parameter="zeta", bounds=(0.02, 0.2))
print(regions)

regions.plot(
    figure_file(), title="Isolated 2T resonance of the rattling oscillator", xlabel="damping ratio", ylabel="gap j"
)

# Shooting (no harmonic balance) has birth and merging at these gaps for zeta = 0.03.
((low, high),) = regions.ranges(0.03)
assert abs(low - 0.176829) < 1e-5, low
assert abs(high - 0.579889) < 1e-5, high
# In the middle of the region closed branches exist; nothing that the map rests on knows of them.
(region,) = regions.regions
assert all(probe.agrees for probe in region.probes)
assert region.span.closed == (False, True)
