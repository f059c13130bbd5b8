"""What every method has to keep. One of your own is tested by

@pytest.mark.parametrize("method", ["my_module:MyMethod"])
class TestMine(MethodConformance):
    pass
"""

from __future__ import annotations

import functools
from typing import Any

import pytest

from genie_sim.base.settings import from_plain
from genie_sim.record.records import Tables
from genie_sim.scenario.methods import MethodEntry
from tests.conformance import small

SETTINGS: dict[str, dict[str, Any]] = {
    "usual": {},
    "lossy, long queues": {
        "cars": [small.car(1, link={"like": "wifi", "loss": 0.2}), small.car(2, link="lte")],
        "queue_length": 3,
    },
    "one edge, outage": {
        "cars": [small.car(1), small.car(2, edge="edge1")],
        "faults": [{"fault": "outage", "target": "edge1", "begin": "500 ms", "end": "900 ms"}],
    },
}


@functools.cache
def run(setting: str, *methods: str) -> Tables:
    """What these methods give in a setting."""
    return small.simulated(small.scenario(methods, **SETTINGS[setting]))


class MethodConformance:
    """A method, by its name in scenarios, against the same small worlds as every other."""

    @pytest.mark.parametrize("setting", SETTINGS)
    def test_every_frame_is_answered_or_dropped(self, method: str, setting: str):
        rows = run(setting, method)["frames"].to_frame()
        small.check_conserved(rows, [from_plain(MethodEntry, method).name])
        assert rows["first_answer_ns"].notna().any(), "it never answers"

    def test_what_a_node_looks_up_is_told_where_it_runs(self, method: str):
        lookups = run("usual", method)["lookups"].to_frame()
        hosts = lookups["genie"].astype(str).str.extract(r"^(car|edge)\d/", expand=False)
        assert hosts.tolist() == lookups["placement"].tolist()

    def test_alone_or_between_others(self, method: str):
        """It takes no random number of another method, leaves nothing behind, and finds nothing."""
        name = from_plain(MethodEntry, method).name
        first, *others = [other for other in small.ALL if other != method]
        alone, between, without = (
            small.rows(run("lossy, long queues", *methods))
            for methods in ([method], [first, method, *others], [first, *others])
        )
        small.same(small.of(name, alone), small.of(name, between))
        for other in (first, *others):
            small.same(small.of(other, without), small.of(other, between))

    def test_settings_of_an_entry_hold_for_that_entry_only(self, method: str):
        name = from_plain(MethodEntry, method).name
        plain = {"name": "slower", "method": method}
        slower = {**plain, "model": "yolov8m", "queue_length": 4}
        by_hand = small.scenario([plain], model="yolov8m", queue_length=4)
        alone, both, by_hand = map(
            small.rows,
            (
                run("usual", method),
                small.simulated(small.scenario([slower, method])),
                small.simulated(by_hand),
            ),
        )
        small.same(small.of(name, alone), small.of(name, both))
        small.same(small.of("slower", by_hand), small.of("slower", both))
        other, mine = (
            [row["first_answer_ns"] for row in small.of(entry, both)["frames"]]
            for entry in ("slower", name)
        )
        assert other != mine, "the settings change nothing"

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
