"""Figures of made-up numbers say what they did: titles, units, labels and extents."""

from __future__ import annotations

import pandas as pd
import pytest

from genie_sim.analysis import figures, registry
from genie_sim.analysis.compare import SEEDS, Arm, ComparedRuns, Difference
from genie_sim.analysis.points import differences, latency_accuracy
from genie_sim.record.columns import Columns
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue
from tests import make, outline
from tests.make import METHODS

FOOTER = "street_3car_hetero, run 0123456789ab, seed 1"


@pytest.fixture(scope="module")
def tables() -> dict[str, pd.DataFrame]:
    return make.tables()


def test_figures_of_a_run(tables):
    outline.check("run", figures.of_run(make.run_of(tables=tables), None))


def test_several_seeds_have_bands(tables):
    """Curves and bars of three seeds, of which one has other numbers."""
    seeds = [tables, tables, {"frames": make.frames(2, 3, seed=2).to_frame()}]
    seeds[2]["lookups"] = make.lookups(2, 120, seed=2, lift=2.0).to_frame()
    frames, lookups = ([Columns.of(seed[name]) for seed in seeds] for name in ("frames", "lookups"))
    drawn = {
        "latency_cdf": figures.latency_cdf(frames, METHODS, FOOTER),
        "image_reuse": figures.image_reuse(lookups, METHODS, FOOTER),
        "object_reuse": figures.object_reuse(lookups, METHODS, FOOTER),
        "confidence_boost": figures.confidence_boost(lookups, METHODS, FOOTER),
    }
    outline.check("seeds", drawn)


def accuracy(method: str, first_ms: float, f1: float) -> list[MetricValue]:
    return [
        MetricValue(
            "first_answer_mean", method, "all", "", first_ms, "ms", 0.9 * first_ms, first_ms + 3
        ),
        MetricValue("streaming_f1", method, "all", "", f1, "1", f1 - 0.05, f1 + 0.02),
        MetricValue("streaming_f1", method, "all", ZERO_DELAY, 0.7, "1", 0.6, 0.8),
    ]


def test_accuracy_versus_latency():
    one = [
        metric
        for i, method in enumerate(METHODS)
        for metric in accuracy(method.name, 9 + 150 * i, 0.3 + 0.1 * i)
    ]
    outline.check("latency accuracy", {"one run": latency_accuracy(one, METHODS, FOOTER)})


def test_differences():
    first = Arm(MethodInfo("a", "A", False), {})
    others = {
        name: Arm(MethodInfo(name, name.upper(), False), {}, against=[first]) for name in "bc"
    }

    def row(metric: str, arm: str, difference: float, reach: float | None) -> Difference:
        low, high = (None, None) if reach is None else (difference - reach, difference + reach)
        about = registry.definition(metric)
        return Difference(
            metric, others[arm], 1.0, about, first, 1.0, difference, low, high, by=SEEDS, n=5
        )

    arms = [first, *others.values()]
    rows = [
        row("first_answer_mean", "b", -340.0, 6.0),
        row("first_answer_mean", "c", 12.5, 30.0),
        row("streaming_f1", "b", 0.02, 0.03),
        row("streaming_f1", "c", -0.04, None),
        row("ghost_share", "b", 0.1, 0.01),
    ]
    outline.check("differences", {"of two": differences(ComparedRuns(arms, rows, ["town"], {}))})
