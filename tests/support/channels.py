"""One element along a motion of its own displacement."""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.aft.channel import Channel, Group
from suboctave.harmonic.aft.law import Along, CoefficientSpectra, Member
from suboctave.harmonic.aft.table import DirectionLaws


def channel_of(element, motion, top: int, samples: int | None = None) -> Channel:
    """The channel of an element whose displacement has complex coefficients (H + 1,), at the base frequency 1."""
    c = element.coefficient_values({})
    group = Group(np.ones(1), np.ones((1, 1)), (0,), element.depends_on_velocity)
    along = Along(np.ascontiguousarray(motion, dtype=complex)[None], 1.0, 1, group.moving, top)
    laws = DirectionLaws.of((Member(0, element, element.sampling(c), c, samples),))
    return Channel(group, along, laws.along(along))


def by_coefficients(channel: Channel) -> CoefficientSpectra:
    """Derivatives by the coefficients of its only element."""
    ((member, law),) = channel.members()
    return channel.coefficient_spectra(member, law)
