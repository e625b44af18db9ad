"""The probes of discovery: the sizes at which an effect is tried."""

from __future__ import annotations

import pytest
from brickpilot import catalogue
from brickpilot.discover.parts import Excitation, Part, limit_of
from brickpilot.discover.screen import probes_of
from brickpilot.vehicle.model import rcx

LIMITED = [
    (effect.name, one)
    for effect in catalogue.effects()
    for one in effect.parameters
    if one.role == "limit" and one.limits
]


@pytest.mark.parametrize(("effect", "limit"), LIMITED, ids=lambda one: one if isinstance(one, str) else one.name)
def test_limit_is_tried_only_within_its_range(effect, limit):
    part = Part(effect, (limit.name,), {})
    assert limit_of(part) == limit
    for largest in (0.0, 0.5 * limit.minimum, 1.5 * limit.minimum, 0.5 * limit.maximum):
        tried = probes_of(part, rcx(), Excitation({limit.limits: largest}))
        sizes = [values[limit.name] for probe in tried for values in probe.values]
        assert all(limit.minimum <= size <= limit.maximum for size in sizes)
        assert bool(sizes) == (largest >= limit.minimum and largest > 0)
