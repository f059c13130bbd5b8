"""The Genie and its naive twin, written from the same readings of the paper, do the same."""

from __future__ import annotations

from hypothesis import given, settings

from tests.core.stories import stories, tell
from tests.core.twin import Twin, deed
from tests.core.worlds import genie


@settings(max_examples=150)
@given(stories())
def test_the_genie_does_what_its_twin_does(story):
    """Message by message and deadline by deadline; in which order one message's effects come is
    left open.
    """
    real, twin = genie(), Twin("edge1/genie")
    for step, effects in tell(real, story):
        hears = (step.topic, step.message, step.sender)
        deeds = twin.hears(step.now_ns, *hears) if step.topic else twin.forgets(step.now_ns)
        assert sorted(map(repr, map(deed, effects))) == sorted(map(repr, deeds))


@settings(max_examples=50)
@given(stories())
def test_in_the_end_both_know_the_same(story):
    real, twin = genie(), Twin("edge1/genie")
    for step, _ in tell(real, story, timer=False):
        if step.topic:
            twin.hears(step.now_ns, step.topic, step.message, step.sender)
    known = sorted(
        (one.label, one.location, one.score, round(one.confidence, 9)) for one in real.object_map
    )
    assert known == sorted(
        (*(one[k] for k in ("label", "location", "score")), round(one["confidence"], 9))
        for one in twin.map
    )
    assert real.cache_entries() == len(twin.cache)
