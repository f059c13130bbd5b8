"""The figure of accuracy versus latency: where its marks and bars are."""

from __future__ import annotations

import numpy as np

from genie_sim.analysis.points import drawable, latency_accuracy
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue

METHODS = [MethodInfo("remote", "remote (R)", True), MethodInfo("genie", "Genie (DG)", False)]


def numbers(accuracy: str = "streaming_f1") -> list[MetricValue]:
    """Intervals that reach differently far to each of the four sides."""
    return [
        MetricValue("first_answer_mean", "remote", "all", "", 50.0, "ms", 49.0, 53.0),
        MetricValue(accuracy, "remote", "all", "", 0.5, "1", 0.45, 0.52),
        MetricValue("first_answer_mean", "genie", "all", "", 9.0, "ms", 8.5, 9.1),
        MetricValue(accuracy, "genie", "all", "", 0.3, "1", 0.1, 0.6),
        MetricValue(accuracy, "remote", "all", ZERO_DELAY, 0.7, "1", 0.6, 0.8),
    ]


def test_marks_are_at_the_values_and_bars_end_where_the_intervals_end():
    (axis,) = latency_accuracy(numbers(), METHODS).axes
    points = axis.containers
    assert [point.get_label() for point in points] == ["remote (R)", "Genie (DG)"]
    for point, at, ends_ms, ends in (
        (points[0], (50.0, 0.5), (49.0, 53.0), (0.45, 0.52)),
        (points[1], (9.0, 0.3), (8.5, 9.1), (0.1, 0.6)),
    ):
        mark, _, (across, upright) = point
        assert np.allclose(np.ravel(mark.get_xydata()), at)
        assert np.allclose(across.get_segments()[0], [(ends_ms[0], at[1]), (ends_ms[1], at[1])])
        assert np.allclose(upright.get_segments()[0], [(at[0], ends[0]), (at[0], ends[1])])
    (bound,) = [line for line in axis.get_lines() if line.get_label() == "zero-delay detector"]
    assert list(bound.get_ydata()) == [0.7, 0.7]
    assert axis.get_xlabel() == "first answer, mean [ms], logarithmic"
    assert axis.get_ylabel() == "streaming F1"


def test_the_proxy_is_drawn_only_where_a_run_has_no_truth():
    proxy = numbers("first_proxy_f1")
    assert drawable([]) is None
    assert drawable([*proxy, *numbers()]) == "streaming_f1"
    (axis,) = latency_accuracy(proxy, METHODS).axes
    assert axis.get_ylabel() == "proxy F1, first answer"
