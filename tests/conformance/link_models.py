"""What every link model has to keep. One of your own is tested by

@pytest.mark.parametrize("link", [{"model": "my_module:MyRadio", "rate": 3.0}])
class TestMine(LoneLinkConformance):
    pass
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from genie_sim.base.settings import from_plain, plain_data
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.link_model import LINK, LinkEnds, Transmitter
from tests.conformance import small
from tests.sim.processes import DOWN, UP, transmitter

SENDING = ("genie", "remote")
SIZES = (0, 1, 426, 1_448, 1_449, 40_000, 1_397_297)


class LinkModelConformance:
    """A link of a model, as a scenario writes it."""

    edges = ({}, {})  # further settings of the two edges

    def scenario(self, link: Any, methods: Sequence[Any] = small.ALL) -> Scenario:
        cars = [small.car(1, link=link), small.car(2, link=link, edge="edge1")]
        edges = [
            {"name": f"edge{place}", "device": "agx_xavier", **settings}
            for place, settings in enumerate(self.edges, 1)
        ]
        return small.scenario(methods, cars=cars, edges=edges)

    def test_every_frame_is_answered_or_dropped_whatever_ran_before(self, link: Any):
        """Under the methods that send something."""
        written = small.check_order_is_irrelevant(
            lambda methods: self.scenario(link, methods), SENDING
        )
        small.check_conserved(written["frames"].to_frame(), [*SENDING, "again"])

    def test_it_is_written_down_as_it_was_read(self, link: Any):
        scenario = self.scenario(link)
        assert from_plain(type(scenario), plain_data(scenario)) == scenario


class LoneLinkConformance(LinkModelConformance):
    """A link of a model whose links do not affect each other: it says how long each message
    takes.
    """

    def scenario(self, link: Any, methods: Sequence[Any] = small.ALL) -> Scenario:
        cars = [small.car(1, link=link), small.car(2, link=link)]
        return small.scenario(methods, cars=cars, edge_network=link)

    def transmitter(self, link: Any, ends: LinkEnds = UP, seed: int = 1) -> Transmitter:
        choice = self.scenario(link).cars[0].link
        assert choice is not None
        made: Transmitter = transmitter(LINK.make(choice), ends, seed=seed)
        return made

    def test_times_are_whole_nanoseconds_that_never_run_backwards(self, link: Any):
        for ends in (UP, DOWN):
            mine, now_ns = self.transmitter(link, ends), 17
            for size_bytes in SIZES * 20:
                occupied_ns = mine.occupied_ns(size_bytes, now_ns)
                assert type(occupied_ns) is int and occupied_ns >= 0
                now_ns += occupied_ns
                delay_ns = mine.delay_ns(size_bytes, now_ns)
                assert delay_ns is None or (type(delay_ns) is int and delay_ns >= 0)

    def test_all_chance_comes_from_the_random_numbers_that_it_is_given(self, link: Any):
        def course(seed: int) -> list[Any]:
            """Two links at once: neither is to feel the other."""
            mine, other = (self.transmitter(link, seed=one) for one in (seed, seed + 1))
            found = []
            for now_ns in range(0, 100_000_000, 1_000_000):
                found += [mine.occupied_ns(40_000, now_ns), mine.delay_ns(40_000, now_ns)]
                other.delay_ns(1, now_ns)
            return found

        assert course(1) == course(1)

    def test_a_larger_message_is_never_faster_on_an_idle_link(self, link: Any):
        occupied = [self.transmitter(link).occupied_ns(size, 0) for size in SIZES]
        assert occupied == sorted(occupied)
