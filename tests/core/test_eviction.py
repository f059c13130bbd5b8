"""What goes when the cache is full: every policy keeps the conformance tests, and each its own
promise.
"""

from __future__ import annotations

import functools

import pytest
from hypothesis import given

from genie_sim.core import eviction
from genie_sim.core.eviction import EVICTIONS, LFU, LRU, TTL, Eviction
from tests.core.conformance import EvictionConformance, accesses


class TestUnlimited(EvictionConformance):
    make = Eviction


class TestLRU(EvictionConformance):
    make = LRU


class TestLFU(EvictionConformance):
    make = LFU


class TestTTL(EvictionConformance):
    make = functools.partial(TTL, 20)


def test_every_policy_is_held_to_the_conformance_tests():
    tested = {getattr(one.make, "func", one.make) for one in EvictionConformance.__subclasses__()}
    assert set(EVICTIONS.values()) <= tested


@pytest.mark.parametrize(
    ("eviction", "history", "goes"),
    [
        (Eviction(), "ABba", "A"),  # came first
        (LRU(), "ABba", "B"),  # was not used since
        (LFU(), "ABaabC", "C"),  # was used least, although last
        (LFU(), "ABba", "B"),  # was used as often as A, but not as recently
        (TTL(1000), "ABA", "B"),  # was not stored again
    ],
)
def test_each_policy_has_its_own_victim(eviction, history, goes):
    """``history``: an upper-case letter stores a picture, a lower-case one uses it."""
    for now_ns, key in enumerate(history):
        (eviction.stored if key.isupper() else eviction.used)(key.upper(), now_ns)
    assert eviction.victim() == goes


@given(accesses)
def test_lfu_names_the_least_used_and_of_these_the_least_recently_used(accesses):
    """A naive model: count all uses of each held key, storing included."""
    eviction, uses = LFU(), {}
    for now_ns, (what, key) in enumerate(accesses):
        if what == "store" or (what == "use" and key in uses):
            (eviction.stored if what == "store" else eviction.used)(key, now_ns)
            uses[key] = (uses.get(key, (0, 0))[0] + 1, now_ns)
        elif what == "remove" and key in uses:
            eviction.removed(key)
            del uses[key]
        if uses:
            assert eviction.victim() == min(uses, key=uses.__getitem__)


def test_lfu_forgets_stale_ranks():
    """A hot picture that is hit all day must not fill the memory."""
    eviction = LFU()
    for now_ns in range(10_000):
        eviction.stored("crossing", now_ns)
    assert len(eviction._heap) < 100


def test_a_time_to_live_counts_from_the_last_store_and_not_from_use():
    eviction = TTL(10)
    eviction.stored("crossing", 5)
    eviction.used("crossing", 12)
    assert eviction.expires_ns("crossing") == 15
    eviction.stored("crossing", 14)
    assert eviction.expires_ns("crossing") == 24
    eviction.removed("crossing")
    assert eviction.expires_ns("crossing") is None


def test_a_time_to_live_must_be_positive():
    with pytest.raises(ValueError, match="positive"):
        TTL(0)


def test_lfu_rebuilds_its_heap_seldom(monkeypatch: pytest.MonkeyPatch):
    """Stale ranks may outnumber the answers eight times, or every use would cost as many steps as
    there are answers.
    """
    rebuilt: list[int] = []
    monkeypatch.setattr(
        eviction.heapq, "heapify", lambda heap: (rebuilt.append(len(heap)), heap.sort())
    )
    lfu = LFU()
    for number in range(2_000):
        lfu.used(number % 100, number)
    assert rebuilt == [100, 100]
    assert lfu.victim() == 0
