"""The message cache: capacity, time to live, and the requests that still wait for their answers."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.core.eviction import LFU, LRU, TTL, Eviction
from genie_sim.core.message_cache import MessageCache, PendingIndex, PendingRequest, Requester
from genie_sim.core.messages import Detections, Header
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import DHash, Exact
from tests.core.worlds import OBJECTS, Lanes, labels
from tests.make import answer, frame, seen

HEADER = Header(0, "02", "car1")


def zipf(requests=20_000, pictures=500, skew=0.9, seed=1):
    """Requests for pictures, the k-th of which is asked for with probability ~ 1 / k^skew."""
    weights = np.arange(1, pictures + 1) ** -skew
    return (
        np.random.default_rng(seed).choice(pictures, requests, p=weights / weights.sum()).tolist()
    )


def replay(cache, trace, objects_of=lambda key: 0):
    """Whether each request of the trace is a hit; a miss is stored."""
    hits = []
    for now_ns, key in enumerate(trace):
        hit = cache.get(key, now_ns) is not None
        hits.append(hit)
        if not hit:
            cache.put(key, OBJECTS, Detections(HEADER, (None,) * objects_of(key)), now_ns)
    return hits


@pytest.mark.parametrize("capacity", [1, 10, 50, 200, 499, 500])
@pytest.mark.parametrize(("eviction", "theirs"), [(LRU, "LRU"), (Eviction, "FIFO")])
def test_hits_are_those_of_libcachesim(eviction, theirs, capacity):
    """The same policy of an independent simulator (libCacheSim) on the same Zipf trace, request by
    request.
    """
    libcachesim = pytest.importorskip(
        "libcachesim", reason="needs libcachesim: pip install 'genie-sim[test]'"
    )
    reference = getattr(libcachesim, theirs)(cache_size=capacity, hashpower=12)
    trace = zipf()
    expected = [reference.get(libcachesim.Request(obj_id=key, obj_size=1)) for key in trace]
    assert (
        replay(MessageCache(Exact().index(), eviction(), Capacity(entries=capacity)), trace)
        == expected
    )
    assert 0 < sum(expected) < len(expected)


@pytest.mark.parametrize("capacity_bytes", [2_000, 20_000, 200_000])
def test_hits_in_bytes_are_those_of_libcachesim(capacity_bytes):
    """Answers of different sizes: a large one may push out several, one larger than the cache is
    not stored.
    """
    libcachesim = pytest.importorskip(
        "libcachesim", reason="needs libcachesim: pip install 'genie-sim[test]'"
    )

    def objects_of(key):
        return key * 7919 % 8

    reference = libcachesim.LRU(cache_size=capacity_bytes, hashpower=12)
    trace = zipf()
    sizes = [Detections(HEADER, (None,) * objects_of(key)).size_bytes for key in trace]
    expected = [
        reference.get(libcachesim.Request(obj_id=key, obj_size=size))
        for key, size in zip(trace, sizes, strict=True)
    ]
    cache = MessageCache(Exact().index(), LRU(), Capacity(bytes=capacity_bytes))
    assert replay(cache, trace, objects_of) == expected
    assert (len(cache), cache.size_bytes) == (reference.get_n_obj(), reference.get_occupied_byte())


@pytest.mark.parametrize("capacity", [1, 10, 50])
def test_hits_under_lfu_are_those_of_a_naive_list(capacity):
    """Of the least used, the least recently used goes; before the new one comes, however hot the
    others are.
    """
    uses, expected, trace = {}, [], zipf(requests=3_000, pictures=100)
    for now_ns, key in enumerate(trace):
        expected.append(key in uses)
        if key not in uses and len(uses) == capacity:
            del uses[min(uses, key=uses.__getitem__)]
        uses[key] = (uses.get(key, (0, 0))[0] + 1, now_ns)
    assert (
        replay(MessageCache(Exact().index(), LFU(), Capacity(entries=capacity)), trace) == expected
    )
    assert 0 < sum(expected) < len(expected)


def test_without_a_capacity_only_the_first_request_for_a_picture_misses():
    trace = zipf()
    hits = replay(MessageCache(Exact().index(), Eviction()), trace)
    assert hits.count(False) == len(set(trace))


# Sizes


def test_under_lfu_in_bytes_a_new_answer_is_not_the_one_that_goes():
    """It was used least, but the one that it comes in place of goes before."""
    size_bytes = answer(HEADER, seen()).size_bytes
    cache = MessageCache(Exact().index(), LFU(), Capacity(bytes=2 * size_bytes))
    for now_ns, key in enumerate(("crossing", "bridge", "bridge", "crossing", "bridge")):
        cache.put(key, OBJECTS, answer(HEADER, seen()), now_ns)
    cache.put("tunnel", OBJECTS, answer(HEADER, seen()), 9)
    held = {key for key in ("crossing", "bridge", "tunnel") if cache.get(key, 10) is not None}
    assert held == {"bridge", "tunnel"}


def test_an_answer_larger_than_the_cache_is_not_stored_and_evicts_nothing():
    cache = MessageCache(Exact().index(), LRU(), Capacity(bytes=500))
    cache.put("crossing", OBJECTS, answer(HEADER, seen()), 0)
    cache.put("bridge", OBJECTS, answer(HEADER, *[seen()] * 2), 1)
    assert cache.get("bridge", 2) is None
    assert cache.get("crossing", 2) is not None


def test_an_answer_just_as_large_as_the_cache_fits():
    whole = answer(HEADER, seen())
    cache = MessageCache(Exact().index(), LRU(), Capacity(bytes=whole.size_bytes))
    cache.put("crossing", OBJECTS, whole, 0)
    assert cache.get("crossing", 1) == {OBJECTS: whole}


def test_an_answer_that_grows_makes_room_for_itself():
    cache = MessageCache(Exact().index(), LRU(), Capacity(bytes=1_000))
    cache.put("crossing", OBJECTS, answer(HEADER, seen()), 0)
    cache.put("bridge", OBJECTS, answer(HEADER, seen()), 1)
    cache.put("crossing", OBJECTS, answer(HEADER, *[seen()] * 2), 2)
    assert cache.get("bridge", 3) is None
    assert len(cache.get("crossing", 3)[OBJECTS].objects) == 2


def test_answers_on_several_topics_are_one_entry():
    cache = MessageCache(Exact().index(), LRU(), Capacity(entries=1))
    lanes, objects = Lanes(HEADER, 3), answer(HEADER, seen())
    cache.put("crossing", "/lanes", lanes, 0)
    cache.put("crossing", OBJECTS, objects, 1)
    assert cache.get("crossing", 2) == {"/lanes": lanes, OBJECTS: objects}
    assert (len(cache), cache.size_bytes) == (1, lanes.size_bytes + objects.size_bytes)


# Time to live


def test_an_answer_lives_for_its_time():
    cache = MessageCache(Exact().index(), TTL(10))
    cache.put("crossing", OBJECTS, answer(HEADER), 5)
    assert cache.get("crossing", 14) is not None
    assert cache.get("crossing", 15) is None
    assert (len(cache), cache.size_bytes) == (0, 0)


def test_a_new_answer_starts_a_new_time():
    cache = MessageCache(Exact().index(), TTL(10))
    cache.put("crossing", OBJECTS, answer(HEADER), 0)
    cache.put("crossing", OBJECTS, answer(HEADER), 9)
    assert cache.get("crossing", 18) is not None


def test_an_expired_answer_goes_even_beside_a_new_one_of_another_topic():
    cache = MessageCache(Exact().index(), TTL(10))
    cache.put("crossing", "/lanes", Lanes(HEADER, 3), 0)
    cache.put("crossing", OBJECTS, answer(HEADER), 10)
    assert list(cache.get("crossing", 11)) == [OBJECTS]


def test_an_expired_answer_does_not_hide_a_live_one_a_little_farther_away():
    """The picture differs in one bit from one whose time is over, and in two from one that is
    fresh.
    """
    cache = MessageCache(DHash(radius=2).index(), TTL(10))
    cache.put(0b001, OBJECTS, answer(HEADER), 0)
    cache.put(0b110, OBJECTS, answer(HEADER, seen()), 8)
    assert labels(cache.get(0b000, 9)[OBJECTS]) == []
    assert labels(cache.get(0b000, 12)[OBJECTS]) == ["car"]


# Requests that wait


def pending_index():
    return PendingIndex("stamp_frame_origin", Exact().index)


def pending_request(deadline_ns=None, key="crossing", is_forwarded=True):
    requesters = [Requester(HEADER, False, None)]
    return PendingRequest("/image_raw", key, deadline_ns, is_forwarded, requesters)


def test_a_request_is_found_by_its_header_and_joined_by_its_key():
    index, request = pending_index(), pending_request()
    index.open(HEADER, request)
    assert index.by_header(HEADER) is request
    assert index.by_header(HEADER._replace(origin="car2")) is None
    assert index.by_key("/image_raw", "crossing") is request
    assert index.by_key("/points_raw", "crossing") is None


def test_nobody_joins_a_request_that_no_node_works_on():
    index = pending_index()
    index.open(HEADER, pending_request(is_forwarded=False))
    assert index.by_key("/image_raw", "crossing") is None
    assert index.by_header(HEADER) is not None


def test_a_closed_request_is_still_known_by_its_header():
    index, request = pending_index(), pending_request()
    index.open(HEADER, request)
    index.close(request)
    assert index.by_key("/image_raw", "crossing") is None
    assert index.by_header(HEADER) is request


def test_closing_the_older_of_two_equal_requests_leaves_the_newer_open():
    index, older, newer = pending_index(), pending_request(), pending_request()
    index.open(frame(0).header, older)
    index.open(frame(1).header, newer)
    index.close(older)
    assert index.by_key("/image_raw", "crossing") is newer


def test_requests_expire_in_the_order_they_came():
    index = pending_index()
    for stamp, deadline_ns in enumerate((10, 20, 20, 30)):
        index.open(frame(stamp).header, pending_request(deadline_ns, key=f"picture {stamp}"))
    assert index.next_deadline_ns == 10
    assert [one.key for one in index.expire(9)] == []
    assert [one.key for one in index.expire(20)] == ["picture 0", "picture 1", "picture 2"]
    assert (len(index), index.next_deadline_ns) == (1, 30)
    assert index.by_key("/image_raw", "picture 1") is None


def test_a_similar_image_joins_a_pending_request_despite_a_closer_answer():
    index = PendingIndex("stamp_frame_origin", DHash(radius=2).index)
    answered, open_one = pending_request(key=0b0001), pending_request(key=0b0110)
    index.open(frame(0).header, answered)
    index.open(frame(1).header, open_one)
    assert index.by_key("/image_raw", 0b0000) is answered
    index.close(answered)
    assert index.by_key("/image_raw", 0b0000) is open_one
