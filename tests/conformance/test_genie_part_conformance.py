"""The shipped parts of a Genie in whole runs, and state that the conformance tests of every kind of
extension have to catch.
"""

from __future__ import annotations

import pytest

from genie_sim.core.confidence import CONFIDENCE_RULES
from genie_sim.core.eviction import EVICTIONS
from genie_sim.core.similarity import SIMILARITIES
from tests.conformance.faults import FaultConformance
from tests.conformance.frame_sources import FrameSourceConformance
from tests.conformance.genie_parts import GeniePartConformance
from tests.conformance.link_models import LinkModelConformance, LoneLinkConformance
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


@pytest.mark.parametrize(
    "genie",
    [
        {"similarity": f"{OWN}:LeakySimilarity"},
        {"eviction": f"{OWN}:LeakyEviction"},
    ],
)
def test_a_part_of_a_genie_that_keeps_state_between_methods_is_caught(genie):
    with pytest.raises(AssertionError):
        GeniePartConformance().test_no_state_goes_from_one_genie_to_the_next(genie)


def test_a_method_that_keeps_state_is_caught():
    with pytest.raises(AssertionError):
        MethodConformance().test_alone_or_between_others(f"{OWN}:LeakyMethod")


def test_a_fault_that_keeps_state_between_methods_is_caught():
    with pytest.raises(AssertionError):
        FaultConformance().test_it_keeps_frames_and_methods_apart(
            {"fault": f"{OWN}:LeakyFault", "target": "edge1"}
        )


def test_a_link_model_that_keeps_state_between_methods_is_caught():
    with pytest.raises(AssertionError):
        LoneLinkConformance().test_no_state_goes_from_one_method_to_the_next(
            {"model": f"{OWN}:LeakyRadio", "slot_ms": 0.5, "fails": 3}
        )


def test_a_medium_that_keeps_state_between_methods_is_caught():
    with pytest.raises(AssertionError):
        LinkModelConformance().test_no_state_goes_from_one_method_to_the_next(
            {"model": f"{OWN}:LeakyMedium", "rate": "300 Mbit/s"}
        )


def test_a_frame_source_that_keeps_state_between_methods_is_caught():
    with pytest.raises(AssertionError):
        FrameSourceConformance().test_no_state_goes_from_one_method_to_the_next(
            {"source": f"{OWN}:LeakyStreet"}
        )
