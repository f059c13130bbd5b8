"""An object of the map: when it counts as parked."""

import pytest

from genie_sim.core.messages import Detection
from genie_sim.core.stored_object import StoredObject

S = 1_000_000_000


@pytest.mark.parametrize(("seen_ns", "parked"), [(0, False), (S - 1, False), (S, True)])
def test_what_is_seen_at_its_place_for_a_second_is_parked(seen_ns: int, parked: bool):
    place = (1.0, 2.0, 0.5)
    seen = Detection("car", 0.6, None, place, 0.7)
    stored = StoredObject(3, seen, place, 5 * S)
    assert (stored.number, stored.score, stored.confidence) == (3, 0.6, 0.7)
    assert stored.location == place and not stored.parked
    stored.seen_ns += seen_ns
    assert stored.parked is parked
