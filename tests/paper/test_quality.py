"""What the answers are worth: by hand from a made-up table, and the two kinds of KITTI's labels of
one street.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.analysis.metric import ZERO_DELAY
from genie_sim.base import files
from genie_sim.data.trace import read_trace
from genie_sim.data.truth import read_truth
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.facts import Fact
from genie_sim.paper.quality import ACCURACY, JUDGED, facts_of, summarise
from genie_sim.paper.runs import EvaluationRun
from genie_sim.record.records import HELD
from genie_sim.record.tables import Table

SECOND = 1_000_000_000


def held(*rows):
    """A table of instants, a second apart: method, what, held, right, moved away, never there,
    duplicates, then of what is visible static and found, moving and found.
    """
    table = Table(HELD)
    for place, (method, what, served, right, *ghosts, static, found, moving, seen) in enumerate(
        rows
    ):
        shared, hidden = (0, 0), 0
        counts = (served, right, *ghosts, *shared, hidden, static, found, moving, seen)
        table.append((method, what, "car1", place * SECOND, *counts, 3.0 + place, 2.0, 0.5))
    return table.columns()


def test_every_number_by_hand():
    """Over two instants sums count: 3 of 8 right, 4 where something was, one twice; 2 of 4 that
    stand found, 1 of 5.
    """
    instants = (6, 2, 3, 0, 1, 3, 1, 4, 1), (2, 1, 1, 0, 0, 1, 1, 1, 0)
    found = facts_of(held(*(("genie", "consumer", *counts) for counts in instants)))
    assert found.keys() == {Fact(name) for name in ACCURACY}
    numbers = {fact.metric: value for fact, value in found.items()}
    assert numbers == {
        "object_precision": 3 / 8,
        "object_recall_static": 2 / 4,
        "object_recall_moving": 1 / 5,
        "streaming_f1": pytest.approx(6 / 17),
        "ghost_share": 5 / 8,
        "ghost_share_moved_away": 4 / 8,
        "ghost_share_never_there": 0.0,
        "ghost_share_duplicate": 1 / 8,
        "gospa": 3.5,
        "place_error": 0.5,
    }


def test_the_floor_is_told_from_the_method_it_was_written_with():
    consumer, without_delay = (4, 1, 3, 0, 0, 1, 1, 0, 0), (4, 3, 1, 0, 0, 3, 3, 0, 0)
    found = facts_of(held(("local", "consumer", *consumer), ("local", ZERO_DELAY, *without_delay)))
    assert [found[Fact("object_precision", of)] for of in ("local", ZERO_DELAY)] == [0.25, 0.75]
    assert math.isnan(found[Fact("object_recall_moving", "local")]), "nothing moved there"


def test_without_a_truth_table_there_are_no_numbers():
    assert facts_of(held()) == {}


def test_the_summary_averages_over_scenarios_before_the_seeds():
    name = Fact("ghost_share")
    runs = {
        ("base", "one"): [{name: 0.2}, {name: 0.4}],
        ("base", "two"): [{name: 0.6}, {name: 0.8}],
    }
    (row,) = summarise(Evidence(runs), ["one", "two"])
    assert (row["method"], row["name"], row["unit"], row["n"]) == ("genie", "ghost_share", "1", 2)
    assert row["value"] == pytest.approx(0.5)
    assert (row["low"], row["high"]) == pytest.approx(
        (0.5 - 12.706 * 0.1, 0.5 + 12.706 * 0.1), abs=1e-3
    )


def test_only_runs_that_are_shown_are_judged():
    """The shipped trace has a truth table, so that nobody needs KITTI's labels."""
    settings = ("cars[0].route.window=[3 s, 4 s]",)
    plain, judged = (
        EvaluationRun("street_1car_homo", 1, settings, shown=wanted).simulate().facts
        for wanted in (False, True)
    )
    assert not any("ghost" in fact.metric for fact in plain)
    assert judged.keys() - plain.keys() == {Fact(name, by) for name in ACCURACY for by in JUDGED}
    assert all(judged[name] == value or math.isnan(value) for name, value in plain.items())


def test_tracklets_and_tracking_labels_tell_of_the_same_street(kitti_root):
    """Sequence 0000 is drive 0005, labelled twice: parked vehicles within 0.2 m on average, in one
    world.
    """
    trace = read_trace(files.find(files.TRACE, "kitti_0005"))
    places = []
    for labels in ("2011_09_26/0005", "tracking/0000"):
        truth = read_truth(kitti_root, labels, trace)
        seen = {}
        for (camera, _), here in truth.pictures.items():
            for one in here:
                if (
                    camera == "02"
                    and one.group == "vehicles"
                    and one.centre
                    and one.track not in truth.moving
                ):
                    seen.setdefault(one.track, []).append(one.centre)
        places.append([np.mean(centres, axis=0) for centres in seen.values()])
    assert len(places[0]) == 10
    for centre in places[0]:
        assert min(math.dist(centre[:2], other[:2]) for other in places[1]) < 0.2
