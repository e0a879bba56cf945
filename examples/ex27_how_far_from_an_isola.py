"""Which tolerance matters to an isolated resonance, and how far is the design from one without it?

The rattling oscillator at a gap of 0.5 has an isolated resonance of twice the period. Its birth says by how much each
parameter moves the gap at which it vanishes; the margin is the smallest change of damping, stiffness and load with
which it is gone.

    python ex27_how_far_from_an_isola.py [figure.png]
"""

import suboctave as so
from suboctave.pictures import figure_file

system = so.library.reference_oscillator(p=0.55, j=0.5)
where = {"omega": (1.3, 4.5), "parameter": "j", "bounds": (0.0, 1.0), "harmonics": 15, "values": 2}
(isola,) = so.find_isolas(system, **where)
effects = so.sensitivity(isola.born)
print(effects)
(strongest, *_) = effects.ranked("j")
print(f"one per cent of {strongest} moves the birth by {effects.per_cent(strongest, 'j'):.3g} per cent of the gap")

margin = so.design_margin(isola, by=[strongest])
together = so.design_margin(isola, by=["zeta", "Kc", "p"])
print(margin)
print(together)

isola.plot(figure_file(), values=[0.3, 0.5])

# Shooting (no harmonic balance) puts the birth at this gap.
assert abs(isola.born - 0.581107) < 2e-6, isola.born
# It is damping, and a per cent more of it takes 0.77 per cent off the gap at which the isola is born.
assert strongest == "zeta", strongest
assert abs(effects.per_cent("zeta", "j") + 0.767) < 1e-3
# A search that knows nothing of the margin finds the isola just before it, and none just beyond.
near = where | {"omega": (1.9, 3.0), "bounds": (0.45, 0.55)}
for share, there in ((0.97, True), (1.03, False)):
    changed = {name: margin.design[name] + share * change for name, change in margin.changes.items()}
    assert any(0.5 in found for found in so.find_isolas(system.with_parameters(changed), **near)) == there
# No combination of changes is smaller than the one of all together.
assert together.distance < margin.distance
