"""What every part of a Genie has to keep: similarity, eviction and confidence rule in a whole
run. One of your own is tested by

@pytest.mark.parametrize("genie", [{"eviction": "my_module:MyEviction", "capacity": "5 entries"}])
class TestMine(GeniePartConformance):
    pass
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from genie_sim.base.settings import from_plain, plain_data
from genie_sim.scenario.scenario import Scenario
from tests.conformance import small


class GeniePartConformance:
    """``genie``: the settings that name the part, as in YAML."""

    def scenario(self, genie: dict[str, Any], methods: Sequence[Any] = ("genie",)) -> Scenario:
        """Cars so slow that caches have hits."""
        street = {"source": "tests.conformance.own:Street", "speed_mps": 1.0}
        return small.scenario(methods, genie=genie, perception=street)

    def test_every_frame_is_answered_or_dropped_whatever_ran_before(self, genie: dict[str, Any]):
        slower = {"name": "slower", "method": "genie", "model": "yolov8m"}
        written = small.check_order_is_irrelevant(
            lambda methods: self.scenario(genie, methods), ["genie", slower]
        )
        small.check_conserved(written["frames"].to_frame(), ["genie", "slower", "again"])

    def test_it_is_written_down_as_it_was_read(self, genie: dict[str, Any]):
        scenario = self.scenario(genie)
        assert from_plain(type(scenario), plain_data(scenario)) == scenario
