"""What holds for a Genie under every reading of the paper, whatever it is told."""

from __future__ import annotations

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import LFU, LRU, TTL, Eviction
from genie_sim.core.messages import Expired, ImageLookup, Publish
from genie_sim.core.rules import Capacity, Percentile
from genie_sim.core.similarity import DHash, Exact, PoseGrid
from tests.core.stories import stories, tell
from tests.core.worlds import IMAGES, OBJECTS, answers, facts, genie, object_map, publications
from tests.make import S

READINGS = {
    "pending_index": ["across_topics", "per_topic"],
    "header_identity": ["stamp_frame_origin", "stamp"],
    "same_key_pending": ["coalesce", "forward"],
    "replay_stamp": ["request", "stored"],
    "neighbour_miss": ["ignore", "process"],
    "share_answers": ["broadcast", "on_request"],
    "share_requests": [True, False],
    "request_expiry_ns": [2 * S, S // 2, None],
    "miss_policy": ["immediate", "blocking", "hits_only"],
    "fresh_objects": ["confident", "all"],
    "share_filter": ["confident", "all"],
    "car_learns": ["all", "own"],
    "name": ["edge1/genie", "car1/genie"],
}
MAP_READINGS = {
    "rule": list(CONFIDENCE_RULES),
    "location_key": ["gate", "exact"],
    "one_per_location": [False, True],
    "threshold": [0.6, 0.0, 1.0, Percentile(60.0), Percentile(100.0)],
}
CACHES = {
    "similarity": [PoseGrid(), Exact(), DHash(8)],
    "new_eviction": [Eviction, LRU, LFU, lambda: TTL(3 * S)],
    "capacity": [None, Capacity(entries=1), Capacity(bytes=1_000)],
}


def genies(**fixed):
    """How to make a Genie, of any reading but for those that are ``fixed``."""

    def choice(options):
        return st.fixed_dictionaries(
            {name: st.sampled_from(values) for name, values in options.items()}
        )

    open_readings = {
        name: values for name, values in (READINGS | CACHES).items() if name not in fixed
    }
    return st.builds(
        lambda readings, map_readings: (
            lambda: genie(objects=object_map(**map_readings), **readings, **fixed)
        ),
        choice(open_readings),
        choice(MAP_READINGS),
    )


any_story = stories(shared_stamps=True)
whatever = settings(max_examples=30)


@whatever
@given(genies(), any_story)
def test_only_confident_objects_ever_leave(make_genie, story):
    """C >= C_T (Section III-D), but for what a scenario says to pass on whole: the node's fresh
    answers to clients on its host, an edge's to other edges, and answers that a car does not learn
    from.
    """
    telling = make_genie()
    rules, on_car = telling.rules, telling.name == "car1/genie"
    for step, effects in tell(telling, story):
        for effect in publications(effects):
            fresh = effect.topic == OBJECTS and effect.message.source == "detector"
            whole = fresh and on_car and rules.fresh_objects == "all"
            whole |= effect.topic.endswith("-remote") and rules.share_filter == "all"
            whole |= rules.car_learns == "own" and step.topic == f"{OBJECTS}-remote"
            if effect.topic.startswith(OBJECTS) and not whole:
                assert all(
                    one.confidence >= telling.object_map.threshold for one in effect.message.objects
                )


@whatever
@given(genies(miss_policy="blocking", replay_stamp="request"), any_story)
def test_blocking_a_clients_frame_is_answered_at_most_once(make_genie, story):
    delivered = Counter(
        one.header for _, effects in tell(make_genie(), story) for one in answers(effects)
    )
    assert all(times == 1 for times in delivered.values())


@whatever
@given(genies(miss_policy="immediate", replay_stamp="request"), any_story)
def test_a_frame_is_answered_by_the_map_first_and_once_more_at_most(make_genie, story):
    sources = {}
    for _, effects in tell(make_genie(), story):
        for one in answers(effects):
            sources.setdefault(one.header, []).append(one.source)
    for of_one_frame in sources.values():
        assert "map" not in of_one_frame[1:]
        assert len(of_one_frame) <= 1 + (of_one_frame[0] == "map")


@whatever
@given(genies(miss_policy="hits_only"), any_story)
def test_with_hits_only_clients_get_nothing_but_replays(make_genie, story):
    for step, effects in tell(make_genie(), story):
        for one in answers(effects):
            assert (step.topic, one.source) == (IMAGES, "cache")


@whatever
@given(genies(replay_stamp="request"), any_story)
def test_nobody_is_answered_under_a_header_that_is_not_theirs(make_genie, story):
    asked = {"clients": set(), "edge2/genie": set(), "edge3/genie": set()}
    for step, effects in tell(make_genie(), story):
        if step.topic.startswith(IMAGES):
            asked["clients" if step.topic == IMAGES else step.sender].add(step.message.header)
        for effect in publications(effects):
            if effect.topic == OBJECTS or effect.to is not None:
                assert effect.message.header in asked[effect.to or "clients"]


@whatever
@given(genies(), any_story)
def test_only_announced_topics_are_published(make_genie, story):
    telling = make_genie()
    for _, effects in tell(telling, story):
        assert {one.topic for one in publications(effects)} <= set(telling.publications())


@whatever
@given(genies(miss_policy="blocking", replay_stamp="request", request_expiry_ns=S), stories())
def test_every_frame_of_a_client_is_answered_or_expires_and_never_both(make_genie, story):
    telling = make_genie()
    ends = Counter()
    for _, effects in tell(telling, story):
        ends.update(one.header for one in answers(effects))
        ends.update(one.header for one in facts(effects, Expired))
    assert ends == Counter(step.message.header for step in story if step.topic == IMAGES)
    assert telling.next_deadline_ns() is None


@whatever
@given(genies(), stories())
def test_every_frame_of_a_client_is_looked_up_once(make_genie, story):
    looked_up = [
        one.header
        for _, effects in tell(make_genie(), story)
        for one in facts(effects, ImageLookup)
        if one.requester == "client"
    ]
    assert looked_up == [step.message.header for step in story if step.topic == IMAGES]


@whatever
@given(genies(request_expiry_ns=S), any_story)
def test_a_late_timer_changes_only_when_expiry_is_noticed(make_genie, story):
    def split(timer):
        effects = [effect for _, effects in tell(make_genie(), story, timer) for effect in effects]
        expired = [one for one in effects if isinstance(one, Expired)]
        return [one for one in effects if one not in expired], expired

    assert split(timer=True) == split(timer=False)


@whatever
@given(genies(neighbour_miss="ignore"), any_story)
def test_neighbours_never_make_the_node_work_nor_pass_anything_on(make_genie, story):
    """Hop limit 1: a neighbour's request leads to one reply to that neighbour, or to nothing."""
    for step, effects in tell(make_genie(), story):
        if step.topic == f"{IMAGES}-remote":
            sent = publications(effects)
            assert [(one.topic, one.to) for one in sent] in (
                [],
                [(f"{OBJECTS}-remote", step.sender)],
            )


@whatever
@given(genies(capacity=Capacity(entries=2)), any_story)
def test_the_cache_never_holds_more_requests_than_its_capacity(make_genie, story):
    telling = make_genie()
    for _ in tell(telling, story):
        assert telling.cache_entries() <= 2


@settings(max_examples=20)
@given(genies(), any_story)
def test_the_same_story_has_the_same_end(make_genie, story):
    assert list(tell(make_genie(), story)) == list(tell(make_genie(), story))


def test_the_stories_reach_every_kind_of_event():
    """Otherwise the properties above would hold for want of anything happening."""
    happened = Counter()

    @settings(max_examples=100, database=None)
    @given(stories())
    def watch(story):
        for _, effects in tell(genie(request_expiry_ns=S), story):
            for effect in effects:
                if isinstance(effect, Publish):
                    happened[
                        effect.topic, getattr(effect.message, "source", ""), effect.to is not None
                    ] += 1
                elif isinstance(effect, ImageLookup):
                    happened[effect.outcome, effect.requester] += 1
                else:
                    happened[type(effect).__name__] += 1

    watch()
    for outcome in ("hit", "miss", "coalesced"):
        assert happened[outcome, "client"] > 20
    assert happened["hit", "neighbour"] > 20
    assert happened["Expired"] > 20
    assert happened[f"{OBJECTS}-remote", "cache", True] > 20
    assert min(happened[OBJECTS, source, False] for source in ("map", "detector", "cache")) > 20
