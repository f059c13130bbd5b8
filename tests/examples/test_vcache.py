"""vCache: what its law says of explorations, what is stored, and how many answers are wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import genie_sim as gs
from genie_sim.base.features import DIMENSION, UNIT
from genie_sim.base.seeds import Draws, stream
from genie_sim.core.messages import CameraPose, Detections, Header
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from tests import make
from tests.conformance.methods import MethodConformance


@pytest.mark.parametrize("method", ["vcache:VCache"])
class TestVCache(MethodConformance):
    pass


class Always:
    """Draws that are what it is told: 0 explores where that is possible, 1 never."""

    def __init__(self, value: float) -> None:
        self.value = value

    def uniform(self, key: str) -> float:
        return self.value


def key(number: int, cosine: float = 1.0) -> FeatureKey:
    """A picture whose feature has this cosine with that of ``key(0)``, nearly."""
    vector = np.zeros(DIMENSION, np.float32)
    vector[:2] = np.rint([UNIT * cosine, UNIT * math.sqrt(1 - cosine**2)])
    return FeatureKey(vector, Header(number, "front", "car1"), CameraPose(0.0, 0.0, 0.0, 0.0))


def answer(number: int, *east_m: float) -> Detections:
    return make.answer(Header(number, "front", "car1"), *map(make.seen, east_m))


def cache(draw: float = 0.0, **settings: Any) -> Any:
    from vcache import VerifiedCache

    usual: dict[str, Any] = {"capacity": None, "delta": 0.1, "shared": True, "replay": "world"}
    usual |= settings
    draws: Any = Always(draw)
    return VerifiedCache(usual.pop("capacity"), draws, **usual)


def taught(differed: dict[float, int], agreed: dict[float, int]) -> Any:
    from vcache import Law

    law = Law()
    for was_same, seen in enumerate((differed, agreed)):
        for similarity, count in seen.items():
            law.observe(similarity, bool(was_same))
            law._seen[similarity][was_same] += count - 1
    return law


def test_a_law_is_used_from_six_observations_on_two_of_which_it_begins_with():
    assert taught({}, {0.9: 3}).explore(1.0, 0.1) == 1.0
    assert taught({}, {0.9: 4}).explore(1.0, 0.1) < 1.0


def test_what_is_never_right_is_replayed_to_the_bound_and_no_more():
    """Whatever is asked, delta of the answers may be wrong."""
    law = taught({0.9: 990, 0.95: 990, 1.0: 990}, {0.9: 10, 0.95: 10, 1.0: 10})
    for delta in (0.02, 0.1):
        assert 1 - 2 * delta < law.explore(0.95, delta) <= 1 - delta


def test_what_is_right_more_often_than_asked_for_is_never_explored():
    law = taught({0.2: 190, 0.5: 50, 0.8: 10}, {0.2: 10, 0.5: 50, 0.8: 190})
    assert law.explore(0.9, 0.1) <= 0 < law.explore(0.7, 0.1) < law.explore(0.2, 0.1)


def test_the_fit_by_hand():
    """Half are right at 0.4 and 3 in 4 at 0.6: the log odds rise by log(3) over 0.2."""
    law = taught({0.4: 4_000_000, 0.6: 2_000_000}, {0.4: 4_000_000, 0.6: 6_000_000})
    threshold, steepness, deviation = law._fitted()
    assert threshold == pytest.approx(0.4, abs=1e-3)
    assert steepness == pytest.approx(math.log(3) / 0.2, rel=1e-3)
    assert 0 < deviation < 0.001


def test_the_deviation_is_that_of_the_delta_method():
    """4 at 0 and 4 at 1, of which 1 and 3 are right: the threshold is in the middle."""
    law = taught({0.0: 2, 1.0: 1}, {0.0: 1, 1.0: 2})  # with the two that each begins with
    threshold, steepness, deviation = law._fitted()
    assert (threshold, steepness) == pytest.approx((0.5, 2 * math.log(3)))
    weight = 4 * 3 / 16
    information = np.array([[2 * weight, weight], [weight, weight]])
    gradient = np.array([-1, -0.5]) / steepness
    variance = gradient @ np.linalg.inv(information) @ gradient
    assert deviation == pytest.approx(math.sqrt(variance))


def test_only_an_answer_that_differs_is_stored():
    some = cache()
    some.put(key(0), "/objects", answer(0, 10.0), 0)
    alike, different = key(1, 0.99), key(2, 0.98)
    for asked, found in ((alike, answer(1, 11.0)), (different, answer(2, 30.0))):
        assert some.get(asked, 5) is None, "too little is known to replay"
        some.put(asked, "/objects", found, 6)
        some.put(asked, "/objects", found, 7)  # the edge answers, too
    assert len(some) == 2 and different in some.answers and alike not in some.answers
    assert some.law(key(3))._seen == {0.0: [1, 0], 1.0: [0, 1], 0.99: [0, 1], 0.98: [1, 0]}


def test_every_answer_has_its_own_law_unless_they_share_one():
    for shared, seen in ((True, 6), (False, 2)):
        some = cache(shared=shared)
        first, other = key(0), key(9, 0.0)
        some.put(first, "/objects", answer(0, 10.0), 0)
        for number in range(1, 5):
            asked = key(number, 0.99)
            some.get(asked, 5)
            some.put(asked, "/objects", answer(number, 10.0), 6)
        some.put(other, "/objects", answer(9), 7)
        assert sum(map(sum, some.law(other)._seen.values())) == seen
        assert sum(map(sum, some.law(first)._seen.values())) == 6


def test_the_nearest_answer_is_replayed_unless_the_draw_says_explore():
    for draw, hit in ((0.999, True), (0.001, False)):
        some = cache(draw)
        some.put(key(0), "/objects", answer(0, 10.0), 0)
        for _ in range(50):
            some.law(key(0)).observe(0.99, False)
        replayed = some.get(key(1, 0.99), 5)
        assert (replayed is not None) == hit
    assert cache(0.999).get(key(1), 5) is None, "there is nothing to replay"


def test_an_evicted_answer_teaches_nothing_and_its_law_goes():
    some = cache(shared=False, capacity=Capacity(entries=1))
    some.put(key(0), "/objects", answer(0, 10.0), 0)
    asked = key(1, 0.99)
    assert some.get(asked, 1) is None
    some.put(key(2, 0.0), "/objects", answer(2, 50.0), 2)
    some.put(asked, "/objects", answer(1, 10.0), 3)
    assert [*some.answers] == [asked] and len(some._laws) == 0


def test_explorations_without_an_answer_are_forgotten():
    from vcache import REMEMBERED

    some = cache()
    some.put(key(0), "/objects", answer(0, 10.0), 0)
    for number in range(1, REMEMBERED + 20):
        some.get(key(number, 0.99), number)
    assert len(some._explored) == REMEMBERED


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("delta", [0.05, 0.1, 0.2])
def test_the_bound_holds_where_the_law_is_true(delta: float):
    """Requests of any similarity; an answer is the same with a probability that is logistic."""
    from vcache import Law

    law, rng, draws = Law(), stream(1, "vcache"), Draws(1, "vcache")
    requests, replayed, wrong = 2000, 0, 0
    for number in range(requests):
        similarity = round(float(rng.uniform(0.8, 1.0)), 2)
        is_same = bool(rng.random() < 1 / (1 + math.exp(-60 * (similarity - 0.92))))
        if draws.uniform(str(number)) > law.explore(similarity, delta):
            replayed, wrong = replayed + 1, wrong + (not is_same)
        else:
            law.observe(similarity, is_same)
    assert 0.3 * delta < wrong / requests <= delta
    assert replayed / requests > 2 * delta, "the law tells right answers from wrong ones"


@pytest.mark.slow
@pytest.mark.nightly
def test_the_bound_is_one_for_each_cache_and_none_for_caches_in_series():
    deltas = {"d05": 0.05, "d10": 0.1, "d20": 0.2}
    run = gs.run("vcache.yaml", methods=["each", *deltas])
    found = run.metrics.set_index(["metric", "placement", "method"])["value"]
    replayed = [found["image_reuse", "car", name] for name in ("each", *deltas)]
    assert replayed == sorted(replayed) and replayed[0] < 0.05, "entry by entry there is too little"
    for name, delta in deltas.items():
        in_series = found["vcache:wrong_replays", "all", name]
        for placement in ("car", "edge"):
            reuse = found["image_reuse", placement, name]
            assert reuse * found["wrong_hit_share", placement, name] < 1.15 * delta
        assert in_series > 1.5 * delta


@pytest.mark.parametrize("delta", [-0.1, 1.5])
def test_a_bound_is_a_share(delta: float):
    entry = {"method": "vcache:VCache", "delta": delta}
    with pytest.raises(gs.UserError, match="delta: must be from 0 to 1"):
        gs.run("vcache.yaml", {"methods": [entry]})
