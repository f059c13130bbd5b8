"""What every method has to keep. One of your own is tested by

@pytest.mark.parametrize("method", ["my_module:MyMethod"])
class TestMine(MethodConformance):
    pass
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import pyarrow as pa
import pytest

from genie_sim.base.settings import from_plain
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.scenario import Scenario
from tests.conformance import small

SETTINGS: dict[str, dict[str, Any]] = {
    "usual": {},
    "lossy": {"cars": [small.car(1, link={"like": "wifi", "loss": 0.2}), small.car(2, link="lte")]},
    "long queues": {"queue_length": 3},
    "outage": {
        "faults": [{"fault": "outage", "target": "edge1", "begin": "500 ms", "end": "900 ms"}]
    },
    "one edge": {"cars": [small.car(1), small.car(2, edge="edge1")]},
}


class MethodConformance:
    """A method, by its name in scenarios, against the same small worlds as every other."""

    beside: ClassVar[tuple[str, ...]] = small.ALL

    def scenario(self, methods: Sequence[Any], **settings: Any) -> Scenario:
        return small.scenario(methods, **settings)

    @pytest.mark.parametrize("setting", SETTINGS)
    def test_every_frame_is_answered_or_dropped(self, method: str, setting: str):
        name = from_plain(MethodEntry, method).name
        rows = small.frames(self.scenario([method], **SETTINGS[setting]))
        small.check_conserved(rows, [name])
        assert rows["first_answer_ns"].notna().any(), "it never answers"

    def test_what_a_node_looks_up_is_told_where_it_runs(self, method: str):
        lookups = small.tables(self.scenario([method]))["lookups"]
        hosts = lookups["genie"].str.extract(r"^(car|edge)\d/")[0]
        assert hosts.equals(lookups["placement"].rename(0))

    def test_twice_the_same(self, method: str):
        small.check_twice_the_same(self.scenario([method], **SETTINGS["lossy"]))

    def test_alone_or_between_others(self, method: str):
        """It takes no random number of another method, leaves nothing behind, and finds nothing."""
        name, lossy = from_plain(MethodEntry, method).name, SETTINGS["lossy"]
        first, *others = [one for one in self.beside if one != method]

        def tables(*methods: str) -> dict[str, pa.Table]:
            return small.arrow(small.simulated(self.scenario(methods, **lossy)))

        found, without = tables(first, method, *others), tables(first, *others)
        small.same(small.of(name, tables(method)), small.of(name, found))
        for other in (first, *others):
            small.same(small.of(other, without), small.of(other, found))

    def test_settings_of_an_entry_hold_for_that_entry_only(self, method: str):
        name = from_plain(MethodEntry, method).name
        slower = {"name": "slower", "method": method, "model": "yolov8m", "queue_length": 4}
        plain = {"name": "slower", "method": method}
        alone, both, by_hand = (
            small.arrow(small.simulated(one))
            for one in (
                self.scenario([method]),
                self.scenario([slower, method]),
                self.scenario([plain], model="yolov8m", queue_length=4),
            )
        )
        small.same(small.of(name, alone), small.of(name, both))
        small.same(small.of("slower", by_hand), small.of("slower", both))
        other, mine = (small.of(one, both)["frames"] for one in ("slower", name))
        assert other["first_answer_ns"] != mine["first_answer_ns"], "the settings change nothing"

    def test_it_says_what_it_is(self, method: str):
        entry = from_plain(MethodEntry, method)
        made = entry.new()
        fact = entry.facts(made)
        assert fact == {
            "name": entry.name,
            "title": made.title,
            "baseline": made.baseline,
        }
        assert made.title and isinstance(made.baseline, bool)
