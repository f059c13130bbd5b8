"""The evaluation's figures: the paper's panels and sizes, the reading's metrics, the paper's
numbers as marks, and nothing cut off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from genie_sim.analysis import figures, frame_metrics, genie_metrics, style
from genie_sim.paper import figure_data, paper_figures
from genie_sim.paper.checks import CASE, HE, HO
from genie_sim.paper.definitions import USUAL, Definitions, meant
from genie_sim.paper.figure_data import Key
from genie_sim.paper.runs import EvaluationRun
from genie_sim.record import provenance
from tests.checkout import REPOSITORY
from tests.drawn_text import faults

PAPER = REPOSITORY / "results" / "paper"
OTHER = Definitions("stamp", "all_requests", "running", "per_object")
CARS = ["1 car", "2 cars", "3 cars"]
MAX_COLUMN_IN = 3.2
PANELS = {
    "latency_cdf": (2, 3),
    "latency_cdf_of_published": (2, 3),
    "image_reuse": (1, 2),
    "object_reuse": (1, 2),
    "confidence_boost": (1, 2),
    "case_study": (1, 2),
    "worth": (1, 1),
}
MARKS = {
    "latency_cdf": (
        "33 ms deadline",
        "paper: overhead 8.8 ms",
        "paper: 82 % below L and R",
        "paper: at best 95 % below",
    ),
    "image_reuse": ("paper: a fourth of 31 %",),
    "object_reuse": ("paper: mean 31 %", "paper: highest 67 %", "paper: 4 × image reuse"),
    "case_study": ("paper: under 41 ms",),
}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=[USUAL, OTHER], ids=["usual", "other"])
def shown(request) -> paper_figures.FirstReading:
    """What is committed, named as if the metrics were what a reading means."""
    return replace(paper_figures.shown_of(PAPER), definitions=request.param)


@pytest.fixture(scope="module", params=[style.COLUMN_IN, style.PAGE_IN], ids=["column", "page"])
def drawn(shown, request) -> dict[str, Figure]:
    """Every figure, laid out."""
    worth = provenance.read_json(PAPER / "quality.json")
    makers = paper_figures.makers_of(replace(shown, width_in=request.param), worth)
    made = {name: make() for name, make in makers.items()}
    for figure in made.values():
        figures.svg(figure)
    return made


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for one in figure.legends for text in one.get_texts()]


def first_points(figure: Figure) -> list[tuple[float, float]]:
    """Where each line of the first panel begins."""
    lines = [line.get_data() for line in figure.axes[0].lines]
    return [(x[0], y[0]) for x, y in lines if len(x)]


def test_sizes_and_panels_are_the_paper_s(drawn):
    assert set(drawn) == set(PANELS) == set(figure_data.FIGURES)
    for name, figure in drawn.items():
        width_in, height_in = figure.get_size_inches()
        assert width_in in (style.COLUMN_IN, style.PAGE_IN)
        assert height_in <= MAX_COLUMN_IN or width_in == style.PAGE_IN, name
        geometry = figure.axes[0].get_subplotspec().get_gridspec().get_geometry()
        assert geometry == PANELS[name] and len(figure.axes) == np.prod(geometry)
    titles = [axis.get_title() for axis in drawn["latency_cdf"].axes]
    assert titles == [f"({letter}) {cars}" for letter, cars in zip("abcdef", 2 * CARS, strict=True)]


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


def test_the_paper_s_numbers_stand_in_the_figures(drawn):
    for name, labels in MARKS.items():
        told = legend(drawn[name])
        for label in labels:
            assert any(text.startswith(label) for text in told), (name, label)
    heights = {float(y) for _, y in first_points(drawn["object_reuse"])}
    assert {0.31, 0.67} <= heights
    assert {8.8, 33.0} <= {float(x) for x, _ in first_points(drawn["latency_cdf"])}
    assert 41.0 in {float(x) for x, _ in first_points(drawn["case_study"])}


def test_each_figure_names_the_reading_and_what_it_means(drawn, shown):
    for figure in drawn.values():
        assert figure._suptitle.get_text().startswith("reading bench, 10 seeds: ")
    assert paper_figures.TIMES[shown.definitions.time] in drawn["latency_cdf"]._suptitle.get_text()
    assert paper_figures.ERROR_BARS[shown.definitions.error_bars] in legend(drawn["image_reuse"])


def test_bars_and_error_bars_are_those_of_the_evaluation_s_numbers():
    numbers = {
        (row["scenario"], row["metric"], row["placement"]): row["value"]
        for row in provenance.read_json(PAPER / "metrics.json")
        if row["reading"] == provenance.read_json(PAPER / "readings.json")[0]["name"]
    }
    shown = paper_figures.shown_of(PAPER)
    for of_images, metric in ((True, "image_reuse"), (False, "object_reuse")):
        for scenario in (HO[1], HE[2]):
            for placement, (mean, low, high) in shown.bars(scenario, of_images).items():
                names = (meant(name, shown.definitions) for name in (metric, f"{metric}_high"))
                expected = [numbers[scenario, name, placement] for name in names]
                assert [mean, high] == pytest.approx(expected, rel=1e-5) and low <= mean


def test_text_is_legible_whole_and_apart(drawn):
    assert {name: found for name, figure in drawn.items() if (found := faults(figure))} == {}


def test_curves_and_bars_differ_in_greyscale(drawn):
    for axis in drawn["latency_cdf"].axes:
        curves = [line for line in axis.lines if line.get_drawstyle() == "steps-post"]
        assert len({(str(line.get_linestyle()), line.get_marker()) for line in curves}) == 3
    for axis in drawn["confidence_boost"].axes:
        looks = {(line.get_linestyle(), line.get_marker()) for line in axis.lines}
        assert len(looks) == 6
    for name in ("image_reuse", "worth"):
        bars = drawn[name].axes[0].patches
        assert len({bar.get_hatch() for bar in bars}) > 1


@pytest.fixture(scope="module")
def tables():
    """Of two seeds of a short run with two cars, one of which has no cameras."""
    short = ("cars[0].route.window=[3 s, 4 s]", "cars[1].route.window=[3 s, 4 s]")
    run = EvaluationRun("street_case_study", 1, short, ("genie",), shown=True)
    return [replace(run, seed=seed).simulate().tables for seed in (1, 2)]


def test_boosts_end_at_the_totals_over_what_is_stored(tables):
    (rows, _) = figure_data.lookups(tables, USUAL, False, placement="edge")
    of_updates = genie_metrics.boost_over_events(rows, per_object=False)
    of_objects = genie_metrics.boost_over_events(rows, per_object=True)
    total = rows["boost_sum"].sum()
    assert of_updates["boost"][-1] == pytest.approx(total / rows["updates"].sum())
    stored = sum(genie_metrics.last_of_genies(rows))
    assert of_objects["boost"][-1] == pytest.approx(total / stored)
    assert of_updates["events"][-1] == of_objects["events"][-1] == len(rows)


def test_what_is_drawn_is_what_a_reading_means(tables, tmp_path):
    usual, other = (figure_data.drawn({CASE: tables}, each) for each in (USUAL, OTHER))
    waits_ms = other[Key(CASE, "mean", "car1")].y - usual[Key(CASE, "mean", "car1")].y
    assert (waits_ms > 0).all(), "since the stamp and not since the queue"
    assert other[Key(CASE, "boost", "edge")].y[-1] > usual[Key(CASE, "boost", "edge")].y[-1]
    figure_data.write(tmp_path, {CASE: tables}, OTHER)
    again = figure_data.read(tmp_path)
    assert again.keys() == other.keys()
    for key, points in other.items():
        np.testing.assert_array_equal(again[key], points)


def test_a_distribution_keeps_its_ends_its_mean_and_the_share_of_answers(tables):
    rows = [one["frames"].where(car="car1") for one in tables]
    times_ms = np.concatenate([frame_metrics.response_ms(one, "fresh") for one in rows])
    x, y = figure_data.drawn({CASE: tables}, USUAL)[Key(CASE, "fresh", "car1")]
    answered = times_ms[~np.isnan(times_ms)]
    assert 0 < len(answered) < len(times_ms) and len(y) <= figure_data.TIME_POINTS + 2
    assert [np.nanmin(y), np.nanmax(y)] == pytest.approx([answered.min(), answered.max()], abs=1e-3)
    assert x[~np.isnan(y)][-1] == len(answered) / len(times_ms)
