"""The tables that a run prints and writes: complete, in any window, and the same each time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from genie_sim.analysis import metrics, renderers, screen, seed_runs, summary
from genie_sim.analysis.registry import METRICS
from genie_sim.base.errors import UserError
from genie_sim.record.records import RESOURCES
from genie_sim.record.results import MethodInfo, MetricValue, Run
from genie_sim.record.tables import Table
from tests import make
from tests.make import run_of


@pytest.fixture(scope="module")
def found() -> list[MetricValue]:
    return metrics.compute(make.METHODS, make.tables())


PLACES = ("cars", "edges")


def plain(*names: str) -> list[MethodInfo]:
    """Methods whose titles are their names."""
    return [MethodInfo(name, name, baseline=False) for name in names]


def row(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(label)]
    return line.removeprefix(label).split()


def test_a_terminal_shows_twelve_rows_at_most_and_all_or_some_on_request(found):
    measured = [*found]
    for method in ("local", "genie"):
        measured += [
            MetricValue(name, method, "all", "", 0.5, "1")
            for name in ("streaming_f1", "ghost_share")
        ]
    run = run_of(measured)
    short, whole = screen.text(run, 100), screen.text(run, 100, ())
    titles = [row.title for row in summary.printed_table(run).rows]
    assert titles == [
        "first answer, mean [ms]",
        "first answer within 33 ms [%]",
        "fresh result, mean [ms]",
        "frames with a fresh result [%]",
        *(f"{what} reuse on {where} [%]" for what in ("image", "object") for where in PLACES),
        *(f"confidence boost on {where}" for where in PLACES),
        "streaming F1 [%]",
        "false objects [%]",
    ]
    assert all(title in short and title in whole for title in titles)
    more = len(summary.main_table(run).rows) - len(titles)
    assert f"{more} more rows: genie-sim run --all" in short and "more rows" not in whole
    chosen = screen.text(run, 100, ["first_answer_p99", "image_reuse"])
    assert chosen.index("first answer, p99") < chosen.index("image reuse on cars")
    assert "object reuse" not in chosen and "frames dropped" not in chosen
    with pytest.raises(UserError, match="metrics: unknown metric 'image_resue'"):
        screen.text(run, 100, ["image_resue"])


def test_rows_without_numbers_are_left_out_and_the_reason_is_told(found):
    local = [metric for metric in found if metric.method == "local"]
    text = " ".join(screen.text(run_of(local)).split())
    assert "image reuse on" not in text and "false objects [%]" not in text
    assert "no Genie's look-ups are recorded" in text and "are not known here" in text


def test_all_rows_see_every_method_and_the_busiest_device_of_each_kind(found):
    text = screen.text(run_of(found), 80, ())
    known = {(metric.metric, metric.method): metric.value for metric in found}
    methods = ("local", "remote", "genie")
    assert "local (L)  remote (R)  Genie (DG)" in text.splitlines()[3]
    for label, metric in (
        ("first answer, mean [ms]", "first_answer_mean"),
        ("fresh result, mean [ms]", "fresh_answer_mean"),
    ):
        assert row(text, label)[-3:] == [f"{known[metric, method]:.3g}" for method in methods]
    assert text.count("\nbusiest") == 3 and len(text.splitlines()) <= 38
    assert text.index("first answer") < text.index("image reuse on cars") < text.index("busiest")
    assert "genie-sim list metrics" in text
    assert "Times: from the camera's stamp." in summary.table(run_of(found), "latex")


def test_a_table_for_a_paper_has_the_same_numbers_with_intervals_in_every_format(found):
    one = next(
        metric
        for metric in found
        if (metric.metric, metric.method) == ("first_answer_mean", "remote")
    )
    table = summary.main_table(run_of(found))
    assert table.headings == ["", "local (L)", "remote (R)", "Genie (DG)"]
    shown = f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g})"
    assert table.texts()[0][2] == shown
    assert [row.title for row in table.rows] == [
        line[: len(row.title)]
        for line, row in zip(
            screen.text(run_of(found), 200, ()).splitlines()[3:], table.rows, strict=False
        )
    ]
    markdown = renderers.markdown(table).splitlines()
    assert markdown[1] == "|---|---:|---:|---:|" and shown in markdown[2].split(" | ")
    latex = summary.table(run_of(found), "latex")
    assert f"[{one.low:.3g}, {one.high:.3g}]" in latex and r"[\%]" in latex


def test_csv_has_all_digits_and_no_formula():
    text = renderers.csv_of_rows(["a", "@b"], [["=1+1", 1 / 3], ["-", None], ["plain", -2.0]])
    assert text == "a,'@b\n'=1+1,0.3333333333\n'-,\nplain,-2.0\n"


def test_every_latency_of_every_method_has_its_row(found):
    text = markdown(found)
    known = {(metric.metric, metric.method): metric.value for metric in found}
    for metric in ("first_answer_mean", "fresh_answer_mean", "first_answer_p95"):
        cells = [cell.split()[0] for cell in row_of(text, METRICS[metric].label)]
        assert cells == [f"{known[metric, role]:.3g}" for role in ("local", "remote", "genie")]


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_the_tables_fit_the_window(found, width):
    text = screen.text(run_of(found), width, ())
    assert max(map(len, text.splitlines())) <= width
    for words in ("within 33 ms", "dropped", "image reuse", "object reuse", "genie"):
        assert words in " ".join(text.lower().split()), words


def markdown(found: list[MetricValue]) -> str:
    return summary.markdown(run_of(found))


def row_of(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {label} |")]
    return [cell.strip() for cell in line.split("|")[2:-1]]


def test_the_tables_are_plain_text(found):
    for text in (screen.text(run_of(found)), markdown(found)):
        assert text.isascii() and "\x1b" not in text


def test_unknown_is_a_dash_and_never_a_number():
    unanswered = [
        MetricValue("frames_published", "local", "all", "", 7, "frames", n=7),
        MetricValue("first_answer_mean", "local", "all", "", None, "ms"),
        MetricValue("answered_share", "local", "all", "", 0.0, "1", n=7),
    ]
    text = screen.text(run_of(unanswered))
    assert row(text, "first answer, mean [ms]") == ["-"]
    assert row_of(markdown(unanswered), "frames answered [%]") == ["0"]
    for said in (text, markdown(unanswered)):
        assert "nan" not in said.lower() and "None" not in said


def test_methods_and_roles_that_were_not_simulated_have_no_column():
    local_only = [MetricValue("frames_published", "local", "all", "", 7, "frames", n=7)]
    text = screen.text(run_of(local_only)) + markdown(local_only).partition("## ")[2]
    assert "Genie (DG)" not in text and "Improvement" not in text and "image reuse" not in text


def test_numbers_have_three_digits_and_a_unit():
    run = [MetricValue("frames_published", "remote", "all", "", 1, "frames")]
    run += [MetricValue("image_reuse", "genie", "edge", "", 0.30612, "1", 0.1, 0.52)]
    run += [MetricValue("first_answer_mean", "remote", "all", "", 1234.5678, "ms")]
    run += [MetricValue("confidence_boost", "genie", "edge", "", 0.012345, "1")]
    text = markdown(run)
    assert row_of(text, "image reuse on edges [%]") == ["30.6 (10 to 52)"]
    assert row_of(text, "confidence boost on edges") == ["0.0123"]
    assert row_of(text, "first answer, mean [ms]") == ["1,235"]


def test_the_markdown_names_the_run_and_says_what_the_intervals_mean(found):
    text = summary.markdown(run_of(found, seed=4))
    assert text.startswith("# street_3car_hetero\n\nRun `0123456789ab`, seed 4.\n")
    assert "95 % interval inside this run" in text
    for which in (
        text,
        summary.markdown(seed_runs.SeedRuns([run_of(found, seed=s) for s in (1, 2)])),
    ):
        assert "the lowest and the highest running ratio of any Genie" in " ".join(which.split())
    mean = next(
        metric
        for metric in found
        if (metric.metric, metric.method) == ("first_answer_mean", "genie")
    )
    assert f"{mean.value:.3g} ({mean.low:.3g} to {mean.high:.3g})" in text
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.count("|") in (3, 4, 5, 6)
    assert text == summary.markdown(run_of(list(found), seed=4))


def test_a_fleet_shows_its_busiest_devices_and_counts_the_others():
    run = [MetricValue("frames_published", "genie", "all", "", 1, "frames")]
    run += [
        MetricValue("utilization", "genie", "edge", f"edge{i:02}.accelerator", i / 100, "1")
        for i in range(60)
    ]
    run.append(MetricValue("utilization", "genie", "all", "edge1->edge2", 0.75, "1"))
    label = "busiest accelerator on edges [%]"
    whole = screen.text(run_of(run), 80, ())
    assert row(whole, label) == ["59"] and row(whole, "busiest link [%]") == ["75"]
    text = markdown(run)
    assert "edge59.accelerator" in text and "edge10.accelerator" not in text
    # 61, without 12 shown and one that idles
    assert "Less busy ones, in metrics.json: 48." in text
    several = summary.markdown(seed_runs.SeedRuns([run_of(run, seed=1), run_of(run, seed=2)]))
    assert "Less busy ones, in metrics.json of each run: 48." in several


def test_improvements_name_the_baseline_and_genies_their_place():
    run = []
    for method in ("swift", "plain", "slow"):
        run.append(MetricValue("frames_published", method, "all", "", 1, "frames"))
        run.append(MetricValue("first_answer_mean", method, "all", "", 10.0, "ms"))
    run.append(MetricValue("improvement_first_answer", "swift", "all", "plain", 0.5, "1"))
    run += [MetricValue("image_reuse", method, "car", "", 0.5, "1") for method in ("swift", "slow")]
    text = summary.markdown(run_of(run, plain("swift", "plain", "slow")))
    assert row_of(text, "first answer, mean [ms]") == ["10", "10", "10"]
    over_plain = "improvement of the mean first answer, plain [%]"
    assert row_of(text, over_plain) == ["50"], "the other columns are empty"
    assert row_of(text, "image reuse on cars [%]") == ["50", "50"]


def test_titles_of_somebody_else_cannot_steer_a_terminal_or_run_latex():
    run = [
        MetricValue("frames_published", "bad", "all", "", 1, "frames"),
        MetricValue("first_answer_mean", "bad", "all", "", 10.0, "ms"),
    ]
    bad = run_of(run, [MethodInfo("bad", "\x1b[2Ja|b\\input{/etc/passwd}^^41", baseline=False)])
    for text in (screen.text(bad), summary.markdown(bad)):
        assert "\x1b" not in text and "\\x1b[2Ja" in text
    latex = summary.table(bad, "latex")
    assert r"\input" not in latex and "^^" not in latex and "\x1b" not in latex
    assert r"\textbackslash{}input\{" in "".join(latex.split(r"\\{}"))
    assert r"a\|b" in summary.table(bad, "markdown")
    assert "\x1b" not in renderers.csv_of_rows(["title"], [["\x1b[2J"]])


def test_every_placement_method_and_component_has_its_own_number():
    run = [
        MetricValue("frames_published", method, "all", "", 1, "frames")
        for method in ("local", "genie")
    ]
    run += [
        MetricValue("image_reuse", "genie", "car", "", 0.11, "1"),
        MetricValue("image_reuse", "genie", "edge", "", 0.22, "1"),
        MetricValue("object_reuse", "genie", "car", "", 0.33, "1"),
        MetricValue("object_reuse", "genie", "edge", "", 0.44, "1"),
        MetricValue("streaming_f1", "local", "all", "", 0.55, "1"),
        MetricValue("streaming_f1", "genie", "all", "", 0.66, "1"),
        MetricValue("streaming_f1", "local", "all", "zero_delay", 0.77, "1"),
    ]
    text = screen.text(run_of(run), 80, ())
    assert row(text, "image reuse on cars [%]") == ["-", "11", "-"]
    assert row(text, "image reuse on edges [%]") == ["-", "22", "-"]
    assert row(text, "object reuse on cars [%]") == ["-", "33", "-"]
    assert row(text, "object reuse on edges [%]") == ["-", "44", "-"]
    assert row(text, "streaming F1 [%]") == ["55", "66", "77"]
    of_genie = seed_runs.with_methods(run_of(run), ["genie"])
    assert row(screen.text(of_genie, 80, ()), "streaming F1 [%]") == ["66", "77"]
    assert row_of(markdown(run), "object reuse on cars [%]") == ["33"]
    assert row_of(markdown(run), "object reuse on edges [%]") == ["44"]
    assert row_of(markdown(run), "streaming F1 [%]") == ["55", "66", "77"]
    run += [MetricValue("lap_f1", "local", "all", "1", 0.88, "1")]
    of_lap = summary.main_table(run_of(run), ("lap_f1",))
    assert of_lap.headings == ["", "local (L)"], "a method's lap is none of the detector's"


def test_all_resources_that_are_overloaded_are_named_in_one_line():
    """More comes to them than they can serve: neither where a short queue drops what comes at once,
    nor where a link or a fault loses messages, nor where hardly any is dropped.
    """
    uses = {
        "local": {"car1.accelerator": 0.99, "car2.accelerator": 0.98, "car1.cpu": 0.5},
        "remote": {"edge1.accelerator": 0.91, "edge2.accelerator": 0.6, "car1->edge1": 0.5},
        "genie": {"edge1.accelerator": 0.99, "car1.cpu": 0.1},
    }
    waits = {  # dropped, served, most that waited
        "local": {"car1/detector": (60, 40, 1), "car2/detector": (50, 50, 1)},
        "remote": {
            "edge1/detector": (60, 40, 1),
            "edge2/detector": (30, 70, 1),
            "car1->edge1": (30, 70, 5),
        },
        "genie": {"edge1/detector": (5, 95, 1), "car1/front": (40, 0, 0)},
    }
    measured = [
        MetricValue("utilization", method, "all", name, use, "1")
        for method, of_method in uses.items()
        for name, use in of_method.items()
    ]
    table = Table(RESOURCES)
    for method, of_method in waits.items():
        for name, (dropped, served, most) in of_method.items():
            table.append((method, 1, name, "queue", None, 0, 0, served, dropped, None, 0, most))
    run = run_of(
        measured, tables={"frames": make.frames(2, 3).columns(), "resources": table.columns()}
    )
    named = "car1.accelerator, car2.accelerator under local (L) (55 %)"
    assert summary.overload(run).endswith(f": {named}; edge1.accelerator under remote (R) (60 %).")
    assert named in screen.text(run, 200)
    assert summary.overload(run_of([], tables=run.tables)) == "" == summary.overload(run_of([]))


def test_where_no_key_repeats_the_run_says_so_in_one_line():
    """Of image keys and of places, each by itself; one hit is enough to say nothing."""

    def with_lookups(lift: float) -> Run:
        run, lookups = run_of([]), make.lookups(2, 120, lift=lift).columns()
        return replace(run, tables={**run.tables, "lookups": lookups})

    nothing = with_lookups(0.0)
    assert summary.no_repeats(nothing).startswith("No key repeats: none of 480 requests under ")
    assert "; none of " in summary.no_repeats(nothing)
    assert summary.no_repeats(nothing) in screen.text(nothing, 400)
    assert summary.no_repeats(with_lookups(1.0)) == "" == summary.no_repeats(run_of([]))
