"""Readings of the paper: files that say what they change and why, and what each means by a
metric.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from genie_sim.analysis.genie_metrics import running_reuse
from genie_sim.base.errors import UserError
from genie_sim.paper import verdict_table
from genie_sim.paper.checks import ALL
from genie_sim.paper.definitions import CHOICES, USUAL, Definitions
from genie_sim.paper.facts import highest_running_ratios, placed
from genie_sim.paper.readings import FOLDER, NAMES, load_reading, load_readings
from genie_sim.paper.reproduce import judge_readings
from genie_sim.paper.runs import Outcome
from genie_sim.record.columns import Columns, Text
from tests.paper.notation import facts as facts_by_notation
from tests.paper.test_reproduce import counts_table

MS = 1_000_000
FITTED = ("overlap=0.35", "gate_m=0.25")


def test_every_file_is_a_reading_and_every_reading_has_a_file():
    assert sorted(path.stem for path in FOLDER.iterdir()) == sorted(NAMES)
    assert [one.name for one in load_readings()] == list(NAMES)
    assert [one.name for one in load_readings("bench")] == ["bench"]


@pytest.mark.parametrize("name", NAMES)
def test_a_reading_gives_its_reasons_and_what_was_known_of_outcomes(name):
    reading = load_reading(name)
    given = [*reading.choices, *reading.metrics.defined.values()]
    assert all(len(one.why) > 40 and one.quote for one in given if one.why != "As it says.")
    assert len(reading.why) > 100 and len(reading.known) > 100


def test_the_default_means_what_the_facts_mean_and_defines_every_metric():
    default = load_reading("default")
    assert all(getattr(default.metrics, metric) is not None for metric in CHOICES)
    assert default.definitions == USUAL
    assert default.settings(FITTED) == ("overlap=0.35", "gate_m=0.25")


def test_two_passes_is_the_default_with_one_change():
    assert load_reading("two_passes").settings(FITTED) == (
        "overlap=0.35",
        "gate_m=0.25",
        "genie.passes=2",
    )
    assert load_reading("two_passes").definitions == USUAL
    shown = load_reading("two_passes").as_json()["metrics"]
    assert shown == load_reading("default").as_json()["metrics"]


def test_bench_fits_nothing_and_means_something_else_by_every_metric():
    bench = load_reading("bench")
    assert bench.fitted == () and not any(
        one.startswith(("overlap", "gate")) for one in bench.settings(FITTED)
    )
    assert bench.definitions == Definitions(
        time="stamp", image_reuse="all_requests", error_bars="running", boost="per_object"
    )


MINE = (FOLDER / "bench.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "fitted: []",
            "fitted: [gate]",
            "fitted[0]: unknown fitted 'gate' (did you mean 'gate_m'?)",
        ),
        ("title:", "titel:", "titel: unknown field; did you mean 'title'?"),
        ("metrics:\n", "metrics:\n  tim: 3\n", "metrics.tim: unknown field; did you mean 'time'?"),
        (
            "definition: stamp",
            "definition: stmp",
            (
                "metrics.time.definition: unknown definition 'stmp' (did you mean 'stamp'?); known:"
                " received, stamp"
            ),
        ),
        (
            "    why: As it says.",
            "    wy: As it says.",
            "choices[6].wy: unknown field; did you mean 'why'?",
        ),
    ],
)
def test_a_reading_with_a_slip_is_one_line_with_file_field_and_choices(tmp_path, old, new, said):
    path = tmp_path / "mine.yaml"
    path.write_text(MINE.replace(old, new, 1))
    with pytest.raises(UserError) as told:
        load_reading(str(path))
    assert str(told.value).startswith(f"{path}: {said}")
    assert "\n" not in str(told.value)


def test_an_unknown_reading_is_answered_with_the_known_ones():
    with pytest.raises(
        UserError, match=r"unknown reading 'bnch' \(did you mean 'bench'\?\); known: bench, default"
    ):
        load_readings("bnch")


def lookups(*rows):
    """(genie, kind, requester, requests, hits), one row per 100 ms."""
    genies, kinds, requesters, requests, hits = zip(*rows, strict=True)

    def text(values):
        return Text.of(np.arange(len(values)), values)

    return Columns(
        {
            "genie": text(genies),
            "kind": text(kinds),
            "requester": text(requesters),
            "placement": text(["car" if one.startswith("car") else "edge" for one in genies]),
            "method": text(genies),
            "requests": np.array(requests),
            "hits": np.array(hits),
            "t_ns": np.arange(len(rows)) * 100 * MS,
        }
    )


def test_the_running_ratio_is_hits_so_far_over_requests_so_far_of_each_genie():
    found = running_reuse(
        lookups(
            ("car1", "image", "client", 1, 0),
            ("car1", "image", "client", 1, 1),
            ("edge1", "image", "client", 5, 1),
            ("car1", "image", "client", 2, 0),
            ("edge1", "image", "client", 0, 0),
        )
    )
    assert found["ratio"].tolist() == [0, 1 / 2, 1 / 4, 1 / 5]
    assert found["t_ns"].tolist() == [0, 100 * MS, 300 * MS, 200 * MS]


def test_the_highest_running_ratio_is_that_of_any_genie_of_the_role():
    ones = [("car1", "image", "client", 1, hit) for hit in (0, 1, 1, 0)]
    others = [("car2", "image", "client", 1, hit) for hit in (0, 0, 1, 0)]
    edges = [("edge1", "image", "client", 1, 0), ("edge1", "image", "neighbour", 1, 1)]
    found = highest_running_ratios(lookups(*ones, *others, *edges, ("car2", "boost", "", 4, 3)))
    assert found[placed("image_reuse_high", "car")] == pytest.approx(2 / 3)
    assert found[placed("image_reuse_high", "edge")] == 0
    assert found[placed("image_reuse_with_neighbours_high", "edge")] == 1 / 2
    assert found[placed("object_reuse_high", "car")] == 3 / 4
    assert np.isnan(found[placed("object_reuse_high", "edge")])


# Verdicts side by side


def verdicts_of(name, usual, other=None):
    """Under a reading, in a made-up world of three seeds with the same facts in all six scenarios:
    ``usual`` with the usual definitions, ``other`` with the reading's own.
    """
    reading = load_reading(name)
    judged = {USUAL: usual} | ({} if other is None else {reading.definitions: other})
    run = Outcome({meant: facts_by_notation(values) for meant, values in judged.items()})
    groups = {("base", scenario): [run] * 3 for scenario in ALL}
    return judge_readings([reading], [()], [groups], workers=1)[0]


def rows(judged):
    plain = judged.plain or [None] * len(judged.verdicts)
    pairs = zip(judged.verdicts, plain, strict=True)
    return [verdict_table.row(one, judged.reading.name, other) for one, other in pairs]


REUSE = {"object_reuse__car": 0.31, "object_reuse__edge": 0.31}
PER_OBJECT = {f"boost_per_object__{place}": 0.1 for place in ("car", "edge")}
FALLING, RISING = (
    REUSE | PER_OBJECT | {f"confidence_boost__{place}": boost for place in ("car", "edge")}
    for boost in (-0.1, 0.1)
)


@functools.cache
def default():
    return rows(verdicts_of("default", FALLING))


@functools.cache
def bench():
    return rows(verdicts_of("bench", FALLING, RISING))


def of(claim, shown):
    return next(one for one in shown if one["id"] == claim)


def test_where_nothing_was_fitted_the_two_numbers_are_predictions():
    assert (of("C11", default())["kind"], of("C11", default())["verdict"]) == (
        "calibrated",
        "calibrated",
    )
    assert (of("C11", bench())["kind"], of("C11", bench())["verdict"]) == (
        "prediction",
        "reproduced",
    )


def test_a_reading_is_judged_by_its_own_metrics_and_by_the_default_s():
    assert (
        of("C26", default())["verdict"] == "not reproduced"
        and of("C26", default())["by_default_metrics"] is None
    )
    assert of("C26", bench())["verdict"] == "reproduced"
    assert of("C26", bench())["by_default_metrics"]["verdict"] == "not reproduced"
    assert of("C26", bench())["by_default_metrics"]["value"] == pytest.approx(-0.1)


def test_counts_tell_kinds_and_readings_apart():
    counted = counts_table(default() + bench())
    assert "| reproduced | default | bench |" in counted
    assert "| calibrated | 1 of 2 |  |" in counted
    assert "| table | 3 of 3 | 3 of 3 |" in counted
    predictions = [
        sum(one["kind"] == "prediction" for one in shown) for shown in (default(), bench())
    ]
    assert predictions[1] == predictions[0] + 2
    assert f"| prediction | 1 of {predictions[0]} | 2 of {predictions[1]} |" in counted
    assert "- default: of 39 claims 4 reproduced (1 prediction, 3 table);" in counted
    assert "- bench: of 39 claims 6 reproduced (2 prediction, 1 input, 3 table);" in counted
    assert "Measured with the default's metrics, 5 are reproduced." in counted


def test_a_line_of_a_table_has_every_reading_s_verdict():
    line = next(
        one
        for one in verdict_table.in_markdown(default() + bench()).splitlines()
        if one.startswith("| C11 ")
    )
    assert line.endswith("| calibrated | calibrated: 0.31 | reproduced: 0.31 |")
    line = next(
        one
        for one in verdict_table.text(default() + bench(), 100).splitlines()
        if one.startswith("C11 ")
    )
    assert line.split()[-4:] == ["=", "0.31", "+", "0.31"]
    shown = [load_reading(one).as_json() for one in ("default", "bench")]
    document = verdict_table.document(default() + bench(), shown, [])
    assert (
        "- bench: *reproduced*: 0.1; 12 of 12 shown; decided by 1car_homo confidence_boost:car; "
        "average 0.1; by the default's metrics not reproduced: -0.1." in document
    )
