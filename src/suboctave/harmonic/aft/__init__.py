"""Laws along a motion (alternating frequency/time): Fourier coefficients of forces and tangents, and their derivatives.

`law` states the contract. One class per kind of law: `pieces` (exact contact, in closed form), `polynomial`, `steps`
(contact rounded by arctan steps), `sampled` (any law of one displacement and its rate), `general` (several inputs,
time, corners). `table` sorts the laws of a direction by these kinds, `channel` adds up what acts along it.
"""
