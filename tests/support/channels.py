"""One element along a motion of its own displacement."""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.aft.channel import Channel, Group, laws_along
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, Member


def channel_of(element, motion, top: int, samples: int | None = None) -> Channel:
    """The channel of an element whose displacement has complex coefficients (H + 1,), at the base frequency 1."""
    c = element.coefficient_values({})
    group = Group(np.ones(1), np.ones((1, 1)), (0,), element.depends_on_velocity)
    along = Along(np.ascontiguousarray(motion, dtype=complex)[None], 1.0, 1, group.moving, top)
    return Channel(group, along, laws_along(along, [Member(0, element, element.sampling(c), c, samples)]))


def by_coefficients(channel: Channel) -> CoefficientSpectra:
    """Derivatives by the coefficients of its only element."""
    (law,) = channel.laws
    return law.by_coefficients(law.members[0])
