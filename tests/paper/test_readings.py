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
from genie_sim.paper.readings import FOLDER, MAIN, NAMES, load_reading, load_readings
from genie_sim.paper.reproduce import judge_readings
from genie_sim.record.columns import Columns, Text
from tests.paper.notation import facts as facts_by_notation

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


def test_the_main_reading_defines_every_metric_and_fits_nothing():
    main = load_reading(MAIN)
    assert all(getattr(main.metrics, metric) is not None for metric in CHOICES)
    assert main.definitions == Definitions(
        time="stamp", image_reuse="all_requests", error_bars="running", boost="per_object"
    )
    assert main.fitted == () and main.settings(FITTED) == (), "the scenarios are it"


def test_two_passes_is_the_main_reading_with_one_change():
    two_passes = load_reading("two_passes")
    assert two_passes.settings(FITTED) == ("genie.passes=2",)
    assert two_passes.definitions == load_reading(MAIN).definitions
    assert two_passes.as_json()["metrics"] == load_reading(MAIN).as_json()["metrics"]


def test_street_takes_what_was_fitted_and_means_what_a_run_means():
    street = load_reading("street")
    assert street.settings(FITTED)[:2] == FITTED
    assert street.definitions == USUAL


def test_only_what_was_fixed_before_outcomes_predicts():
    told = {name: load_reading(name).title_of_column for name in NAMES}
    assert told == {
        "bench": "bench, retrodicted",
        "two_passes": "two_passes, retrodicted",
        "street": "street",
    }


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
            "    why: The example that",
            "    wy: The example that",
            "choices[1].wy: unknown field; did you mean 'why'?",
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
        UserError, match=r"unknown reading 'bnch' \(did you mean 'bench'\?\); known: bench, street"
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
    found = {
        fact._replace(metric=fact.metric.removesuffix("_running")): value
        for fact, value in found.items()
    }
    assert found[placed("image_reuse_high", "car")] == pytest.approx(2 / 3)
    assert found[placed("image_reuse_high", "edge")] == 0
    assert found[placed("image_reuse_with_neighbours_high", "edge")] == 1 / 2
    assert found[placed("object_reuse_high", "car")] == 3 / 4
    assert np.isnan(found[placed("object_reuse_high", "edge")])


# Verdicts side by side


def verdicts_of(name, facts):
    """Under a reading, in a made-up world of three seeds with the same facts in all six
    scenarios.
    """
    run = facts_by_notation(facts)
    groups = {("base", scenario): [run] * 3 for scenario in ALL}
    return judge_readings([load_reading(name)], [()], [groups], workers=1)[0]


def rows(judged):
    plain = judged.plain or [None] * len(judged.verdicts)
    pairs = zip(judged.verdicts, plain, strict=True)
    return [verdict_table.row(one, judged.reading, other) for one, other in pairs]


# Object reuse as the paper has it; an update takes confidence away, an object gains some.
WORLD = {"object_reuse__car": 0.31, "object_reuse__edge": 0.31}
for place in ("car", "edge"):
    WORLD |= {f"confidence_boost__{place}": -0.1, f"boost_per_object__{place}": 0.1}
    WORLD |= {f"stored_confidence__{place}": 0.7}


@functools.cache
def street():
    return rows(verdicts_of("street", WORLD))


@functools.cache
def bench():
    return rows(verdicts_of("bench", WORLD))


def of(claim, shown):
    return next(one for one in shown if one["id"] == claim)


def test_where_nothing_was_fitted_the_two_numbers_are_like_any():
    assert (of("C11", street())["kind"], of("C11", street())["verdict"]) == (
        "calibrated",
        "calibrated",
    )
    assert (of("C11", bench())["kind"], of("C11", bench())["verdict"]) == (
        "retrodicted",
        "reproduced",
    )


def test_a_reading_is_judged_by_its_own_metrics_and_by_those_of_a_run():
    assert (
        of("C26", street())["verdict"] == "not reproduced"
        and of("C26", street())["by_run_metrics"] is None
    )
    assert of("C26", bench())["verdict"] == "reproduced"
    assert of("C26", bench())["by_run_metrics"]["verdict"] == "not reproduced"
    assert of("C26", bench())["by_run_metrics"]["value"] == pytest.approx(-0.1)


def test_counts_never_add_what_could_not_have_failed():
    """Inputs, invariants and arithmetic of tables stand apart from what the simulator could have
    contradicted.
    """
    of_bench, of_street = verdict_table.counts(bench() + street())[:2]
    assert of_bench.startswith("- bench, retrodicted: 1 of 17 retrodicted claims hold, ")
    assert "Apart from these: " in of_bench and "3 of 3 table" in of_bench
    assert "1 of 5 input" in of_bench and "By the metrics of a run 1 of the 17 hold." in of_bench
    assert of_street.startswith("- street: 0 of 15 predicted claims hold")
    assert "1 of 2 calibrated" in of_street
    assert "39" not in of_bench + of_street


def test_one_table_has_the_paper_s_value_ours_and_the_verdict_in_words():
    """On the terminal, in Markdown and in LaTeX the same."""
    both = bench() + street()
    line = next(
        one for one in verdict_table.in_markdown(both).splitlines() if one.startswith("| C11 ")
    )
    assert line.endswith("| 31 % | 0.31 reproduced | 0.31 calibrated |")
    terminal = verdict_table.text(both, 100).splitlines()
    place = next(i for i, one in enumerate(terminal) if one.startswith("C11 "))
    assert "the paper: 31 %" in terminal[place]
    assert terminal[place + 1].split() == ["bench,", "retrodicted:", "0.31", "reproduced"]
    assert terminal[place + 2].split() == ["street:", "0.31", "calibrated"]
    latex = verdict_table.printed(both, "latex")
    assert "0.31 reproduced" in latex and r"31 \%" in latex
    for made in (verdict_table.in_markdown(both), "\n".join(terminal), latex):
        assert " - " not in made.replace("\n- ", ""), "no minus signs for verdicts"


def test_the_document_says_which_parts_of_a_claim_hold():
    shown = [load_reading(one).as_json() for one in ("bench", "street")]
    document = verdict_table.document(bench() + street(), shown, [])
    assert (
        "- bench: *reproduced*: 0.1; 12 of 12 shown; decided by 1car_homo car; "
        "by the metrics of a run not reproduced: -0.1." in document
    )
