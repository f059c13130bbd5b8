"""What a consumer holds, against what is there: a parked car, a van that drives on, and something that never was."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from sim.street import street

from genie_sim.paper.quality import KITTI, Truth, measure, summarise
from genie_sim.paper.replicate import Answer, Held
from genie_sim.perception.labels import LabelledTrack, Labels, distance_m, read_tracking_labels, read_tracklets

SECOND = 1_000_000_000
STREET = street(seconds=4.0, speed_mps=5.0)  # the camera drives east at 5 m/s; cars are parked every 8 m at y = 4 m
STAMPS = tuple(range(0, 4 * SECOND, SECOND // 10))
PARKED = LabelledTrack("vehicle", STAMPS, np.array([(24.0, 4.0, 0.8)] * len(STAMPS)))
VAN = LabelledTrack("vehicle", STAMPS, np.array([(16.0 + 8.0 * t / SECOND, 4.0, 0.8) for t in STAMPS]))
WINDOW = {"car1": (0, 2 * SECOND)}


def holding(*objects, tracks, since_ns=0):
    """The numbers of a car that is handed these objects once and then nothing more."""
    answers = {"car1": [Answer(since_ns, since_ns, "camera_02", tuple(objects))]}
    return measure(Held(answers, {"car1": 0}), STREET, Truth(Labels(STREET.origin, tracks)), WINDOW)


def test_a_parked_car_stays_right():
    found = holding(("car", (24.0, 4.0, 0.8)), tracks=(PARKED,))
    assert (found["precision"], found["recall_static"]) == (1.0, 1.0)
    assert found["ghost_share"] == 0.0
    assert found["error_m_median"] == pytest.approx(0.0)
    assert math.isnan(found["recall_moving"]), "nothing moved there"


def test_where_a_van_was_there_is_soon_a_ghost():
    """It leaves the place at 8 m/s: after a quarter of a second it is out of the 2 m of an object's neighbourhood."""
    found = holding(("car", (16.0, 4.0, 0.8)), tracks=(VAN,))
    assert found["ghost_share_moved_away"] == found["ghost_share"] > 0.8
    assert found["ghost_share_never_there"] == 0.0
    assert 0 < found["recall_moving"] < 0.2


def test_what_was_never_labelled_was_never_there():
    found = holding(("car", (24.0, 4.0, 0.8)), tracks=(LabelledTrack("person", PARKED.stamps_ns, PARKED.centres),))
    assert found["ghost_share_never_there"] == 1.0, "a car is no person"


def test_a_traffic_light_is_not_counted():
    assert math.isnan(holding(("traffic light", (24.0, 4.0, 0.8)), tracks=(PARKED,))["precision"])


def test_holding_nothing_has_no_precision_and_no_recall():
    found = holding(tracks=(PARKED,))
    assert math.isnan(found["precision"])
    assert found["recall_static"] == 0.0


def test_before_the_answer_the_consumer_holds_nothing():
    late, early = (holding(("car", (24.0, 4.0, 0.8)), tracks=(PARKED,), since_ns=s) for s in (SECOND, 0))
    assert late["recall_static"] == pytest.approx(early["recall_static"] / 2, abs=0.06)


def test_seen_in_two_streams_it_is_held_once():
    answers = [Answer(0, 0, stream, (("car", (24.0, 4.0, 0.8)),)) for stream in ("camera_02", "camera_03")]
    found = measure(Held({"car1": answers}, {"car1": 0}), STREET, Truth(Labels(STREET.origin, (PARKED,))), WINDOW)
    assert found["precision"] == 1.0


def test_ages_count_from_when_the_picture_was_taken():
    """The car at 24 m was first seen at time 0, held for 2 s: the median age is half of that."""
    assert holding(("car", (24.0, 4.0, 0.8)), tracks=(PARKED,))["age_s_median"] == pytest.approx(0.95, abs=0.11)


def test_the_summary_pairs_scenarios_and_averages_over_them_before_the_seeds():
    runs = [{"genie": {"precision": value}} for value in (0.2, 0.4, 0.6, 0.8)]  # two scenarios, two seeds
    (row,) = summarise(runs, seeds=2)
    assert (row["value"], row["n"]) == (pytest.approx(0.5), 2)
    assert row["low"] < 0.5 < row["high"]


def test_parked_cars_are_told_from_moving_ones():
    assert (PARKED.moving, VAN.moving) == (False, True)
    assert VAN.at(SECOND // 2) == pytest.approx((20.0, 4.0, 0.8))
    assert VAN.at(5 * SECOND) is None


@pytest.mark.real_data
@pytest.mark.skipif(KITTI not in os.environ, reason=f"needs KITTI's labels: {KITTI} is not set")
def test_tracklets_and_tracking_labels_tell_of_the_same_street():
    """Sequence 0000 is drive 0005, labelled twice: parked vehicles within 0.2 m on average, in one world."""
    root = os.environ[KITTI]
    tracklets = read_tracklets(root, "2011_09_26/0005")
    labels = read_tracking_labels(f"{root}/tracking/training", "0000", tracklets.origin)
    assert len(tracklets.tracks) == len(labels.tracks) == 15
    parked = [track for track in tracklets.tracks if track.kind == "vehicle" and not track.moving]
    assert len(parked) == 10
    for track in parked:
        centre = tuple(track.centres.mean(axis=0).tolist())
        others = [tuple(one.centres.mean(axis=0).tolist()) for one in labels.tracks if one.kind == "vehicle"]
        assert min(distance_m(centre, other) for other in others) < 0.2
    assert sorted(track.kind for track in tracklets.tracks if track.moving) == [
        "cyclist", "person", "person", "vehicle", "vehicle",
    ]  # fmt: skip
