"""What is said of metrics: all of them, with the units of the numbers."""

from __future__ import annotations

import pytest

from genie_sim.analysis.metric import HIGHER, LOWER
from genie_sim.analysis.registry import METRICS, cell
from genie_sim.record.results import MetricValue, Run
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario


@pytest.fixture(scope="module")
def run() -> Run:
    window = "cars[0].route={window: [2 s, 4 s], laps: 2}"
    looks = "methods=[local, remote, genie, {name: looks, method: recommended}]"
    outage = "{fault: outage, target: car1, begin: 3 s, end: 3500 ms}"
    settings = [window, looks, f"faults=[{outage}]"]
    return run_in_memory(load_scenario("street_1car_hetero", settings))


def test_a_run_with_everything_has_a_number_of_every_metric(run: Run):
    never = METRICS.keys() - {metric.metric for metric in run.measured}
    assert not never, "registered, but no number of a run with everything recorded"


def test_a_title_stands_for_one_metric_and_a_meaning_is_a_sentence():
    titles = [info.title for info in METRICS.values()]
    assert len(set(titles)) == len(titles)
    for info in METRICS.values():
        assert info.meaning.endswith(".") and info.better in {LOWER, HIGHER, ""}


def test_a_percentile_needs_one_value_beyond_it():
    needs = {name: info.needs for name, info in METRICS.items() if info.needs}
    assert needs == {"first_answer_p50": 2, "first_answer_p95": 20, "first_answer_p99": 100}


def test_a_value_has_three_digits_and_its_interval():
    share = MetricValue("image_reuse", "genie", "car", "", 0.30612, "1", 0.1, 0.52)
    assert cell(share).text() == "30.6 (10 to 52)"
    assert cell(MetricValue("first_answer_mean", "a", "all", "", 1234.5678, "ms")).text() == "1,235"
    assert cell(MetricValue("confidence_boost", "a", "car", "", 0.012345, "1")).text() == "0.0123"
    assert (
        cell(MetricValue("image_reuse", "a", "car", "", None, "1")).text()
        == cell(None).text()
        == "-"
    )


def test_an_axis_is_logarithmic_where_positive_values_span_decades():
    from genie_sim.analysis.registry import definition, is_drawn_logarithmically

    first_answer = definition("first_answer_mean")
    assert is_drawn_logarithmically(first_answer, [9.1, 340.0])
    assert not is_drawn_logarithmically(first_answer, [9.1, 90.0])
    assert not is_drawn_logarithmically(definition("bytes_up_per_frame"), [0.0, 931_548.0])
    assert not is_drawn_logarithmically(definition("streaming_f1"), [0.01, 0.9])
    assert not is_drawn_logarithmically(first_answer, [])
