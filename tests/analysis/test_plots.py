"""Figures by name: what each draws when nothing more is said."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis.plots import Plots
from genie_sim.base.errors import UserError
from genie_sim.record.columns import Columns
from genie_sim.record.results import Run
from tests import made_up_run
from tests.made_up_run import METHODS


@pytest.fixture(scope="module")
def run() -> Run:
    facts = {
        "scenario": {"name": "made up", "seed": 1},
        "methods": [asdict(method) for method in METHODS],
    }
    made = {
        "frames": made_up_run.frames(1, 2),
        "lookups": made_up_run.lookups(1, 60),
        "resources": made_up_run.resources(1, 20),
    }
    tables = {name: Columns.of(table.to_frame()) for name, table in made.items()}
    of_local = tables["resources"]["method"] == "local"
    busy_ns = tables["resources"].floats("busy_ns") * (1 - 0.5 * of_local)  # methods differ
    tables["resources"] = tables["resources"].assign(busy_ns=busy_ns)
    return Run("0123456789ab", facts, "", tables, ())


@pytest.mark.parametrize("name", ["image_reuse", "object_reuse", "confidence_boost", "latency_cdf"])
def test_a_figure_in_a_panel_of_ones_own_is_that_figure(run: Run, name: str):
    figure = Figure()
    panel, other = figure.subplots(2)
    assert getattr(Plots(run), name)(ax=panel) is figure
    alone = getattr(Plots(run), name)().axes[0]
    for marks in ("lines", "patches", "collections"):
        assert len(getattr(panel, marks)) == len(getattr(alone, marks))
    assert panel.has_data() and not other.has_data()
    assert panel.get_ylabel() == alone.get_ylabel() != ""


def legend(panel: Axes) -> list[str]:
    named = panel.get_legend()
    assert named is not None
    return [text.get_text() for text in named.get_texts()]


@pytest.mark.parametrize("labels", [("one", "two"), ("", "")])
def test_runs_in_one_panel_are_told_apart_and_have_one_deadline(run: Run, labels: tuple[str, str]):
    first, second = (
        replace(run, run_id=f"{place}23456789ab", label=label) for place, label in enumerate(labels)
    )
    names = labels if labels[0] else ("made up 023456", "made up 123456")
    panel = Figure().subplots()
    Plots(first).latency_cdf(ax=panel)
    alone = legend(panel)
    assert not any(": " in text for text in alone)
    Plots(second).latency_cdf(ax=panel)
    shared = {"33 ms deadline", "fresh results"}
    expected = {f"{name}: {text}" for name in names for text in alone if text not in shared}
    assert sorted(legend(panel)) == sorted(expected | (shared & {*alone}))
    assert sum(line.get_label() == "33 ms deadline" for line in panel.lines) == 1
    colours = {str(line.get_label()): line.get_color() for line in panel.lines}
    assert len({colours[text] for text in expected}) == len(expected)


def test_boosts_of_two_runs_are_told_apart_and_bars_are_refused(run: Run):
    first, second = (replace(run, run_id=f"{place}23456789ab", label=f"{place}") for place in "ab")
    panel = Figure().subplots()
    Plots(first).confidence_boost(ax=panel)
    Plots(second).confidence_boost(ax=panel)
    looks = {(str(line.get_color()), str(line.get_linestyle())) for line in panel.lines}
    assert len(looks) == len(panel.lines) == len(set(legend(panel)))
    panel.clear()
    Plots(first).image_reuse(ax=panel)
    with pytest.raises(UserError, match="image_reuse: bars of two runs need a panel each"):
        Plots(second).image_reuse(ax=panel)


def test_the_curve_is_of_published_frames_unless_of_answered_ones(run: Run):
    def end(**of: str) -> float:
        (local,) = (
            line
            for line in Plots(run).latency_cdf(**of).axes[0].lines
            if str(line.get_label()).startswith("local")
        )
        return float(local.get_ydata()[-1])

    assert end() == end(of="published") < end(of="answered") == 1.0


def test_what_a_run_has_not_is_one_line(run: Run):
    for name, lacks in (
        ("latency_accuracy", "no accuracy"),
        ("time_parts", "no steps"),
    ):
        with pytest.raises(UserError, match=f"^{name}: .*{lacks}"):
            getattr(Plots(run), name)()
