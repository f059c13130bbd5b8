"""Figures: they show the numbers of the tables, say so in words, and come out the same byte for
byte.
"""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from genie_sim.analysis import figures, metrics, style
from genie_sim.cli.main import main
from genie_sim.record.columns import Columns
from genie_sim.record.records import LOOKUPS, new_tables
from genie_sim.record.results import MethodInfo
from genie_sim.sim.method import METHODS as METHOD_CLASSES
from tests import make
from tests.drawn_text import faults
from tests.make import METHODS

FOOTER = "street_3car_hetero, run 0123456789ab, seed 1"


@pytest.fixture(scope="module")
def tables() -> dict[str, pd.DataFrame]:
    return make.tables()


def words(path: Path) -> str:
    """All text of an SVG."""
    return " | ".join(re.findall(r">([^<>]+)</(?:text|tspan)>", path.read_text()))


def curves(figure, panel: int = 0) -> dict[str, tuple]:
    """By the label, without the share behind it."""
    return {
        re.sub(r", [\d.]+ %$", "", line.get_label()): line.get_data()
        for line in figure.axes[panel].lines
    }


@pytest.mark.slow
def test_every_figure_of_a_run_names_the_run_its_units_and_what_is_drawn(tables, tmp_path):
    expected = {
        "latency_cdf": [
            "local (L)",
            "remote (R)",
            "Genie (DG)",
            "fresh results",
            "33 ms deadline",
        ],
        "image_reuse": [
            "Genies on cars",
            "Genies on edges",
            "image reuse",
            "lowest and highest running ratio of a Genie",
        ],
        "object_reuse": ["object reuse", "Genies on cars", "Genies on edges"],
        "confidence_boost": ["Genies on cars", "Genies on edges", "events recorded so far"],
        "resources": [
            "utilization",
            "car1.accelerator",
            "car2-&gt;edge2",
            "Genie (DG)",
        ],
    }
    run_id, drawn = "0123456789ab", figures.of_run(make.run_of(tables=tables))
    assert set(drawn) == set(expected)
    for name, figure in drawn.items():
        svg, png = figures.save(figure, tmp_path, name)
        assert png.read_bytes().startswith(b"\x89PNG")
        text = words(svg)
        for label in expected[name]:
            assert label in text, (name, label, text)
        title, footer = figure.get_label().split("\n")
        told = [f"<dc:title>{title}</dc:title>", f"<dc:description>{FOOTER}</dc:description>"]
        assert footer == FOOTER and all(one in svg.read_text() for one in told)
        assert title not in text and run_id not in text, "a paper has a caption"


@pytest.mark.slow
def test_the_same_tables_give_the_same_bytes_whatever_the_user_s_settings(tables, tmp_path):
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder, font_size in zip(folders, (10, 33), strict=True):
        folder.mkdir()
        with mpl.rc_context({"font.size": font_size, "axes.grid": False, "svg.hashsalt": None}):
            for name, figure in figures.of_run(make.run_of(tables=tables)).items():
                figures.save(figure, folder, name)
    for path in sorted(folders[0].iterdir()):
        assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name


@pytest.mark.slow
def test_figures_fit_a_column_and_their_text_is_legible(tables):
    """At most 3.2 inches high there, also with as many devices as are ever shown."""
    one = make.run_of(tables=tables)
    drawn = figures.of_run(one, style.COLUMN_IN)
    many = [MethodInfo(f"m{place}", f"cache {place}", baseline=False) for place in range(8)]
    frames = pd.concat([tables["frames"].assign(method=method.name) for method in many])
    loaded = make.run_of(tables=tables | {"resources": make.resources(6, 10).to_frame()})
    drawn["many devices"] = figures.makers(loaded, style.COLUMN_IN)["resources"]()
    drawn["many methods"] = figures.latency_cdf([Columns.of(frames)], many, FOOTER, style.COLUMN_IN)
    for name, figure in drawn.items():
        figures.svg(figure)  # lays it out
        assert faults(figure) == [], name
        assert figure.get_figheight() <= 3.2, name


@pytest.mark.slow
def test_curves_of_several_runs_in_one_panel_differ_in_line_and_marker(tables):
    names = [f"{run}: {method}" for run in ("old", "new") for method in ("local", "genie")]
    methods = [MethodInfo(name, name, baseline=False) for name in names]
    frames = pd.concat(
        [
            tables["frames"][tables["frames"]["method"] == name.partition(": ")[2]].assign(
                method=name
            )
            for name in names
        ]
    )
    figure = figures.latency_cdf([Columns.of(frames)], methods, FOOTER)
    firsts = [line for line in figure.axes[0].lines if line.get_label() in names]
    looks = {(str(line.get_linestyle()), line.get_marker()) for line in firsts}
    assert len(looks) == len(firsts) == 4


def test_methods_and_placements_differ_without_colour():
    assert len({str(style.method_line(look)["linestyle"]) for look in range(4)}) == 4
    assert len({str(style.method_line(look)) for look in range(48)}) == 48
    assert len({(style.method_colour(look), style.method_marker(look)) for look in range(96)}) == 96
    assert len(style.COLOURS) == len({*style.COLOURS})
    assert len({str(style.PLACEMENT_LINES[where]["linestyle"]) for where in style.PLACEMENTS}) == 2
    assert len({style.PLACEMENT_BARS[where]["hatch"] for where in style.PLACEMENTS}) == 2


def test_a_method_looks_the_same_whatever_ran_beside_it():
    """Every registered method has a look of its own; others go by their order; under another
    setting a method keeps its colour.
    """
    assert {*METHOD_CLASSES} <= {*style.METHOD_STYLES}
    registered = style.method_styles(list(METHOD_CLASSES))
    assert len({*registered}) == len(METHOD_CLASSES)
    assert style.method_styles(["genie"]) == style.method_styles(["local", "genie"])[1:]
    assert style.method_styles(["mine", "genie", "theirs"]) == [4, 2, 5]
    assert not {*registered} & {*style.method_styles(["a", "b", "c"])}
    before, after, other = style.method_styles(["old: genie", "new: genie", "new: remote"])
    assert before == 2 != after and other == 1
    assert style.method_colour(before) == style.method_colour(after)
    many = style.method_styles([f"{setting}: genie" for setting in range(60)])
    assert len({*many}) == 60


def test_equal_curves_are_told_apart_and_a_legend_takes_a_fifth_at_most(tables):
    frames = tables["frames"]
    genie = frames[frames["method"] == "genie"]
    methods = [MethodInfo(f"genie{place}", f"cache {place}", baseline=False) for place in range(9)]
    same = pd.concat([genie.assign(method=method.name) for method in methods], ignore_index=True)
    figure = figures.latency_cdf([Columns.of(same)], methods, FOOTER, style.COLUMN_IN)
    titles = {method.title for method in methods}
    firsts = [line for line in figure.axes[0].lines if line.get_label() in titles]
    assert len({line.get_markevery() for line in firsts}) == len(methods)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    height = legend.get_window_extent(FigureCanvasAgg(figure).get_renderer()).height
    assert 0.1 < height / figure.bbox.height < 0.21


def test_a_placement_is_never_in_a_method_s_colour():
    tones = [style.PLACEMENT_BARS[where]["facecolor"] for where in style.PLACEMENTS]
    tones += [style.PLACEMENT_LINES[where]["color"] for where in style.PLACEMENTS]
    assert not {mpl.colors.to_hex(tone).upper() for tone in tones} & set(style.COLOURS)


@pytest.mark.slow
def test_methods_of_any_name_and_number_are_drawn_in_their_order(tables, tmp_path):
    """Two of them run Genies: bars, boosts and the legends tell whose they are."""
    frames, lookups = tables["frames"], tables["lookups"]
    methods = [
        MethodInfo(name, name.title(), baseline=False) for name in ("swift", "genie", "remote")
    ]
    both = pd.concat([lookups, lookups.assign(method="swift")], ignore_index=True)
    swift = frames[frames["method"] == "genie"].assign(method="swift")
    changed = {"frames": pd.concat([swift, frames]), "lookups": both}
    drawn = figures.of_run(make.run_of(None, methods, tables | changed))
    told = {name: words(figures.save(figure, tmp_path, name)[0]) for name, figure in drawn.items()}
    assert "Swift" in told["latency_cdf"] and "fresh results" in told["latency_cdf"]
    assert "local" not in told["latency_cdf"].lower()
    assert curves(drawn["latency_cdf"])["Swift"][1][-1] == 1.0
    colours = {line.get_label(): line.get_color() for line in drawn["latency_cdf"].axes[0].lines}
    assert colours["Genie"] == style.COLOURS[2] and colours["Remote"] == style.COLOURS[1]
    assert colours["Swift"] == style.COLOURS[style.FIRST_OWN_STYLES[0]]
    assert (
        "Swift, on cars" in told["confidence_boost"]
        and "Genie, on edges" in told["confidence_boost"]
    )
    assert len(drawn["image_reuse"].axes[0].get_xticklabels()) == 2
    markers = {line.get_marker() for line in drawn["confidence_boost"].axes[0].lines}
    assert len(markers) == 2, "told apart without colour"


def test_frames_that_were_never_answered_keep_the_curve_below_one(tables):
    frames = tables["frames"]
    measured = metrics.compute(METHODS, tables)
    answered = {one.method: one.value for one in measured if one.metric == "answered_share"}
    published = curves(figures.latency_cdf([Columns.of(frames)], METHODS, FOOTER))
    for method in METHODS:
        assert published[method.title][1][-1] == pytest.approx(answered[method.name])
    assert answered["local"] < 0.5 < answered["genie"]  # else this shows nothing


def test_the_curve_passes_the_median_at_one_half(tables):
    frames = tables["frames"][tables["frames"]["first_answer_ns"].notna()]
    genie = curves(figures.latency_cdf([Columns.of(frames)], METHODS, FOOTER))["Genie (DG)"]
    median = next(x for x, y in zip(*genie, strict=True) if y >= 0.5)
    found = metrics.compute(METHODS, tables)
    (expected,) = [m.value for m in found if (m.metric, m.method) == ("first_answer_p50", "genie")]
    assert median == pytest.approx(expected, rel=0.02)


def test_bars_are_the_metrics_and_error_bars_their_ranges(tables):
    figure = figures.image_reuse([Columns.of(tables["lookups"])], METHODS, FOOTER)
    found = metrics.compute(METHODS, tables)
    reuse = {metric.placement: metric for metric in found if metric.metric == "image_reuse"}
    bars = [bar.get_height() for bar in figure.axes[0].patches]
    assert bars == pytest.approx([reuse["car"].value, reuse["edge"].value])
    (label,) = figure.axes[0].get_xticklabels()
    assert label.get_text() == "Genie (DG)", "whose reuse it is, not which run"
    whiskers = [lines.get_segments() for lines in figure.axes[0].collections]
    tops = [segments[0][:, 1].max() for segments in whiskers if segments]
    assert tops == pytest.approx([reuse["car"].range_high, reuse["edge"].range_high])


def test_a_figure_is_as_wide_as_a_column_of_ieeetran():
    r"""``\columnwidth`` is 252 pt, 72.27 to the inch; PDF has 72 of its own."""
    to = io.BytesIO()
    figures.one_panel(style.WIDTHS["column"], 2.0, None)[0].savefig(to, format="pdf")
    (width,) = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ", to.getvalue())
    assert float(width) / 72 * 72.27 == pytest.approx(252, abs=0.01)


@pytest.mark.slow
def test_a_paper_s_widths(tables):
    for name, width_in in style.WIDTHS.items():
        drawn = figures.of_run(make.run_of(tables=tables), width_in)
        assert {figure.get_figwidth() for figure in drawn.values()} == {width_in}, name


@pytest.mark.slow
def test_no_legend_lies_on_data_and_all_of_it_is_on_the_figure(tables):
    for name, figure in figures.of_run(make.run_of(tables=tables)).items():
        figure.draw_without_rendering()
        renderer = FigureCanvasAgg(figure).get_renderer()
        for legend in figure.legends:
            box = legend.get_window_extent(renderer)
            panels = [axis.get_tightbbox(renderer) for axis in figure.axes]
            assert not any(box.overlaps(panel) for panel in panels), name
            assert box.x0 >= 0 and box.x1 <= figure.bbox.width, name


@pytest.mark.slow
@pytest.mark.parametrize("width_in", [style.COLUMN_IN, style.PAGE_IN])
def test_the_names_and_numbers_of_many_methods_do_not_overlap(tables, width_in):
    lookups = tables["lookups"]
    methods = [
        MethodInfo(f"method{place}", f"another cache {place}", baseline=False) for place in range(8)
    ]
    looked_up = pd.concat(
        [lookups[lookups["method"] == "genie"].assign(method=one.name) for one in methods],
        ignore_index=True,
    )
    bars = figures.image_reuse([Columns.of(looked_up)], methods, FOOTER, width_in)
    FigureCanvasAgg(bars).draw()
    names = bars.axes[0].get_xticklabels()
    numbers = [text for text in bars.axes[0].texts if text.get_text()]
    for texts in (names, numbers):
        boxes = [text.get_window_extent() for text in texts]
        assert len(boxes) >= len(methods)
        assert not any(
            one.overlaps(other) for place, one in enumerate(boxes) for other in boxes[:place]
        )


def test_first_updates_do_not_flatten_the_confidence_boost(tables):
    lookups = tables["lookups"].copy()
    first = lookups.index[lookups["updates"] > 0][0]
    lookups.loc[first, "boost_sum"] = 1000.0 * lookups["boost_sum"].max()
    axis = figures.confidence_boost([Columns.of(lookups)], METHODS).axes[0]
    assert axis.get_ylim()[1] < 0.2 * max(line.get_ydata().max() for line in axis.lines)


def test_the_busiest_devices_and_links_are_drawn_where_their_utilization_is(tables):
    """A row each, of no more than 12, a point for each method; what is idle is left out."""
    run = make.run_of(tables=tables | {"resources": make.resources(6, 10).to_frame()})
    used = [one for one in run.measured if one.metric == "utilization"]
    use = {(one.method, one.component): one.value for one in used}
    axis = figures.resource_use(run.measured, METHODS).axes[0]
    names = [tick.get_text() for tick in axis.get_yticklabels()]
    highest = {name: max(use[one.name, name] for one in METHODS) for _, name in use}
    assert len(names) == 12 < len(highest)
    assert min(highest[name] for name in names) >= sorted(highest.values())[-12]
    drawn = {
        (point.get_label(), names[round(row)], x)
        for point in axis.containers
        for x, row in point[0].get_xydata().tolist()
    }
    titles = {method.name: method.title for method in METHODS}
    assert drawn == {
        (titles[method], name, value) for (method, name), value in use.items() if name in names
    }
    idle = [one._replace(value=0.0) for one in run.measured]
    assert "resources" not in figures.of_run(replace(run, measured=idle))


def test_a_run_in_which_nothing_happened_has_figures_too(tmp_path):
    drawn = figures.of_run(
        make.run_of(tables={name: table.columns() for name, table in new_tables().items()})
    )
    assert "image_reuse" not in drawn  # no Genie was simulated
    for name, figure in drawn.items():
        figures.save(figure, tmp_path, name)
    miss = {"kind": "image", "requester": "client", "requests": 1, "entries": 1}
    asked = make.row(LOOKUPS, method="genie", genie="car1/genie", placement="car", **miss)
    lookups = make.table(LOOKUPS, asked)
    figures.save(figures.image_reuse([lookups.columns()], METHODS), tmp_path, "image_reuse")
    assert "none" in words(tmp_path / "image_reuse.svg")  # no Genie on an edge


@pytest.mark.slow
def test_figures_of_a_result_are_drawn_when_asked_for(capsys, tmp_path):
    """Every format, the same bytes twice; another format or folder is refused in one line."""
    few = [
        "--set",
        "cars[0].route.window=[0 s, 1 s]",
        "--set",
        "methods=[local]",
        "--out",
        str(tmp_path),
    ]
    assert main(["run", "street_1car_homo", "--no-report", *few]) == 0
    (folder,) = tmp_path.glob("street_1car_homo-*")
    capsys.readouterr()
    for out in ("a/new", "b"):
        line = ["figures", str(folder), "--format", "svg,pdf,png", "--out", str(tmp_path / out)]
        assert main(line) == 0
    names = sorted(path.name for path in (tmp_path / "b").iterdir())
    assert {"latency_cdf.svg", "latency_cdf.pdf", "latency_cdf.png"} <= set(names)
    assert all(
        (tmp_path / "a/new" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
        for name in names
    )
    assert b"/FontFile2" in (tmp_path / "b" / "latency_cdf.pdf").read_bytes(), "its fonts are in it"
    assert b"/Type3" not in (tmp_path / "b" / "latency_cdf.pdf").read_bytes()
    assert main(["figures", str(folder)]) == 0 and (folder / "figures" / "resources.svg").is_file()
    assert main(["rerun", str(folder)]) == 0
    capsys.readouterr()
    for wrong in (
        [str(folder), "--format", "svg,jpg"],
        [str(folder), "--width", "broad"],
        [str(tmp_path)],
    ):
        assert main(["figures", *wrong]) == 1
        assert len(capsys.readouterr().err.splitlines()) == 1
