"""What every fault has to keep. One of your own is tested by

@pytest.mark.parametrize("fault", [{"fault": "my_module:MyFault", "target": "edge1"}])
class TestMine(FaultConformance):
    drops = "edge1:mine"
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, ClassVar

import pandas as pd

from genie_sim.record.records import Tables
from genie_sim.scenario.scenario import Scenario
from tests.conformance import small

S = 1_000_000_000
BEGIN_NS, END_NS = round(0.5 * S), round(1.1 * S)
Times = list[tuple[int, int | None]]  # when faults began and ended


def scenario(faults: Sequence[dict[str, Any]], methods: Sequence[Any]) -> Scenario:
    street = {"source": "tests.conformance.own:Street", "seconds": 2.0}
    return small.scenario(methods, perception=street, faults=list(faults))


@functools.cache
def without_faults(methods: tuple[Any, ...]) -> pd.DataFrame:
    """The frames of the same street on which nothing goes wrong."""
    return small.frames(scenario([], methods))


def times_of(written: Tables, method: str) -> Times:
    rows = written["faults"].to_frame()
    rows = rows[rows["method"] == method]
    return list(zip(rows["begin_ns"].tolist(), rows["end_ns"].tolist(), strict=True))


class FaultConformance:
    """A fault, as in YAML without its times. ``drops`` is in the ``drop`` of frames that it loses
    under some method.
    """

    drops: ClassVar[str | None] = None
    times: ClassVar[dict[str, str]] = {"begin": "0.5 s", "end": "1.1 s"}
    methods: ClassVar[tuple[str, ...]] = small.ALL

    def test_it_keeps_frames_and_methods_apart(self, fault: dict[str, Any]):
        """Every frame is answered or dropped, every method meets the fault at its times and in the
        same way whatever ran before, and what was before the fault is as if it never happened.
        """
        timed = {**fault, **self.times}
        written = small.check_order_is_irrelevant(
            lambda methods: scenario([timed], methods), self.methods
        )
        rows = written["frames"].to_frame()
        small.check_conserved(rows, self.methods)
        if self.drops is not None:
            assert rows["drop"].str.contains(self.drops, regex=False).any(), "it loses nothing"
        for method in self.methods:
            assert times_of(written, method) == [(BEGIN_NS, END_NS)]
        before = without_faults(self.methods)
        for name in ("first_answer_ns", "fresh_answer_ns", "result_answer_ns"):
            for method in self.methods:
                one, other = (
                    frames[(frames["method"] == method) & (frames[name] < BEGIN_NS)][name].tolist()
                    for frames in (rows, before)
                )
                assert one == other, f"{method}: {name}"
        assert (before["first_answer_ns"] < BEGIN_NS).any()

    def test_nothing_is_down_when_it_is_over(self, fault: dict[str, Any]):
        world, _ = small.world(scenario([{**fault, **self.times}], self.methods[-1:]))
        world.run()
        assert not world.network.outages
        assert not any(link.cut_by for link in world.network.links.values())


class RandomFaultConformance:
    """A fault that may come again and again, at random times."""

    methods: ClassVar[tuple[str, ...]] = small.ALL
    times: ClassVar[dict[str, str]] = {"mean_time_between": "300 ms", "mean_duration": "200 ms"}

    def test_it_comes_at_random_times_of_its_own(self, fault: dict[str, Any]):
        timed, (first, *_) = {**fault, **self.times}, self.methods
        written = small.simulated(small.scenario(self.methods, faults=[timed]))
        small.check_conserved(written["frames"].to_frame(), self.methods)
        times, *others = (times_of(written, method) for method in self.methods)
        assert all(of_other == times for of_other in others), "the same under every method"
        instants = [instant for span in times for instant in span]
        assert len(times) >= 2 and instants == sorted(instants), "each ends before the next"
        other_seed = small.simulated(small.scenario([first], faults=[timed], seed=2))
        assert times_of(other_seed, first) != times, "another seed, other times"
        both = times_of(small.simulated(small.scenario([first], faults=[timed] * 2)), first)
        assert len(both) > len(times) and set(times) < set(both), "another fault has times apart"
