"""What every fault has to keep. One of your own is tested by

@pytest.mark.parametrize("fault", [{"fault": "my_module:MyFault", "target": "edge1"}])
class TestMine(FaultConformance):
    drops = "edge1:mine"
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import pandas as pd
import pytest

from genie_sim.scenario.scenario import Scenario
from tests.conformance import small

S = 1_000_000_000
BEGIN_NS, END_NS = round(0.5 * S), round(1.1 * S)
# a frame that comes so long after the end has nothing to do with the fault any more
WORK_NS = 2 * S


class FaultConformance:
    """A fault, as in YAML without its times. ``drops`` is in the ``drop`` of frames that it loses
    under some method.
    """

    drops: ClassVar[str | None] = None
    times: ClassVar[dict[str, str]] = {"begin": "0.5 s", "end": "1.1 s"}
    methods: ClassVar[tuple[str, ...]] = small.ALL

    def scenario(self, *faults: dict[str, Any], methods: Sequence[Any] | None = None) -> Scenario:
        street = {"source": "tests.conformance.own:Street", "seconds": 2.0}
        chosen = self.methods if methods is None else methods
        return small.scenario(chosen, perception=street, faults=list(faults))

    def test_every_frame_is_answered_or_dropped_and_twice_the_same(self, fault: dict[str, Any]):
        written = small.check_twice_the_same(self.scenario({**fault, **self.times}))
        rows = written["frames"].to_frame()
        small.check_conserved(rows, self.methods)
        if self.drops is not None:
            assert rows["drop"].str.contains(self.drops, regex=False).any(), "it loses nothing"

    def test_no_state_goes_from_one_method_to_the_next(self, fault: dict[str, Any]):
        timed = {**fault, **self.times}
        small.check_order_is_irrelevant(
            lambda methods: self.scenario(timed, methods=methods), self.methods
        )

    def test_what_was_before_is_as_if_it_never_happened(self, fault: dict[str, Any]):
        """Up to the moment it begins: afterwards even an old frame may be lost."""
        with_fault, without = (
            small.frames(self.scenario(*one)) for one in ([{**fault, **self.times}], [])
        )
        for name in ("first_answer_ns", "fresh_answer_ns", "result_answer_ns"):
            one, other = (
                (rows[name].where(rows[name] < BEGIN_NS)) for rows in (with_fault, without)
            )
            pd.testing.assert_series_equal(one, other, check_dtype=False)
        assert (without["first_answer_ns"] < BEGIN_NS).any()

    def test_it_happens_at_its_times_under_every_method(
        self, fault: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ):
        happened = spy(monkeypatch, self.scenario({**fault, **self.times}))
        begin, end = ("begin", BEGIN_NS), ("end", END_NS)
        assert happened == [[begin, end]] * len(self.methods)

    def test_nothing_is_down_when_it_is_over(self, fault: dict[str, Any]):
        for place, _ in enumerate(self.methods):
            world, _ = small.world(self.scenario({**fault, **self.times}), place)
            world.run()
            assert not world.network.outages and not any(
                link.down_by for link in world.network.links.values()
            )


class RandomFaultConformance:
    """A fault that may come again and again, at random times."""

    methods: ClassVar[tuple[str, ...]] = small.ALL
    times: ClassVar[dict[str, str]] = {"mean_time_between": "300 ms", "mean_duration": "200 ms"}

    def test_it_comes_at_the_same_random_times_under_every_method(
        self, fault: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ):
        once, *others = spy(
            monkeypatch, small.scenario(self.methods, faults=[{**fault, **self.times}])
        )
        assert all(times == once for times in others)
        assert [what for what, _ in once] == ["begin", "end"] * (len(once) // 2), (
            "each ends before the next"
        )
        assert len(once) >= 4 and [when for _, when in once] == sorted(when for _, when in once)
        again = spy(monkeypatch, small.scenario(self.methods, faults=[{**fault, **self.times}]))
        assert again == [once] * len(self.methods)
        other = spy(
            monkeypatch, small.scenario(self.methods, faults=[{**fault, **self.times}], seed=2)
        )
        assert other[0] != once, "another seed, other times"

    def test_every_frame_is_answered_or_dropped_at_random_times_too(self, fault: dict[str, Any]):
        rows = small.frames(small.scenario(self.methods, faults=[{**fault, **self.times}]))
        small.check_conserved(rows, self.methods)

    def test_another_fault_before_it_does_not_share_its_times(
        self, fault: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ):
        twice = [{**fault, **self.times}] * 2
        both = spy(monkeypatch, small.scenario(self.methods[:1], faults=twice))[0]
        alone = spy(monkeypatch, small.scenario(self.methods[:1], faults=twice[:1]))[0]
        assert len(both) > len(alone) and set(alone) < set(both)


def spy(monkeypatch: pytest.MonkeyPatch, scenario: Scenario) -> list[list[tuple[str, int]]]:
    """For each of a scenario's methods, when its faults began and ended."""
    happened = []
    for place, _ in enumerate(scenario.methods):
        world, _ = small.world(scenario, place)
        mine: list[tuple[str, int]] = []
        happened.append(mine)
        with monkeypatch.context() as patched:
            for cls in {type(timed.fault) for timed in world.setup.faults}:
                for what in ("begin", "end"):
                    patched.setattr(cls, what, _noting(getattr(cls, what), what, mine))
            world.run()
    return happened


def _noting(done, what: str, noted: list[tuple[str, int]]):
    def note(self, network):
        noted.append((what, network.clock.now))
        done(self, network)

    return note
