"""What every plug-in has to keep. A new one inherits the class of its extension point and is
tested:

class TestMine(SimilarityConformance):
    make = Mine
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from genie_sim.core.confidence import ConfidenceRule
from genie_sim.core.eviction import Eviction
from genie_sim.core.message_cache import MessageCache
from genie_sim.core.messages import CameraPose, Detections, Header, Image
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import Similarity
from tests.make import S

poses = st.builds(
    CameraPose,
    east_m=st.floats(-1e4, 1e4),
    north_m=st.floats(-1e4, 1e4),
    up_m=st.floats(-10, 500),
    heading_rad=st.floats(-2 * math.pi, 2 * math.pi),
)
images = st.builds(
    Image,
    header=st.builds(
        Header,
        st.integers(0, 10**12),
        st.sampled_from(["02", "03"]),
        st.sampled_from(["car1", "car2"]),
    ),
    size_bytes=st.just(1_397_297),
    digest=st.text("0123456789abcdef", min_size=4, max_size=4),
    dhash=st.integers(0, 2**64 - 1),
    pose=poses,
    horizontal_fov_rad=st.just(math.radians(81.4)),
    content=st.none(),
)
units = st.floats(0.0, 1.0)

# One test, run for several classes: hypothesis must not mix up their examples.
inherited = settings(suppress_health_check=[HealthCheck.differing_executors], database=None)


class SimilarityConformance:
    """Keys of images, and an index that finds the held key that equals a given one."""

    make: ClassVar[Callable[..., Similarity]]

    @inherited
    @given(images)
    def test_an_image_equals_itself_whenever_and_by_whichever_car_it_is_taken(self, image):
        similarity = type(self).make()
        index = similarity.index()
        index.add(similarity.key(image))
        later = replace(
            image, header=Header(image.header.stamp_ns + S, image.header.frame_id, "car9")
        )
        assert index.find(similarity.key(later)) == similarity.key(image)

    @inherited
    @given(images)
    def test_an_empty_index_knows_no_image(self, image):
        similarity = type(self).make()
        assert similarity.index().find(similarity.key(image)) is None

    @inherited
    @given(st.lists(st.tuples(st.booleans(), images), max_size=120), images)
    def test_only_a_held_key_is_found_and_every_held_key_finds_itself(self, changes, stranger):
        similarity = type(self).make()
        index, held = similarity.index(), set()
        for added, image in changes:
            key = similarity.key(image)
            if added:
                index.add(key)
                held.add(key)
            else:
                index.discard(key)
                held.discard(key)
        assert all(index.find(key) == key for key in held)
        found = index.find(similarity.key(stranger))
        assert found is None or found in held

    @inherited
    @given(images)
    def test_a_key_added_twice_is_discarded_at_once(self, image):
        similarity = type(self).make()
        index, key = similarity.index(), similarity.key(image)
        index.add(key)
        index.add(key)
        index.discard(key)
        assert index.find(key) is None

    @inherited
    @given(images, images)
    def test_indices_do_not_share_what_they_hold(self, one, other):
        similarity = type(self).make()
        mine, yours = similarity.index(), similarity.index()
        mine.add(similarity.key(one))
        assert yours.find(similarity.key(one)) is None


accesses = st.lists(
    st.tuples(st.sampled_from(["store", "use", "remove"]), st.integers(0, 9)), max_size=200
)


class EvictionConformance:
    """Which answer goes when the cache is full, or when its time is over."""

    make: ClassVar[Callable[..., Eviction]]

    def told(self, accesses: list[tuple[str, int]]) -> tuple[Eviction, set[int]]:
        """The policy after ``accesses``, each a nanosecond after the other, and the keys that are
        held then.
        """
        eviction, held = type(self).make(), set()
        for now_ns, (what, key) in enumerate(accesses):
            if what == "store":
                eviction.stored(key, now_ns)
                held.add(key)
            elif key in held and what == "use":
                eviction.used(key, now_ns)
            elif key in held:
                eviction.removed(key)
                held.remove(key)
        return eviction, held

    @inherited
    @given(accesses)
    def test_emptying_the_cache_names_every_held_key_once(self, accesses):
        eviction, held = self.told(accesses)
        gone = []
        for _ in range(len(held)):
            victim = eviction.victim()
            assert eviction.victim() == victim, "asking changes nothing"
            gone.append(victim)
            eviction.removed(victim)
        assert sorted(gone) == sorted(held)

    @inherited
    @given(accesses)
    def test_the_same_history_names_the_same_victim(self, accesses):
        (one, held), (other, _) = self.told(accesses), self.told(accesses)
        assert not held or one.victim() == other.victim()

    @inherited
    @given(accesses)
    def test_what_has_just_been_stored_is_not_too_old(self, accesses):
        eviction, _ = self.told(accesses)
        now_ns = len(accesses)
        eviction.stored(3, now_ns)
        expires_ns = eviction.expires_ns(3)
        assert expires_ns is None or expires_ns > now_ns

    @inherited
    @given(
        st.lists(st.tuples(st.integers(0, 30), st.integers(0, 5)), max_size=150),
        st.one_of(st.none(), st.integers(1, 8)),
        st.one_of(st.none(), st.integers(26, 8_000)),
    )
    def test_a_cache_never_holds_more_than_its_capacity(self, stored, entries, size_bytes):
        """``stored``: keys, and how many objects of 400 bytes their answer has."""
        eviction = type(self).make()
        limited = entries is not None or size_bytes is not None
        cache = MessageCache(_Plain(), eviction, Capacity(entries, size_bytes) if limited else None)
        for now_ns, (key, objects) in enumerate(stored):
            cache.put(
                key, "/objects", Detections(Header(0, "02", "car1"), (None,) * objects), now_ns
            )
            assert entries is None or len(cache) <= entries
            assert size_bytes is None or cache.size_bytes <= size_bytes
            held = [cache.get(known, now_ns) for known in range(31)]
            assert cache.size_bytes == sum(
                one["/objects"].size_bytes for one in held if one is not None
            )


class _Plain:
    """Keys that are equal or not."""

    def __init__(self) -> None:
        self._keys: set[Any] = set()
        self.add, self.discard = self._keys.add, self._keys.discard

    def find(self, key: Any) -> Any:
        return key if key in self._keys else None


class ConfidenceRuleConformance:
    """How a sighting changes the confidence of a stored object."""

    rule: ClassVar[ConfidenceRule]
    stronger_sightings_help: ClassVar[bool] = True

    @inherited
    @given(units, units, units)
    def test_a_confidence_stays_between_0_and_1(self, stored, seen, rate):
        assert 0.0 <= type(self).rule(stored, seen, rate) <= 1.0

    @inherited
    @given(units, units)
    def test_at_rate_0_nothing_is_learned(self, stored, seen):
        assert type(self).rule(stored, seen, 0.0) == stored

    @inherited
    @given(units, units, units, units)
    def test_the_stronger_the_sighting_the_higher_the_confidence(self, stored, weak, strong, rate):
        weak, strong = min(weak, strong), max(weak, strong)
        after_weak, after_strong = (type(self).rule(stored, seen, rate) for seen in (weak, strong))
        if self.stronger_sightings_help:
            assert after_weak <= after_strong
        else:
            assert after_weak >= after_strong
