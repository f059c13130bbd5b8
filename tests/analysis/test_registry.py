"""What is said of metrics: all of them, with the units of the numbers."""

from __future__ import annotations

import pytest

from genie_sim.analysis import correctness, metrics, outages, prices, resource_metrics
from genie_sim.analysis.metric import HIGHER, LOWER, measured
from genie_sim.analysis.registry import METRICS, cell, views
from genie_sim.record.columns import Columns
from genie_sim.record.results import MetricValue, Run
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario


@pytest.fixture(scope="module")
def run() -> Run:
    window = "cars[0].route={window: [2 s, 4 s], laps: 2}"
    looks = "methods=[local, remote, genie, {name: looks, method: genie, genie: recommended}]"
    outage = "{fault: outage, target: car1, begin: 3 s, end: 3500 ms}"
    return run_in_memory(load_scenario("street_1car_hetero", [window, looks, f"faults=[{outage}]"]))


def test_a_run_with_everything_has_a_number_of_every_metric(run: Run):
    never = METRICS.keys() - {metric.metric for metric in run.measured}
    assert not never, "registered, but no number of a run with everything recorded"


KEYS = {  # what tells of whom and of when a row is
    "frames": ("method", "car", "stamp_ns", "lap"),
    "lookups": ("method", "placement", "kind", "requester"),
    "looks": ("method", "car", "stamp_ns", "way"),
    "answers": ("method", "car", "stamp_ns"),
    "held": ("method", "car", "stamp_ns", "what"),
    "hosts": ("method", "placement"),
    "resources": ("method", "resource", "t_ns"),
    "faults": ("method", "fault", "begin_ns", "end_ns"),
}
ENERGY = prices.Energy().columns_read()
OF_VIEWS = {  # what else a view reads, by the metrics that it is for
    (*outages.METRICS,): {"faults": ()},
    (*prices.METRICS,): ENERGY,
    (*resource_metrics.METRICS,): ENERGY,
    ("first_answer_part", "fresh_answer_part"): {"frames": ("first_answer_ns", "fresh_answer_ns")},
    ("shared_share", "shared_right_share"): {"looks": ()},
    ("fault_recall", "fault_ghosts"): correctness.StreamingF1().columns_read(),
}


def test_every_metric_reads_the_columns_that_it_says(run: Run):
    """With these columns alone it has the same numbers."""
    for name, metric in METRICS.items():
        columns: dict[str, set[str]] = {"frames": set(KEYS["frames"])}
        more = [tables for names, tables in OF_VIEWS.items() if name in names]
        for tables in (metric.columns_read(), *more):
            for table, read in tables.items():
                columns.setdefault(table, set()).update(read, KEYS.get(table, ("method",)))
        tables = {
            table: Columns({one: run.tables[table][one] for one in sorted(read)})
            for table, read in columns.items()
        }
        given = views(tables, run.methods)
        numbers = [metrics.rounded(one) for one in measured({name: metric}, given)]
        assert numbers == [one for one in run.measured if one.metric == name]


def test_a_title_stands_for_one_metric_and_a_meaning_is_a_sentence():
    counts = ("frames_in_flight",)  # beside the share of the same title
    titles = [info.title for name, info in METRICS.items() if name not in counts]
    assert len(set(titles)) == len(titles)
    for info in METRICS.values():
        assert info.meaning.endswith(".") and info.better in {LOWER, HIGHER, ""}


def test_a_value_has_three_digits_its_unit_and_its_interval():
    share = MetricValue("image_reuse", "genie", "car", "", 0.30612, "1", 0.1, 0.52)
    assert cell(share).text() == "30.6 (10 to 52)"
    assert cell(share)._replace(unit="%").text(intervals=False) == "30.6 %"
    assert cell(MetricValue("first_answer_mean", "a", "all", "", 1234.5678, "ms")).text() == "1,235"
    assert cell(MetricValue("confidence_boost", "a", "car", "", 0.012345, "1")).text() == "0.0123"
    assert (
        cell(MetricValue("image_reuse", "a", "car", "", None, "1")).text()
        == cell(None).text()
        == "-"
    )


def test_an_axis_is_logarithmic_where_positive_values_span_decades():
    from genie_sim.analysis.registry import is_drawn_logarithmically

    assert is_drawn_logarithmically("first_answer_mean", [9.1, 340.0])
    assert not is_drawn_logarithmically("first_answer_mean", [9.1, 90.0])
    assert not is_drawn_logarithmically("bytes_up_per_frame", [0.0, 931_548.0])
    assert not is_drawn_logarithmically("streaming_f1", [0.01, 0.9])
    assert not is_drawn_logarithmically("first_answer_mean", [])
