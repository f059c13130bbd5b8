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
    "one edge, lossy links, long queues, outage": {
        "cars": [
            small.car(1, link={"like": "wifi", "loss": 0.2}),
            small.car(2, link="lte", edge="edge1"),
        ],
        "queue_length": 3,
        "faults": [{"fault": "outage", "target": "edge1", "begin": "500 ms", "end": "900 ms"}],
    },
}
SLOWER = {"model": "yolov8m", "queue_length": 4}


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
        """It takes no random number of another entry, leaves nothing behind, and finds nothing; its
        own settings hold for that entry only.
        """
        name = from_plain(MethodEntry, method).name
        first, last, *_ = [other for other in small.ALL if other != method]
        plain = {"name": "slower", "method": method}
        between, by_hand = (
            small.rows(small.simulated(scenario))
            for scenario in (
                small.scenario([first, {**plain, **SLOWER}, method, last]),
                small.scenario([plain], **SLOWER),
            )
        )
        alone, others = (small.rows(run("usual", *names)) for names in ([method], [first, last]))
        apart = {name: alone, "slower": by_hand, first: others, last: others}
        for entry, expected in apart.items():
            small.same(small.of(entry, expected), small.of(entry, between))
        other, mine = (
            [row["first_answer_ns"] for row in small.of(entry, between)["frames"]]
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
