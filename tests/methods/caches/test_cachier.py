"""Cachier's size against optima worked out by hand, and what it keeps of what it is asked."""

from __future__ import annotations

import pytest

from genie_sim.core.rules import Capacity
from genie_sim.methods.cachier import Cachier, PopularityCache, best_size
from tests.methods.caches.vectors import TOPIC, answer, at

MS, S = 10**6, 10**9
COUNTS = (1.0, 5.0, 2.0, 2.0)  # P(1) = 0.5, P(2) = 0.7, P(3) = 0.9, P(4) = 1


@pytest.mark.parametrize(
    ("per_entry_ms", "size"),
    [
        (0, 4),  # a look-up takes no time: everything
        (9, 4),  # 36 + 0, before 27 + 10: the fourth key is worth 10 ms
        (11, 3),  # 33 + 10, before 44 + 0
        (19, 3),  # 57 + 10, before 38 + 30: each of the second and third is worth 20 ms
        (21, 1),  # 21 + 50
        (49, 1),  # 49 + 50, before 100
        (51, 0),  # 100, before 51 + 50: nothing
    ],
)
def test_the_best_size_is_that_worked_out_nightly(per_entry_ms: int, size: int):
    """The cloud takes 100 ms."""
    assert best_size(COUNTS, per_entry_ms * MS, 100 * MS) == size


def test_a_slower_cloud_is_worth_a_larger_cache():
    sizes = [best_size(COUNTS, 21 * MS, cloud_ms * MS) for cloud_ms in (30, 100, 110, 220)]
    assert sizes == [0, 1, 3, 4]
    assert best_size((), 21 * MS, 100 * MS) == 0, "nothing was asked for"


def asked(cache: PopularityCache, place: float, now_ns: int, cloud_ns: int = 100 * MS) -> bool:
    """Whether a request is a hit; the cloud answers it where it is not."""
    one = at(place)
    if cache.get(one, now_ns) is not None:
        return True
    cache.put(one, TOPIC, answer(place), now_ns + cloud_ns)
    return False


def warm(per_entry_ns: int, capacity: Capacity | None = None) -> PopularityCache:
    """It was asked five times for 1, twice for 2 and 3, once for 4, and its time has come to
    choose.
    """
    cache = PopularityCache(
        Cachier(radius=0.1, per_entry_ns=per_entry_ns, period_ns=5 * S), capacity
    )
    for step, place in enumerate((4, 1, 1, 1, 2, 3, 1, 2, 3, 1)):
        asked(cache, 0.3 * place, step * 400 * MS)
    assert cache.cloud_ns == pytest.approx(100 * MS)
    return cache


def hits(cache: PopularityCache, now_ns: int) -> list[int]:
    return [place for place in (1, 2, 3, 4) if cache.get(at(0.3 * place), now_ns) is not None]


def test_it_keeps_as_many_as_are_best_and_the_most_popular_of_them():
    for per_entry_ms, kept in ((0, [1, 2, 3, 4]), (11, [1, 2, 3]), (21, [1]), (51, [])):
        cache = warm(per_entry_ms * MS)
        assert len(cache) == 4, "until then it keeps everything"
        assert hits(cache, 5 * S) == kept
        assert len(cache) == len(kept)
        assert cache.size == (None if len(kept) == 4 else len(kept))


def test_the_capacity_counts_too():
    cache = warm(0, Capacity(entries=2))
    assert len(cache) == 2
    assert hits(cache, 5 * S) == [1, 3], "2 and 3 were asked for equally often, 3 at last"


def test_what_becomes_popular_takes_the_place_of_what_was():
    cache = warm(21 * MS)
    # 1 is at 2.5, and stays; a few more, and it is 4's time
    assert not asked(cache, 1.2, 5 * S) and cache.size == 1
    for step in range(3):
        asked(cache, 1.2, 6 * S + step * 100 * MS)
    assert [asked(cache, place, 7 * S) for place in (1.2, 0.3)] == [True, False]


def test_counts_grow_old_and_are_forgotten():
    cache = warm(51 * MS)
    for period in range(1, 5):
        cache.get(at(3.0), 5 * S * period)  # it is asked for once a period, the others never again
    assert sorted(cache.popularity.counts.values()) == [0.0625, 0.125, 0.125, 0.3125, 1.875]
    for period in range(5, 9):
        cache.get(at(3.0), 5 * S * period)
    assert len(cache.popularity.counts) == 1


def test_near_ones_are_one_and_the_newest_stands_for_them():
    cache = PopularityCache(Cachier(radius=0.1, per_entry_ns=0, period_ns=5 * S), None)
    first, again = at(0.0), at(0.05)
    # before the first answer
    assert cache.get(first, 0) is None and cache.get(again, 10 * MS) is None
    cache.put(first, TOPIC, answer(1.0), 80 * MS)
    assert cache.popularity.counts == {first: 2.0}
    cache.put(again, TOPIC, answer(2.0), 90 * MS)
    assert cache.popularity.counts == {again: 2.0}
    assert len(cache) == 1 and cache.get(at(0.12), 100 * MS) == {TOPIC: answer(2.0)}


def test_the_clouds_time_is_a_moving_mean_of_answered_misses():
    cache = PopularityCache(Cachier(radius=0.1, per_entry_ns=0, period_ns=5 * S), None)
    asked(cache, 0.0, 0, cloud_ns=80 * MS)
    cache.get(at(2.0), S)  # its answer is lost
    asked(cache, 1.0, S, cloud_ns=160 * MS)
    assert cache.cloud_ns == 90 * MS
    asked(cache, 1.0, 2 * S, cloud_ns=500 * MS)  # a hit tells nothing
    assert cache.cloud_ns == 90 * MS
    slow = at(3.0)
    cache.get(slow, 2900 * MS)
    cache.get(at(4.0), 3050 * MS)  # what was lost is forgotten by now
    cache.put(slow, TOPIC, answer(3.0), 3070 * MS)
    assert cache.cloud_ns == 100 * MS
