"""The reference curves list the events that are recorded of them, in both directions."""

from __future__ import annotations

import pytest
from event_tables import against_recorded, of_completeness

CURVES = of_completeness()


@pytest.mark.parametrize("name", CURVES)
def test_recorded(name):
    assert not against_recorded(name, CURVES[name]())
