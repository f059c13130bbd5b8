"""The shipped parts of a Genie in whole runs, and state that the conformance tests of every kind of
extension have to catch.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES
from tests.conformance.faults import FaultConformance
from tests.conformance.frame_sources import FrameSourceConformance
from tests.conformance.genie_parts import GeniePartConformance
from tests.conformance.link_models import LoneLinkConformance
from tests.conformance.methods import MethodConformance

OWN = "tests.conformance.own"
FEW = {"capacity": "3 entries"}
TTL = {"ttl": "300 ms"}


@pytest.mark.parametrize("similarity", SIMILARITIES)
class TestSimilarities(GeniePartConformance):
    @pytest.fixture
    def genie(self, similarity: str):
        return {"similarity": similarity}


@pytest.mark.parametrize("eviction", EVICTIONS)
class TestEvictions(GeniePartConformance):
    @pytest.fixture
    def genie(self, eviction: str):
        return {"eviction": eviction, **FEW, **(TTL if eviction == "ttl" else {})}


@pytest.mark.parametrize("rule", CONFIDENCE_RULES)
class TestConfidenceRules(GeniePartConformance):
    @pytest.fixture
    def genie(self, rule: str):
        return {"object_map": {"rule": rule}}


def of_similarity() -> None:
    part = {"similarity": f"{OWN}:LeakySimilarity"}
    GeniePartConformance().test_every_frame_is_answered_or_dropped_whatever_ran_before(part)


def of_method() -> None:
    MethodConformance().test_alone_or_between_others(f"{OWN}:LeakyMethod")


def of_fault() -> None:
    fault = {"fault": f"{OWN}:LeakyFault", "target": "edge1"}
    FaultConformance().test_it_keeps_frames_and_methods_apart(fault)


def of_link() -> None:
    link = {"model": f"{OWN}:LeakyRadio", "slot_ms": 0.5, "fails": 7}
    LoneLinkConformance().test_every_frame_is_answered_or_dropped_whatever_ran_before(link)


def of_source() -> None:
    source = {"source": f"{OWN}:LeakyStreet"}
    FrameSourceConformance().test_no_state_goes_from_one_method_to_the_next(source)


@pytest.mark.parametrize("state", [of_similarity, of_method, of_fault, of_link, of_source])
def test_state_that_outlives_a_method_is_caught(state: Callable[[], None]):
    with pytest.raises(AssertionError):
        state()
