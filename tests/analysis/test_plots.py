"""Figures by name: what each draws when nothing more is said."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from genie_sim.analysis.plots import Plots
from genie_sim.base.errors import UserError
from genie_sim.record.results import Run
from tests import make


@pytest.fixture(scope="module")
def run() -> Run:
    tables = make.tables(1, 2)
    of_local = tables["resources"]["method"] == "local"
    busy_ns = tables["resources"]["busy_ns"] * (1 - 0.5 * of_local)  # methods differ
    tables["resources"] = tables["resources"].assign(busy_ns=busy_ns)
    return make.run_of((), tables=tables)


@pytest.mark.parametrize("name", ["image_reuse", "object_reuse", "confidence_boost", "latency_cdf"])
def test_a_figure_in_a_panel_of_ones_own_is_that_figure(run: Run, name: str):
    figure = Figure()
    panel, other = figure.subplots(2)
    assert getattr(Plots(run), name)(ax=panel) is figure
    alone = getattr(Plots(run), name)().axes[0]
    for marks in ("lines", "patches", "collections"):
        assert len(getattr(panel, marks)) == len(getattr(alone, marks))
    assert alone.figure._repr_png_().startswith(b"\x89PNG")  # what a notebook shows
    assert panel.has_data() and not other.has_data()
    assert panel.get_ylabel() == alone.get_ylabel() != ""


def test_what_a_run_has_not_is_one_line(run: Run):
    with pytest.raises(UserError, match=r"^latency_accuracy: "):
        Plots(run).latency_accuracy()
