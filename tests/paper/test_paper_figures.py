"""The evaluation's figures: the paper's panels and sizes, the paper's numbers as marks, and nothing
cut off; and those of a run of one of its scenarios.
"""

from __future__ import annotations

import logging

import numpy as np
import pytest
from matplotlib.figure import Figure

import genie_sim as gs
from genie_sim.analysis import figures as drawing
from genie_sim.analysis import genie_metrics, style
from genie_sim.paper import curves, figures, numbers
from genie_sim.paper.checks import CASE, HO
from genie_sim.paper.curves import Key, Points
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.reproduce import Reproduction
from tests.checkout import REPOSITORY
from tests.drawn_text import faults

PAPER = REPOSITORY / "results" / "paper"
CARS = ["1 car", "2 cars", "3 cars"]
MAX_COLUMN_IN = 3.2
PANELS = {
    "latency_cdf": (2, 3),
    "image_reuse": (1, 2),
    "object_reuse": (1, 2),
    "confidence_boost": (1, 2),
    "case_study": (1, 2),
}
MARKS = {  # numbers that the paper prints, where it says them
    "latency_cdf": {"paper: 33 ms deadline": 33},
    "image_reuse": {},
    "object_reuse": {
        "paper: mean of all scenarios 31 %": 0.31,
        "paper: highest of all scenarios 67 %": 0.67,
    },
    "confidence_boost": {},
    "case_study": {"paper: under 41 ms": 41},
}


@pytest.fixture(scope="module", params=[style.COLUMN_IN, style.PAGE_IN], ids=["column", "page"])
def drawn(request) -> dict[str, Figure]:
    """Every figure of the committed evaluation, laid out."""
    made = Reproduction.read(PAPER).figures(request.param)
    for figure in made.values():
        drawing.svg(figure)
    return made


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for one in figure.legends for text in one.get_texts()]


@pytest.mark.slow
def test_sizes_and_panels_are_the_paper_s(drawn):
    assert {*drawn} == {*PANELS}
    for name, figure in drawn.items():
        width_in, height_in = figure.get_size_inches()
        assert width_in in (style.COLUMN_IN, style.PAGE_IN)
        assert height_in <= MAX_COLUMN_IN or width_in == style.PAGE_IN, name
        geometry = figure.axes[0].get_subplotspec().get_gridspec().get_geometry()
        assert geometry == PANELS[name] and len(figure.axes) == np.prod(geometry)
    titles = [axis.get_title() for axis in drawn["latency_cdf"].axes]
    assert titles == [f"({letter}) {cars}" for letter, cars in zip("abcdef", 2 * CARS, strict=True)]


@pytest.mark.slow
def test_axes_begin_at_zero_and_cut_nothing_off(drawn):
    for name, figure in drawn.items():
        for axis in figure.axes:
            low, high = axis.get_ylim()
            assert low == 0, name
            for line in axis.lines:
                y = np.asarray(line.get_ydata(), dtype=float)
                assert y.min(initial=0) >= 0 and y.max(initial=0) <= high, name
    assert all(axis.get_xlim()[0] == 0 for axis in drawn["confidence_boost"].axes)
    assert len(drawn["confidence_boost"].axes[0].lines) == 6, "1, 2, 3 cars, remote and local"


@pytest.mark.slow
def test_a_mark_of_the_paper_is_a_number_that_it_prints(drawn):
    for name, marks in MARKS.items():
        for axis in drawn[name].axes[: 1 if name == "case_study" else None]:
            of_paper = {
                line.get_label(): line
                for line in axis.lines
                if str(line.get_label()).startswith("paper")
            }
            assert of_paper.keys() == marks.keys(), name
            for label, value in marks.items():
                (x, _), (y, _) = of_paper[label].get_data()
                assert value in (x, y)
        assert {text for text in legend(drawn[name]) if text.startswith("paper")} == {*marks}


@pytest.mark.slow
def test_text_is_legible_whole_and_apart(drawn):
    assert {name: found for name, figure in drawn.items() if (found := faults(figure))} == {}


@pytest.mark.slow
def test_curves_and_bars_differ_in_greyscale(drawn):
    for axis in drawn["latency_cdf"].axes:
        lines = [line for line in axis.lines if line.get_drawstyle() == "steps-post"]
        assert len({(str(line.get_linestyle()), line.get_marker()) for line in lines}) == 3
    for axis in drawn["confidence_boost"].axes:
        assert len({(line.get_linestyle(), line.get_marker()) for line in axis.lines}) == 6
    bars = drawn["image_reuse"].axes[0].patches
    assert len({bar.get_hatch() for bar in bars}) > 1


def test_bars_are_those_of_the_evaluation_s_numbers():
    evidence = Evidence(numbers.read(PAPER))
    drawn = Reproduction.read(PAPER).figures()["image_reuse"].axes[0].patches
    for number, (scenario, place) in enumerate((s, p) for p in ("car", "edge") for s in HO):
        mean = evidence.of(scenario, numbers.placed("image_reuse", place)).mean()
        assert drawn[number].get_height() == pytest.approx(mean)


# Of one run


def short(name: str, *settings: str, cars: int = 1) -> gs.Run:
    windows = [f"cars[{car}].route.window=[3 s, 4 s]" for car in range(cars)]
    return gs.run(name, [*windows, *settings], seed=1)


def test_a_run_of_a_changed_scenario_has_no_figure_with_marks(caplog):
    with caplog.at_level(logging.WARNING):
        assert figures.of_run(short("1car_homo")) == {}
    assert caplog.messages == ["1car_homo: cars is not the paper's: no figure has its marks"]
    caplog.clear()
    assert figures.of_run(short("street_1car_homo")) == {} and not caplog.messages


@pytest.mark.slow
def test_a_run_of_the_paper_s_scenario_draws_its_panels():
    drawn = figures.of_run(gs.run("1car_homo", seed=3))
    assert [*drawn] == [f"paper_{name}" for name in PANELS if name != "case_study"]
    (axis,) = drawn["paper_latency_cdf"].axes
    assert axis.get_title() == "1 car"
    assert "paper: 33 ms deadline" in legend(drawn["paper_latency_cdf"])
    for figure in drawn.values():
        drawing.svg(figure)
        assert faults(figure) == []


@pytest.fixture(scope="module")
def of_case():
    return short("street_case_study", cars=2)


def test_boosts_end_at_the_totals_over_what_is_stored(of_case):
    found = curves.of_run(CASE, of_case.tables)
    maps = of_case.tables["lookups"]
    rows = maps.rows(maps["kind"] != "image").where(placement="edge")
    stored = sum(genie_metrics.last_of_genies(rows))
    x, y = found[Key(CASE, "boost", "edge")]
    assert y[-1] == pytest.approx(rows["boost_sum"].sum() / stored)
    assert x[-1] == len(rows)


def test_a_distribution_is_of_the_times_since_the_stamp(of_case):
    rows = of_case.frames.query("method == 'genie' and car == 'car1'")
    times_ms = (rows["first_answer_ns"] - rows["stamp_ns"]).dropna() / 1e6
    x, y = curves.of_run(CASE, of_case.tables)[Key(CASE, "time", "car1")]
    assert (x[-1], y[-1]) == (1, pytest.approx(times_ms.max(), abs=1e-3))
    assert y[99] == pytest.approx(times_ms.quantile(0.5, interpolation="lower"), rel=0.05)


def test_curves_of_seeds_are_pooled_and_read_as_written(tmp_path):
    time, boost = Key("1car_homo", "time", "genie"), Key("1car_homo", "boost", "edge")
    one = {time: Points(curves.SHARES, np.full(200, 10.0)), boost: Points([1.0, 9.0], [0.0, 0.8])}
    other = {time: Points(curves.SHARES, np.full(200, 30.0)), boost: Points([1.0, 5.0], [0.2, 0.2])}
    both = curves.pooled([one, other])
    assert (both[time].y[99], both[time].y[100]) == (10, 30), "half of the frames each"
    assert both[boost].x[-1] == 5, "as far as all seeds go"
    assert both[boost].y[-1] == pytest.approx((0.4 + 0.2) / 2)
    curves.write(tmp_path / "c.parquet", both)
    again = curves.read(tmp_path / "c.parquet")
    for key, points in both.items():
        np.testing.assert_array_equal(again[key], points)
