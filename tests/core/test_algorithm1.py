"""Algorithm 1 by hand: given this message, exactly these effects."""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.core import message_cache
from genie_sim.core.eviction import LRU
from genie_sim.core.messages import (
    Detections,
    Expired,
    Forgotten,
    ImageLookup,
    MapChange,
    ObjectLookups,
    Publish,
)
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import Exact
from tests.core.worlds import (
    IMAGES,
    OBJECTS,
    Lanes,
    answers,
    facts,
    genie,
    labels,
    object_map,
    publications,
)
from tests.make import BRIDGE, CROSSING, STATION, S, answer, frame, seen

TO_NODE, TO_OTHERS = f"{IMAGES}-local", f"{IMAGES}-remote"
FROM_NODE, FROM_OTHERS = f"{OBJECTS}-local", f"{OBJECTS}-remote"
NEIGHBOUR = "edge2/genie"
CAR = seen()
FAINT_BUS = seen(30.0, 5.0, label="bus", score=0.3)


def lookup(request, outcome, requester="client", entries=0):
    return ImageLookup(request.header, outcome, requester, entries)


def changes_of(*detections):
    """Of the first objects that a map gets."""
    return tuple(
        MapChange(number, one.label, one.location, one.score)
        for number, one in enumerate(detections)
    )


def asked_genie(*objects, **rules):
    """A Genie with its first request, and what its node has answered if there are ``objects``. A
    miss waits for that unless the rules say so.
    """
    one = genie(**{"miss_policy": "blocking", **rules})
    one.on_message(IMAGES, frame(0), 0)
    if objects:
        one.on_message(FROM_NODE, answer(frame(0), *objects), 1)
    return one


# Misses: lines 12 to 15


def test_a_miss_goes_to_the_node_and_to_the_others():
    first = frame(0)
    assert genie(miss_policy="blocking").on_message(IMAGES, first, 0) == [
        lookup(first, "miss"),
        Publish(TO_NODE, first),
        Publish(TO_OTHERS, first),
    ]


def test_without_shared_requests_a_miss_goes_to_the_node_alone():
    first = frame(0)
    asked = genie(miss_policy="blocking", share_requests=False).on_message(IMAGES, first, 0)
    assert publications(asked) == [Publish(TO_NODE, first)]


def test_another_spot_another_camera_and_another_heading_are_misses():
    asked = asked_genie(CAR)
    for other in (frame(1, at=BRIDGE), frame(1, camera="03"), frame(2, heading_deg=90)):
        assert lookup(other, "miss", entries=1) in asked.on_message(IMAGES, other, S)


# Answers of the node: lines 8 to 11


@pytest.mark.parametrize("tells", [True, False])
def test_a_genie_tells_what_its_map_forgets_before_anything_else(tells):
    asked = genie(object_map(forget_after_ns=S), names_changes=tells)
    asked.on_message(IMAGES, frame(0), 0)
    asked.on_message(FROM_NODE, answer(frame(0), CAR, FAINT_BUS), 1)
    forgotten = Forgotten(changes_of(CAR, FAINT_BUS))
    later = asked.on_message(IMAGES, frame(1, at=BRIDGE), 3 * S)
    assert len(asked.object_map) == 0
    assert facts(later, Forgotten) == ([forgotten] if tells else [])
    assert later[0] == (forgotten if tells else lookup(frame(1), "miss", entries=1))
    assert facts(asked.on_message(IMAGES, frame(2, at=BRIDGE), 4 * S), Forgotten) == [], "only once"


def test_a_genie_that_does_not_tell_changes_does_all_else_as_one_that_does():
    telling, silent = genie(), genie(names_changes=False)
    for frames in (frame(0), frame(1)):
        for asked in (telling, silent):
            asked.on_message(IMAGES, frames, 0)
        told, untold = (
            one.on_message(FROM_NODE, answer(frames, CAR, FAINT_BUS), S)
            for one in (telling, silent)
        )
        lookups = facts(told, ObjectLookups)
        assert [len(one.changes) for one in lookups] == [2]
        assert facts(untold, ObjectLookups) == [replace(one, changes=()) for one in lookups]
        assert publications(untold) == publications(told)


def test_the_nodes_answer_is_delivered_once_and_shared():
    """The bus, seen with 0.3, is below C_T = 0.60: it is remembered and does not leave."""
    first = frame(0)
    asked = asked_genie()
    stored = changes_of(CAR, FAINT_BUS)
    assert asked.on_message(FROM_NODE, answer(first, CAR, FAINT_BUS), S // 10) == [
        ObjectLookups(
            first.header, "sighting", 2, hits=0, updates=0, boost_sum=0, objects=2, changes=stored
        ),
        Publish(OBJECTS, answer(first, CAR)),
        Publish(FROM_OTHERS, answer(first, CAR)),
    ]


def test_the_later_of_two_answers_is_knowledge_but_not_delivered_again():
    """The edge's answer comes after the own detector's: a second sighting, C = 0.9 + 0.1 * 0.9 * (1
    - 0.9).
    """
    first = frame(0)
    asked = asked_genie(CAR, share_answers="on_request")
    [known] = asked.on_message(FROM_OTHERS, answer(first, CAR, by="edge2/detector"), 2)
    assert (known.requests, known.hits, known.updates) == (1, 1, 1)
    assert known.boost_sum == pytest.approx(0.1 * 0.9 * (1 - 0.9))


def test_an_answer_nobody_asked_for_is_knowledge_for_the_map_only():
    asked = genie(miss_policy="blocking")
    effects = asked.on_message(FROM_OTHERS, answer(frame(7), CAR), 0)
    assert publications(effects) == []
    assert asked.cache_entries() == 0
    assert len(asked.object_map) == 1


def test_an_object_without_a_place_keeps_its_score_and_enters_no_map():
    first, nowhere, faint = (
        frame(0),
        seen(None, label="person", score=0.7),
        seen(None, label="dog", score=0.5),
    )
    asked = asked_genie()
    [sighting, delivered, _] = asked.on_message(FROM_NODE, answer(first, nowhere, faint), 1)
    assert sighting.requests == 0
    assert delivered == Publish(OBJECTS, answer(first, nowhere))
    assert len(asked.object_map) == 0


@pytest.mark.parametrize(("sharing", "told"), [("broadcast", [None]), ("on_request", [])])
def test_the_nodes_answer_is_shared_or_kept_for_the_requester(sharing, told):
    asked = asked_genie(share_answers=sharing)
    effects = publications(asked.on_message(FROM_NODE, answer(frame(0), CAR), 1))
    assert [one.to for one in effects if one.topic == FROM_OTHERS] == told
    assert [one.topic for one in effects].count(OBJECTS) == 1


def test_an_answer_from_another_genie_is_not_passed_on_to_the_others():
    asked = asked_genie()
    effects = asked.on_message(FROM_OTHERS, answer(frame(0), CAR, by="edge2/detector"), 1)
    assert publications(effects) == [Publish(OBJECTS, answer(frame(0), CAR, by="edge2/detector"))]


# Hits: lines 16 to 19


def test_a_hit_is_replayed_under_the_new_header_with_what_the_map_knows():
    """The bus has been confirmed since, 0.58 + 0.1 * 0.9 * (1 - 0.58) = 0.6178, and a person stands
    beside the car.
    """
    bus, person = seen(30.0, 5.0, label="bus", score=0.58), seen(20.5, label="person", score=0.8)
    asked = asked_genie(CAR, bus)
    asked.on_message(
        FROM_OTHERS,
        answer(frame(5, car="car9"), replace(bus, score=0.9, confidence=0.9), person),
        2,
    )

    again = frame(10)
    [hit, boost, delivered] = asked.on_message(IMAGES, again, 10 * S)
    assert hit == lookup(again, "hit", entries=1)
    assert boost == ObjectLookups(
        again.header, "boost", requests=2, hits=2, updates=0, boost_sum=0, objects=3
    )
    assert (delivered.topic, delivered.to, delivered.message.header) == (
        OBJECTS,
        None,
        again.header,
    )
    assert (delivered.message.source, delivered.message.served_by) == ("cache", "edge1/genie")
    replayed = {one.label: one for one in delivered.message.objects}
    assert list(replayed) == ["car", "bus", "person"]
    assert replayed["car"] == CAR
    assert replayed["bus"].confidence == pytest.approx(0.58 + 0.1 * 0.9 * (1 - 0.58))
    assert replayed["person"].box is None  # it was never in this picture
    assert replayed["person"].placed_by == "map"


def test_replaying_does_not_change_the_stored_answer():
    """Line 13 adds to the list that line 10 iterates; ours is a copy, so a third car does not see
    anything twice.
    """
    asked = asked_genie(CAR)
    asked.on_message(
        FROM_OTHERS, answer(frame(5, car="car9"), seen(20.5, label="person", score=0.8)), 2
    )
    replays = [answers(asked.on_message(IMAGES, frame(stamp), stamp * S))[0] for stamp in (10, 11)]
    assert [labels(one) for one in replays] == [["car", "person"], ["car", "person"]]


def test_an_object_between_two_others_is_added_once():
    left, right = seen(), seen(21.2)
    asked = asked_genie(left, right)
    asked.on_message(
        FROM_OTHERS, answer(frame(5, car="car9"), seen(20.6, label="person", score=0.8)), 2
    )
    assert labels(answers(asked.on_message(IMAGES, frame(10), 10 * S))[0]) == [
        "car",
        "car",
        "person",
    ]


@pytest.mark.parametrize(("stamp", "header_of"), [("request", 10), ("stored", 0)])
def test_a_replay_carries_the_requests_header_or_literally_the_stale_one(stamp, header_of):
    asked = asked_genie(CAR, replay_stamp=stamp)
    assert answers(asked.on_message(IMAGES, frame(10), 10 * S))[0].header == frame(header_of).header


def test_an_evicted_answer_is_a_miss_again():
    asked = genie(new_eviction=LRU, capacity=Capacity(entries=1), miss_policy="blocking")
    for stamp, place in enumerate((CROSSING, BRIDGE)):
        asked.on_message(IMAGES, frame(stamp, at=place), stamp * S)
        asked.on_message(FROM_NODE, answer(frame(stamp, at=place), CAR), stamp * S)
    assert lookup(frame(9, at=BRIDGE), "hit", entries=1) in asked.on_message(
        IMAGES, frame(9, at=BRIDGE), 9 * S
    )
    assert lookup(frame(9), "miss", entries=1) in asked.on_message(IMAGES, frame(9), 9 * S)


# The same picture while the first is pending


def test_equal_requests_share_one_answer_each_under_its_own_header():
    asked = genie(miss_policy="blocking")
    first, second = frame(0.0), frame(0.1)
    asked.on_message(IMAGES, first, 0)
    assert asked.on_message(IMAGES, second, S // 10) == [lookup(second, "coalesced")]
    delivered = answers(asked.on_message(FROM_NODE, answer(first, CAR), S // 5))
    assert delivered == [answer(first, CAR), answer(second, CAR)]


def test_equal_requests_may_both_be_run():
    asked = genie(miss_policy="blocking", same_key_pending="forward")
    first, second = frame(0.0), frame(0.1)
    asked.on_message(IMAGES, first, 0)
    assert publications(asked.on_message(IMAGES, second, S // 10)) == [
        Publish(TO_NODE, second),
        Publish(TO_OTHERS, second),
    ]
    assert answers(asked.on_message(FROM_NODE, answer(first, CAR), 2)) == [answer(first, CAR)]
    [later] = answers(asked.on_message(FROM_NODE, answer(second, CAR), 3))
    assert later.header == second.header


def test_after_the_answer_there_is_nothing_left_to_join():
    # no answer with an object fits
    asked = asked_genie(CAR, capacity=Capacity(bytes=100))
    assert lookup(frame(1), "miss") in asked.on_message(IMAGES, frame(1), 2)


def test_the_very_same_request_over_another_way_is_ignored():
    asked = genie(miss_policy="blocking")
    first, equal = frame(0.0), frame(0.1)
    for request in (first, equal):
        asked.on_message(IMAGES, request, 0)
        assert asked.on_message(IMAGES, request, 1) == []
    assert len(answers(asked.on_message(FROM_NODE, answer(first, CAR), 2))) == 2


# The second answer to a request


def test_the_second_answer_overwrites_the_first():
    asked = asked_genie(seen())
    asked.on_message(FROM_OTHERS, answer(frame(0), seen(40.0, label="bus")), 2)
    assert labels(answers(asked.on_message(IMAGES, frame(9), 9 * S))[0]) == ["bus"]


# Neighbours on the edge network


def test_a_neighbours_hit_is_answered_to_it_alone():
    asked = asked_genie(CAR)
    theirs = frame(0.2, car="car2")
    [hit, _, reply] = asked.on_message(TO_OTHERS, theirs, 2, NEIGHBOUR)
    assert hit == lookup(theirs, "hit", requester="neighbour", entries=1)
    assert reply == Publish(
        FROM_OTHERS, Detections(theirs.header, (CAR,), "cache", "edge1/genie"), to=NEIGHBOUR
    )


def test_a_neighbour_without_a_name_is_answered_where_neighbours_listen():
    asked = asked_genie(CAR)
    [reply] = publications(asked.on_message(TO_OTHERS, frame(0.2, car="car2"), 2, sender=None))
    assert (reply.topic, reply.to) == (FROM_OTHERS, None)


def test_a_neighbours_miss_costs_nothing():
    theirs = frame(0, car="car2")
    assert genie().on_message(TO_OTHERS, theirs, 0, NEIGHBOUR) == [
        lookup(theirs, "miss", requester="neighbour")
    ]


def test_a_neighbours_miss_does_not_keep_the_own_node_from_work():
    asked = genie(miss_policy="blocking")
    asked.on_message(TO_OTHERS, frame(0, car="car2"), 0, NEIGHBOUR)
    ours = frame(0.1)
    assert publications(asked.on_message(IMAGES, ours, 1)) == [
        Publish(TO_NODE, ours),
        Publish(TO_OTHERS, ours),
    ]


def test_the_literal_storm_runs_a_neighbours_miss_and_passes_it_on():
    theirs = frame(0, car="car2")
    asked = genie(neighbour_miss="process", share_answers="on_request")
    assert asked.on_message(TO_OTHERS, theirs, 0, NEIGHBOUR) == [
        lookup(theirs, "miss", requester="neighbour"),
        Publish(TO_NODE, theirs),
        Publish(TO_OTHERS, theirs),
    ]
    assert publications(asked.on_message(FROM_NODE, answer(theirs, CAR), 1)) == [
        Publish(FROM_OTHERS, answer(theirs, CAR), to=NEIGHBOUR)
    ]


def test_a_broadcast_answer_reaches_the_requester_once():
    theirs, equal = frame(0, car="car2"), frame(0, car="car3")
    asked = genie(neighbour_miss="process")
    asked.on_message(TO_OTHERS, theirs, 0, NEIGHBOUR)
    asked.on_message(TO_OTHERS, equal, 0, "edge3/genie")
    assert publications(asked.on_message(FROM_NODE, answer(theirs, CAR), 1)) == [
        Publish(FROM_OTHERS, answer(equal, CAR), to="edge3/genie"),
        Publish(FROM_OTHERS, answer(theirs, CAR)),
    ]


def test_a_shared_answer_is_stored_once_its_request_has_been_seen():
    theirs = frame(0, car="car2")
    asked = genie()
    asked.on_message(TO_OTHERS, theirs, 0, NEIGHBOUR)
    assert (
        publications(
            asked.on_message(FROM_OTHERS, answer(theirs, CAR, by="edge2/detector"), 1, NEIGHBOUR)
        )
        == []
    )
    [replayed] = answers(asked.on_message(IMAGES, frame(3), 3 * S))
    assert (replayed.header, labels(replayed)) == (frame(3).header, ["car"])


def test_a_shared_answer_before_its_request_only_fills_the_map():
    theirs = frame(0, car="car2")
    asked = genie(miss_policy="blocking")
    asked.on_message(FROM_OTHERS, answer(theirs, CAR), 0, NEIGHBOUR)
    asked.on_message(TO_OTHERS, theirs, 1, NEIGHBOUR)
    assert lookup(frame(3), "miss") in asked.on_message(IMAGES, frame(3), S)
    assert len(asked.object_map) == 1


def test_the_neighbours_cached_answer_serves_our_client():
    asked = asked_genie()
    cached = Detections(frame(0).header, (CAR,), "cache", NEIGHBOUR)
    assert answers(asked.on_message(FROM_OTHERS, cached, 1, NEIGHBOUR)) == [cached]


# What a client gets when it misses


def test_immediately_a_client_gets_the_confident_objects_in_view():
    asked = genie()
    ahead, faint, behind = (
        seen(20, 3),
        seen(25, label="bus", score=0.5),
        seen(-20, label="dog"),
    )
    asked.on_message(FROM_OTHERS, answer(frame(0, car="car2"), ahead, faint, behind), 0)
    [at_once] = answers(asked.on_message(IMAGES, frame(1), S))
    assert (at_once.header, at_once.source, at_once.served_by) == (
        frame(1).header,
        "map",
        "edge1/genie",
    )
    assert labels(at_once) == ["car"]


def test_immediately_may_mean_an_empty_answer_and_the_detection_follows():
    asked = genie()
    assert answers(asked.on_message(IMAGES, frame(0), 0)) == [
        Detections(frame(0).header, (), "map", "edge1/genie")
    ]
    assert answers(asked.on_message(FROM_NODE, answer(frame(0), CAR), S)) == [answer(frame(0), CAR)]


def test_a_coalesced_client_gets_the_map_at_once_too():
    asked = genie()
    asked.on_message(IMAGES, frame(0), 0)
    assert [one.header for one in answers(asked.on_message(IMAGES, frame(1), 1))] == [
        frame(1).header
    ]


def test_a_neighbour_never_gets_the_map_for_a_miss():
    asked = genie(neighbour_miss="process")
    asked.on_message(FROM_OTHERS, answer(frame(0, car="car9"), CAR), 0)
    effects = asked.on_message(TO_OTHERS, frame(1, car="car2"), 1, NEIGHBOUR)
    assert {one.topic for one in publications(effects)} == {TO_NODE, TO_OTHERS}


def test_without_a_pose_there_is_no_view_and_no_map_answer():
    asked = genie(similarity=Exact())
    assert answers(asked.on_message(IMAGES, replace(frame(0), pose=None), 0)) == []


@pytest.mark.parametrize(("range_m", "seen"), [(19.6, ["car"]), (19.4, [])])
def test_objects_are_in_view_up_to_the_view_range(range_m, seen):
    """The car stands 19.5 m ahead and half a metre to the side."""
    asked = genie(view_range_m=range_m)
    asked.on_message(FROM_OTHERS, answer(frame(0, car="car2"), CAR), 0)
    assert labels(answers(asked.on_message(IMAGES, frame(1), 1))[0]) == seen


def test_blocking_a_client_gets_the_first_detection_only():
    asked = genie(miss_policy="blocking")
    assert answers(asked.on_message(IMAGES, frame(0), 0)) == []
    assert len(answers(asked.on_message(FROM_OTHERS, answer(frame(0), CAR), 1))) == 1
    assert answers(asked.on_message(FROM_NODE, answer(frame(0), CAR), 2)) == []


def test_with_hits_only_a_miss_is_never_answered():
    asked = genie(miss_policy="hits_only")
    assert answers(asked.on_message(IMAGES, frame(0), 0)) == []
    assert answers(asked.on_message(FROM_NODE, answer(frame(0), CAR), 1)) == []
    assert labels(answers(asked.on_message(IMAGES, frame(1), S))[0]) == ["car"]


@pytest.mark.parametrize(
    ("name", "delivered"),
    [
        ("car1/genie", ["car", "bus"]),
        ("car1", ["car", "bus"]),
        ("edge1/genie", ["car"]),
        ("car12/genie", ["car"]),
    ],
)
def test_all_fresh_objects_reach_only_clients_on_the_same_host(name, delivered):
    """The transparent answer: who asks over a link gets what is above C_T, whatever the scenario
    says.
    """
    asked = asked_genie(name=name, fresh_objects="all")
    to_client, shared = publications(
        asked.on_message(FROM_NODE, answer(frame(0), CAR, FAINT_BUS), 1)
    )
    assert (to_client.topic, labels(to_client.message)) == (OBJECTS, delivered)
    assert (shared.topic, labels(shared.message)) == (FROM_OTHERS, ["car"])
    # a replay is not fresh
    assert labels(answers(asked.on_message(IMAGES, frame(1), S))[0]) == ["car"]


def test_what_another_genie_says_is_not_the_own_nodes_fresh_answer():
    asked = asked_genie(name="car1/genie", fresh_objects="all")
    assert labels(
        answers(asked.on_message(FROM_OTHERS, answer(frame(0), CAR, FAINT_BUS), 1))[0]
    ) == ["car"]


def test_a_neighbour_gets_the_detection_of_its_miss_when_clients_get_hits():
    theirs = frame(0, car="car2")
    asked = genie(miss_policy="hits_only", neighbour_miss="process", share_answers="on_request")
    asked.on_message(TO_OTHERS, theirs, 0, NEIGHBOUR)
    assert [
        one.to for one in publications(asked.on_message(FROM_NODE, answer(theirs, CAR), 1))
    ] == [NEIGHBOUR]


# Requests that nobody answers


def test_an_unanswered_request_expires_for_everyone_who_waits():
    asked = genie(miss_policy="blocking", request_expiry_ns=2 * S)
    first, second = frame(0.0), frame(1.5)
    asked.on_message(IMAGES, first, 0)
    asked.on_message(IMAGES, second, S)
    assert asked.next_deadline_ns() == 2 * S
    assert asked.on_deadline(2 * S - 1) == []
    assert asked.on_deadline(2 * S) == [Expired(first.header), Expired(second.header)]
    assert asked.next_deadline_ns() is None


def test_after_expiry_the_next_equal_request_is_run_again():
    asked = asked_genie(request_expiry_ns=2 * S)
    effects = asked.on_message(IMAGES, frame(3), 3 * S)
    assert effects[:2] == [Expired(frame(0).header), lookup(frame(3), "miss")]
    assert Publish(TO_NODE, frame(3)) in effects


def test_a_late_answer_is_knowledge_for_the_map_only():
    asked = asked_genie(request_expiry_ns=2 * S, share_answers="on_request")
    expired, sighting = asked.on_message(FROM_NODE, answer(frame(0), CAR), 2 * S)
    assert expired == Expired(frame(0).header)
    assert sighting.kind == "sighting"
    assert asked.cache_entries() == 0
    assert len(asked.object_map) == 1


def test_an_answered_request_does_not_expire():
    asked = asked_genie(request_expiry_ns=2 * S)
    asked.on_message(FROM_NODE, answer(frame(0), CAR), S)
    assert asked.on_deadline(5 * S) == []


def test_a_neighbours_request_expires_silently():
    theirs = frame(0, car="car2")
    asked = genie(request_expiry_ns=2 * S)
    asked.on_message(TO_OTHERS, theirs, 0, NEIGHBOUR)
    assert asked.on_deadline(2 * S) == []
    asked.on_message(FROM_OTHERS, answer(theirs, CAR), 2 * S)
    assert asked.cache_entries() == 0


def test_without_expiry_an_answer_is_never_too_late():
    asked = asked_genie(request_expiry_ns=None)
    assert asked.next_deadline_ns() is None
    assert len(answers(asked.on_message(FROM_NODE, answer(frame(0), CAR), 3600 * S))) == 1


def test_requests_without_expiry_do_not_pile_up(monkeypatch):
    """The oldest goes, answered or not; then an equal request is run again and joins nobody."""
    monkeypatch.setattr(message_cache, "MAX_WITHOUT_DEADLINE", 2)
    asked = asked_genie(request_expiry_ns=None)
    asked.on_message(IMAGES, frame(1, at=STATION), 1)
    asked.on_message(FROM_NODE, answer(frame(1, at=STATION), CAR), 2)
    third, fourth, again = frame(2, camera="03"), frame(3, camera="04"), frame(4)
    assert Expired(frame(0).header) in asked.on_message(IMAGES, third, 3)
    assert facts(asked.on_message(IMAGES, fourth, 4), Expired) == [], "it was answered"
    assert Publish(TO_NODE, again) in asked.on_message(IMAGES, again, 5)


# Who is who


@pytest.mark.parametrize(("identity", "delivered"), [("stamp_frame_origin", 0), ("stamp", 1)])
def test_by_the_stamp_alone_another_cars_answer_is_taken_for_ours(identity, delivered):
    asked = genie(miss_policy="blocking", header_identity=identity)
    asked.on_message(IMAGES, frame(0, car="car1"), 0)
    found = answers(asked.on_message(FROM_OTHERS, answer(frame(0, at=STATION, car="car2"), CAR), 1))
    assert [one.header for one in found] == [frame(0, car="car1").header] * delivered


def test_by_the_stamp_alone_a_second_camera_of_the_same_instant_is_lost():
    left, right = frame(0, camera="02"), frame(0, camera="03")
    for identity, outcomes in (("stamp_frame_origin", ["miss", "miss"]), ("stamp", ["miss"])):
        asked = genie(miss_policy="blocking", header_identity=identity)
        effects = [*asked.on_message(IMAGES, left, 0), *asked.on_message(IMAGES, right, 1)]
        assert [one.outcome for one in facts(effects, ImageLookup)] == outcomes


def test_the_literal_index_can_never_hit():
    """An answer comes on another topic than its request, so it is taken for a request and sent on
    to nobody.
    """
    asked = genie(miss_policy="blocking", pending_index="per_topic")
    outcomes = []
    for stamp in (0, 10, 20):
        outcomes += facts(asked.on_message(IMAGES, frame(stamp), stamp * S), ImageLookup)
        for topic in (FROM_NODE, FROM_OTHERS):
            taken_for_a_request = asked.on_message(
                topic, answer(frame(stamp), CAR, FAINT_BUS), stamp * S + 1
            )
            assert taken_for_a_request == [
                Publish(f"{topic}-local", answer(frame(stamp), CAR)),
                Publish(f"{topic}-remote", answer(frame(stamp), CAR)),
            ]
    assert [one.outcome for one in outcomes] == ["miss"] * 3
    assert asked.cache_entries() == len(asked.object_map) == 0


# Nodes that are not object detectors, or answer on several topics


def test_answers_without_objects_are_cached_and_replayed_as_they_are():
    asked = asked_genie(published=("/lanes",))
    lanes = Lanes(frame(0).header, lanes=3)
    assert asked.on_message("/lanes-local", lanes, 1) == [
        Publish("/lanes", lanes),
        Publish("/lanes-remote", lanes),
    ]
    [hit, replay] = asked.on_message(IMAGES, frame(1), S)
    assert hit == lookup(frame(1), "hit", entries=1)
    assert replay == Publish("/lanes", Lanes(frame(1).header, 3, "cache", "edge1/genie"))


def both_topics():
    asked = asked_genie(published=(OBJECTS, "/lanes"), share_answers="on_request")
    return asked


def test_a_node_that_answers_on_two_topics_is_replayed_on_both():
    asked = both_topics()
    asked.on_message(FROM_NODE, answer(frame(0), CAR), 1)
    asked.on_message("/lanes-local", Lanes(frame(0).header, 3), 2)
    hit = asked.on_message(IMAGES, frame(1), S)
    assert [one.topic for one in publications(hit)] == [OBJECTS, "/lanes"]


def test_who_comes_between_two_answers_of_the_node_gets_both_each_once():
    asked = both_topics()
    asked.on_message(FROM_NODE, answer(frame(0), CAR), 1)
    between = asked.on_message(IMAGES, frame(1), 2)
    assert [(one.topic, one.message.header) for one in publications(between)] == [
        (OBJECTS, frame(1).header)
    ]
    later = publications(asked.on_message("/lanes-local", Lanes(frame(0).header, 3), 3))
    assert [(one.topic, one.message.header) for one in later] == [
        ("/lanes", frame(0).header),
        ("/lanes", frame(1).header),
    ]
    assert publications(asked.on_message(FROM_OTHERS, answer(frame(0), CAR), 4)) == []


def test_a_silent_topic_does_not_expire_requests_that_were_served():
    asked = both_topics()
    asked.on_message(FROM_NODE, answer(frame(0), CAR), 1)
    asked.on_message(IMAGES, frame(1), 2)
    assert asked.on_deadline(10 * S) == []


def test_a_request_served_on_one_topic_waits_only_for_the_other():
    """Our node works on the picture; a neighbour's objects for an equal one come first."""
    asked, theirs, late = both_topics(), frame(0, car="car2"), frame(1)
    asked.on_message(TO_OTHERS, theirs, 1, NEIGHBOUR)
    asked.on_message(FROM_OTHERS, answer(theirs, CAR), 2, NEIGHBOUR)
    assert [one.header for one in answers(asked.on_message(IMAGES, late, 3))] == [late.header]
    assert [
        one.header for one in answers(asked.on_message(FROM_NODE, answer(frame(0), CAR), 4))
    ] == [frame(0).header]
    lanes = answers(asked.on_message("/lanes-local", Lanes(frame(0).header, 3), 5), "/lanes")
    assert [one.header for one in lanes] == [frame(0).header, late.header]


def test_a_request_served_by_a_neighbour_does_not_expire():
    asked, theirs = both_topics(), frame(0, car="car2")
    asked.on_message(TO_OTHERS, theirs, 1, NEIGHBOUR)
    asked.on_message(FROM_OTHERS, answer(theirs, CAR), 2, NEIGHBOUR)
    asked.on_message(IMAGES, frame(1), 3)
    assert asked.on_deadline(2 * S) == [Expired(frame(0).header)]


def test_a_request_that_can_no_longer_get_every_answer_is_run_again():
    asked = genie(
        miss_policy="blocking", published=(OBJECTS, "/lanes"), capacity=Capacity(bytes=100)
    )
    asked.on_message(IMAGES, frame(0), 0)
    asked.on_message(FROM_NODE, answer(frame(0), CAR), 1)  # does not fit into the cache
    assert Publish(TO_NODE, frame(1)) in asked.on_message(IMAGES, frame(1), 2)


# The interface


def test_a_genie_stands_between_everyone_and_the_node():
    encapsulated = genie()
    assert encapsulated.subscriptions() == (IMAGES, TO_OTHERS, FROM_NODE, FROM_OTHERS)
    assert encapsulated.publications() == (TO_NODE, TO_OTHERS, OBJECTS, FROM_OTHERS)


def test_a_topic_that_is_not_the_nodes_is_refused():
    with pytest.raises(KeyError):
        genie().on_message("/points_raw", frame(0), 0)


# What Genies learn and share


def test_an_edge_may_send_other_edges_every_object_but_a_car_never():
    asked = asked_genie(share_filter="all")
    to_client, shared = publications(
        asked.on_message(FROM_NODE, answer(frame(0), CAR, FAINT_BUS), 1)
    )
    assert (to_client.topic, labels(to_client.message)) == (OBJECTS, ["car"])
    assert (shared.topic, labels(shared.message)) == (FROM_OTHERS, ["car", "bus"])
    assert labels(answers(asked.on_message(IMAGES, frame(1), S))[0]) == ["car"]
    hit = asked.on_message(TO_OTHERS, frame(2, car="car2"), 2 * S, NEIGHBOUR)
    assert labels(answers(hit, FROM_OTHERS)[0]) == ["car", "bus"]


def test_a_car_that_learns_from_its_own_node_passes_edge_answers_on():
    asked = genie(name="car1/genie", car_learns="own", share_answers="on_request")
    asked.on_message(IMAGES, frame(0), 0)
    effects = asked.on_message(FROM_OTHERS, answer(frame(0), CAR), 1)
    assert [labels(one) for one in answers(effects)] == [["car"]]
    assert facts(effects, ObjectLookups) == []
    assert (asked.cache_entries(), len(asked.object_map)) == (0, 0)
    again = asked.on_message(IMAGES, frame(1), S)
    assert lookup(frame(1), "miss") in again
    assert labels(answers(again)[0]) == []
    # too late, but learned
    assert answers(asked.on_message(FROM_NODE, answer(frame(0), CAR, FAINT_BUS), S + 1)) == []
    assert (asked.cache_entries(), len(asked.object_map)) == (1, 2)
    assert lookup(frame(2), "hit", entries=1) in asked.on_message(IMAGES, frame(2), 2 * S)
