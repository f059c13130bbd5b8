"""The distribution of response times over several seeds: its mean, and the band around it."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.analysis.latency_cdf import latency_cdf
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.statistics import mean_and_spread, mean_bands
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo

METHOD = [MethodInfo("genie", "Genie (DG)", baseline=False)]
MS = 1_000_000


def frames(*answers_ms: float | None) -> Columns:
    """One frame for each time to its first answer, which is no fresh one."""
    nan = float("nan")
    first = np.array([nan if ms is None else ms * MS for ms in answers_ms])
    n = len(first)
    columns = {"stamp_ns": np.zeros(n), "first_answer_ns": first}
    return Columns({**columns, "fresh_answer_ns": np.full(n, nan)}).assign(method="genie")


SEEDS = [frames(10, 20, 30, 40), frames(10, 15, 35, None), frames(12, 20, 25, 30)]


def test_the_curve_is_the_mean_over_seeds_and_the_band_its_interval():
    """At 20 ms two, two and two of four frames are answered; at 30 ms three, two and four."""
    (axis,) = latency_cdf(SEEDS, METHOD).axes
    line = axis.lines[0]
    x, y = map(np.asarray, line.get_data())
    at = dict(zip(x.tolist(), y.tolist(), strict=True))
    assert at[20.0] == pytest.approx(2 / 4)
    assert at[30.0] == pytest.approx(9 / 12)
    assert y[-1] == pytest.approx((1 + 3 / 4 + 1) / 3), "a curve ends at what was answered"
    (band,) = axis.collections
    edges = band.get_paths()[0].vertices
    at_30 = edges[np.isclose(edges[:, 0], 30.0)][:, 1]
    spread = mean_and_spread([3 / 4, 2 / 4, 1.0])
    low, high = METRICS["under_deadline_share"].over_seeds(*spread, len(SEEDS), rows=4)
    assert (at_30.min(), at_30.max()) == pytest.approx((low, high)), "as in tables"
    assert edges[:, 1].min() >= 0 and edges[:, 1].max() <= 1


def test_a_band_of_numbers_is_students_t():
    from scipy import stats

    seeds = np.array([[1.0, 5.0], [2.0, 5.0], [6.0, 5.0]])
    mean, low, high = mean_bands(seeds)
    expected = stats.t.interval(0.95, 2, loc=3.0, scale=stats.sem(seeds[:, 0]))
    assert (low[0], high[0]) == pytest.approx(expected)
    assert (mean[1], low[1], high[1]) == (5.0, 5.0, 5.0)


def test_two_seeds_have_a_mean_and_are_not_said_to_have_an_interval():
    assert "95 %" in latency_cdf(SEEDS, METHOD).get_label()
    two = latency_cdf(SEEDS[:2], METHOD).get_label()
    assert "means of 2 seeds" in two and "95 %" not in two


def test_one_seed_has_no_band_and_a_users_own_panel_is_drawn_into():
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2)
    assert latency_cdf(SEEDS[:1], METHOD, ax=right) is figure
    assert not left.lines and len(right.lines) == 2 and not right.collections
    assert right.get_legend() is not None
    plt.close(figure)
