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
from genie_sim.sim.world import World
from tests.conformance import small

S = 1_000_000_000
BEGIN_NS, END_NS = round(0.5 * S), round(1.1 * S)
Times = list[tuple[int, int | None]]  # when faults began and ended


def scenario(faults: Sequence[dict[str, Any]], methods: Sequence[Any]) -> Scenario:
    street = {"source": "tests.conformance.own:Street", "seconds": 2.0}
    return small.scenario(methods, perception=street, faults=list(faults))


@functools.cache
def without_faults() -> pd.DataFrame:
    """The frames of the same street on which nothing goes wrong."""
    return small.frames(scenario([], small.ALL))


def times_of(written: Tables, method: str) -> Times:
    rows = written["faults"].to_frame()
    rows = rows[rows["method"] == method]
    return list(zip(rows["begin_ns"].tolist(), rows["end_ns"].tolist(), strict=True))


class NothingDown:
    """Sees to it that no link is down when a run is over."""

    def before(self, method: str, world: World) -> None:
        pass

    def after(self, method: str, world: World) -> None:
        assert not world.network.outages, method
        assert not any(link.cut_by for link in world.network.links.values()), method


class FaultConformance:
    """A fault, as in YAML without its times. ``drops`` is in the ``drop`` of frames that it loses
    under some method.
    """

    drops: ClassVar[str | None] = None
    times: ClassVar[dict[str, str]] = {"begin": "0.5 s", "end": "1.1 s"}

    def test_it_keeps_frames_and_methods_apart(self, fault: dict[str, Any]):
        """Every frame is answered or dropped, every method meets the fault at its times and in the
        same way whatever ran before, and what was before the fault is as if it never happened. When
        it is over nothing is down.
        """
        timed, observer = {**fault, **self.times}, NothingDown()
        written = small.check_order_is_irrelevant(
            lambda methods: scenario([timed], methods), observer=observer
        )
        rows = written["frames"].to_frame()
        small.check_conserved(rows, [*small.ALL, "again"])
        if self.drops is not None:
            assert rows["drop"].str.contains(self.drops, regex=False).any(), "it loses nothing"
        for method in small.ALL:
            assert times_of(written, method) == [(BEGIN_NS, END_NS)]
        before = without_faults()
        for name in ("first_answer_ns", "fresh_answer_ns", "result_answer_ns"):
            for method in small.ALL:
                one, other = (
                    frames[(frames["method"] == method) & (frames[name] < BEGIN_NS)][name].tolist()
                    for frames in (rows, before)
                )
                assert one == other, f"{method}: {name}"
        assert (before["first_answer_ns"] < BEGIN_NS).any()


class RandomFaultConformance:
    """A fault that may come again and again, at random times."""

    times: ClassVar[dict[str, str]] = {"mean_time_between": "300 ms", "mean_duration": "200 ms"}

    def test_it_comes_at_random_times_of_its_own(self, fault: dict[str, Any]):
        timed, first = {**fault, **self.times}, small.ALL[0]
        written = small.simulated(small.scenario(small.ALL, faults=[timed]))
        small.check_conserved(written["frames"].to_frame(), small.ALL)
        times, *others = (times_of(written, method) for method in small.ALL)
        assert all(of_other == times for of_other in others), "the same under every method"
        instants = [instant for span in times for instant in span]
        assert len(times) >= 2 and instants == sorted(instants), "each ends before the next"
        other_seed = small.simulated(small.scenario([first], faults=[timed], seed=2))
        assert times_of(other_seed, first) != times, "another seed, other times"
        both = times_of(small.simulated(small.scenario([first], faults=[timed] * 2)), first)
        assert len(both) > len(times) and set(times) < set(both), "another fault has times apart"
