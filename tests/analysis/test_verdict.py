"""Who is better in a comparison, in words and as a figure."""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.analysis import compare_tables, registry
from genie_sim.analysis.compare import BLOCKS, SEEDS, Arm, ComparedRuns, Difference
from genie_sim.analysis.points import differences
from genie_sim.analysis.verdict import verdicts
from genie_sim.record.results import MethodInfo

FIRST = Arm(MethodInfo("a", "A", False), {})
OTHER = Arm(MethodInfo("c", "C", True), {})
SECOND = Arm(MethodInfo("b", "B", False), {}, against=[FIRST])


def row(metric: str, difference: float, low: float | None, high: float | None) -> Difference:
    about = registry.definition(metric)
    by = SEEDS if low is not None else ""
    return Difference(metric, SECOND, 1.0, about, FIRST, 1.0, difference, low, high, by=by, n=5)


def comparison(*rows: Difference) -> ComparedRuns:
    return ComparedRuns([FIRST, SECOND], list(rows), ["town"], {})


@pytest.mark.parametrize(
    "metric, low, high, verdict",
    [
        ("first_answer_mean", -3.0, -1.0, "better"),
        ("first_answer_mean", 1.0, 3.0, "worse"),
        ("first_answer_mean", -1.0, 3.0, "unclear"),
        ("streaming_f1", 0.01, 0.03, "better"),
        ("streaming_f1", -0.03, -0.01, "worse"),
        ("ghost_share", -0.03, -0.01, "better"),
        ("streaming_f1", None, None, ""),
        ("streaming_f1", 0.0, 0.02, "unclear"),
        ("batch_size", 0.01, 0.03, "different"),
    ],
)
def test_better_is_an_interval_on_the_right_side_of_zero(metric, low, high, verdict):
    assert row(metric, 0.02, low, high).verdict == verdict


def test_a_difference_below_one_percent_of_the_value_is_negligible():
    """Source: two methods of which one sends a message more, 110 ns of 9.11 ms."""
    small = row("first_answer_mean", 0.00011, 4.31e-5, 0.000176)._replace(against_value=9.11)
    assert small.verdict == "negligible"
    assert small._replace(against_value=0.0109).verdict == "worse"
    assert small._replace(low=-1.0, high=1.0).verdict == "unclear", "it may be 1 ms as well"
    assert small._replace(low=-0.01, high=0.02).verdict == "negligible"
    assert small._replace(low=None, high=None).verdict == "negligible"
    (sentence,) = verdicts(comparison(small))
    assert sentence.startswith("B is negligibly different from A in first answer, mean (+0.00011")
    assert "below 1 % of the value" in compare_tables.about(comparison(small))


def test_a_sentence_says_than_what_in_what_by_how_much_and_how_sure():
    arm = replace(SECOND, against=[FIRST, OTHER])
    rows = [
        row("first_answer_mean", -340.0, -342.0, -338.0)._replace(arm=arm),
        row("streaming_f1", -0.02, -0.03, -0.01)._replace(arm=arm, against=OTHER),
        row("ghost_share", 0.02, -0.01, 0.05)._replace(arm=arm, against=OTHER),
    ]
    assert verdicts(ComparedRuns([FIRST, OTHER, arm], rows, ["town"], {})) == [
        "B is better than A in first answer, mean (-340 ms, -342 to -338); worse than C in "
        "streaming F1 (-2 percentage points, -3 to -1); not clearly different in false objects (+2 "
        "percentage points, -1 to +5); each against the best baseline; 95 % intervals of paired "
        "differences, over 5 seeds."
    ]


def test_what_does_not_differ_at_all_is_called_the_same():
    same = [row(metric, 0.0, 0.0, 0.0) for metric in ("first_answer_mean", "streaming_f1")]
    assert verdicts(comparison(*same)) == [
        "B is the same as A in first answer, mean and streaming F1."
    ]
    (sentence,) = verdicts(comparison(same[0], row("streaming_f1", -0.02, -0.03, -0.01)))
    assert sentence == (
        "B is worse than A in streaming F1 (-2 percentage points, -3 to -1); the "
        "same in first answer, mean; 95 % intervals of paired differences, over 5 seeds."
    )


@pytest.mark.parametrize(
    "of_seeds, verdict",
    [
        ([1.0, -1.0], ""),
        ([0.005, -0.005], "negligible"),
        ([0.02, -0.02, 0.0], ""),
        ([0.0, 0.0], "equal"),
        ([0.0, 0.0, 0.0], "equal"),
    ],
)
def test_without_an_interval_seeds_are_equal_where_each_is(of_seeds, verdict):
    paired = row("first_answer_mean", 0.0, None, None)._replace(of_seeds=of_seeds)
    assert paired.verdict == verdict


def test_a_row_without_a_reference_has_no_verdict():
    alone = Difference("first_answer_mean", FIRST, 1.0, registry.definition("first_answer_mean"))
    assert alone.verdict == ""


def test_two_seeds_are_not_said_to_have_an_interval():
    two = row("first_answer_mean", -340.0, None, None)._replace(
        by=SEEDS, n=2, of_seeds=(-330, -350)
    )
    made = comparison(two)
    assert made.by == "paired differences without intervals"
    assert "95 %" not in compare_tables.about(made)
    assert "95 %" not in differences(made).get_label()
    assert comparison(two._replace(low=-350.0, high=-330.0)).by.endswith("by seeds")


def test_without_truth_the_proxy_speaks_and_blocks_are_named():
    proxy = row("first_proxy_f1", 0.1, 0.05, 0.15)._replace(by=BLOCKS, n=12)
    (sentence,) = verdicts(comparison(proxy))
    assert sentence == (
        "B is better than A in proxy F1, first answer (+10 percentage points, +5 to +15); "
        "95 % intervals of paired differences, over 12 blocks (1 s of one car each) of one seed."
    )


def test_the_figure_has_a_panel_a_metric_with_a_point_an_interval_and_zero():
    rows = [
        row("first_answer_mean", -340.0, -342.0, -330.0),
        row("streaming_f1", 0.02, -0.01, 0.05),
    ]
    figure = differences(comparison(*rows))
    first, f1 = figure.axes
    titles = [panel.get_title() for panel in figure.axes]
    assert titles == ["(a) first answer, mean", "(b) streaming F1"]
    for panel, (low, middle, high) in ((first, (-342, -340, -330)), (f1, (-1, 2, 5))):
        zero, point, *caps = panel.lines
        assert list(zero.get_xdata()) == [0, 0]
        assert point.get_xdata()[0] == pytest.approx(middle)
        assert [cap.get_xdata()[0] for cap in caps] == pytest.approx([low, high])
    assert "lower is better" in first.get_xlabel() and "higher is better" in f1.get_xlabel()
