"""The tables that a run prints and writes: complete, in any window, and the same each time."""

from __future__ import annotations

import made_up_run
import pytest

from genie_sim.analysis import metrics, summary, text_table
from genie_sim.recording.results import Metric


@pytest.fixture(scope="module")
def found() -> list[Metric]:
    tables = made_up_run.frames(2, 3), made_up_run.lookups(2, 120), made_up_run.resources(2, 30)
    return metrics.compute(made_up_run.METHODS, {table.name: table.to_frame() for table in tables})


def row(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(label)]
    return line.removeprefix(label).split()


def test_a_terminal_sees_every_method_and_of_devices_the_three_busiest(found):
    text = summary.text(found)
    known = {(metric.metric, metric.method): metric.value for metric in found}
    methods = ("local", "remote", "genie")
    assert text.splitlines()[0].split() == list(methods)
    for label, metric in (
        ("first answer, mean [ms]", "first_answer_mean"),
        ("fresh answer,", "fresh_answer_mean"),
    ):
        assert row(text, label)[-3:] == [f"{known[metric, method]:.3g}" for method in methods]
    assert text.count("busy [%]") == 3 and len(text.splitlines()) <= 24
    assert text.index("first answer") < text.index("image reuse on cars") < text.index("busy")
    assert "Times count from when a frame reached the first node's queue." in " ".join(text.split())


def test_a_table_for_a_paper_has_the_same_numbers_with_intervals_in_every_format(found):
    one = next(
        metric
        for metric in found
        if (metric.metric, metric.method) == ("first_answer_mean", "remote")
    )
    headings, rows = summary.cells(found, {"remote": "remote (R)"})
    assert headings == ["", "local", "remote (R)", "genie"]
    shown = f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g})"
    assert rows[0][2] == shown
    assert [row[0] for row in rows] == [line[: len(row[0])] for line, row in
                                        zip(summary.text(found, 200).splitlines()[1:], rows, strict=False)]  # fmt: skip
    markdown = text_table.rounded("markdown", headings, rows, "lrrr").splitlines()
    assert markdown[1] == "|---|---:|---:|---:|" and shown in markdown[2].split(" | ")
    latex = text_table.rounded("latex", headings, rows, "lrrr").splitlines()
    assert latex[0] == r"\begin{tabular}{lrrr}" and latex[-1] == r"\end{tabular}"
    assert latex[2] == r" & local & remote (R) & genie \\" and r"[\%]" in latex[6]
    assert len([line for line in latex if line.endswith(r"\\")]) == len(rows) + 1


def test_csv_has_all_digits_and_no_formula():
    text = text_table.exact(["a", "b"], [["=1+1", 1 / 3], ["-", None], ["plain", -2.0]])
    assert text == "a,b\n'=1+1,0.3333333333\n'-,\nplain,-2.0\n"


def test_first_and_fresh_answers_stand_beside_each_other(found):
    text = markdown(found)
    means = [("first_answer_mean", role) for role in ("local", "remote", "genie")] + [
        ("fresh_answer_mean", "genie")
    ]
    known = {(metric.metric, metric.method): metric.value for metric in found}
    cells = [cell.split()[0] for cell in row_of(text, "mean [ms]")]
    assert cells == [f"{known[mean]:.3g}" for mean in means]
    assert "| | local | remote | genie first | genie fresh |" in text


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_the_tables_fit_the_window(found, width):
    text = summary.text(found, width)
    assert max(map(len, text.splitlines())) <= width
    for words in ("within 33 ms", "dropped", "image reuse", "object reuse"):
        assert words in " ".join(text.lower().split()), words


def markdown(found: list[Metric]) -> str:
    return summary.markdown(found, "3car_hetero", "0123456789ab", 1)


def row_of(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(f"| {label} |")]
    return [cell.strip() for cell in line.split("|")[2:-1]]


def test_the_tables_are_plain_text(found):
    for text in (summary.text(found), summary.markdown(found, "3car_hetero", "0123456789ab", 1)):
        assert text.isascii() and "\x1b" not in text


def test_unknown_is_a_dash_and_never_a_number():
    unanswered = [
        Metric("frames_published", "local", "all", "", 7, "frames", n=7),
        Metric("first_answer_mean", "local", "all", "", None, "ms"),
        Metric("answered_share", "local", "all", "", 0.0, "1", n=7),
    ]
    text = summary.text(unanswered)
    assert row(text, "first answer, mean [ms]") == ["-"]
    assert row_of(markdown(unanswered), "answered") == ["0 %"]
    for said in (text, markdown(unanswered)):
        assert "nan" not in said.lower() and "None" not in said


def test_methods_and_roles_that_were_not_simulated_have_no_column():
    local_only = [Metric("frames_published", "local", "all", "", 7, "frames", n=7)]
    text = summary.text(local_only) + summary.markdown(local_only, "s", "0", 1).partition("## ")[2]
    assert "genie" not in text and "Improvement" not in text and "image reuse" not in text


def test_numbers_have_three_digits_and_a_unit():
    run = [Metric("frames_published", "remote", "all", "", 1, "frames")]
    run += [Metric("image_reuse", "genie", "edge", "", 0.30612, "1", 0.1, 0.52)]
    run += [Metric("first_answer_mean", "remote", "all", "", 1234.5678, "ms")]
    run += [Metric("confidence_boost", "genie", "edge", "", 0.012345, "1")]
    text = markdown(run)
    assert row_of(text, "image reuse") == ["30.6 % (10 to 52)"]
    assert row_of(text, "confidence boost") == ["0.0123"]
    assert row_of(text, "mean [ms]") == ["1,235"]


def test_the_markdown_names_the_run_and_says_what_the_intervals_mean(found):
    text = summary.markdown(found, "3car_hetero", "0123456789ab", 4)
    assert text.startswith("# 3car_hetero\n\nRun `0123456789ab`, seed 4.\n")
    assert "95 % interval inside this run" in text
    assert "50 requests in a row" in text
    mean = next(
        metric
        for metric in found
        if (metric.metric, metric.method) == ("first_answer_mean", "genie")
    )
    assert f"{mean.value:.3g} ({mean.low:.3g} to {mean.high:.3g})" in text
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.count("|") in (4, 5, 6)
    assert text == summary.markdown(list(found), "3car_hetero", "0123456789ab", 4)


def test_a_fleet_shows_its_busiest_devices_and_counts_the_others():
    run = [Metric("frames_published", "genie", "all", "", 1, "frames")]
    run += [
        Metric("utilization", "genie", "edge", f"edge{i:02}.accelerator", i / 100, "1")
        for i in range(60)
    ]
    assert "edge59.accelerator" in summary.text(run) and "edge56.accelerator" not in summary.text(
        run
    )
    text = markdown(run)
    assert "edge59.accelerator" in text and "edge10.accelerator" not in text
    assert (
        "47 less busy ones are in metrics.json." in text
    )  # 60, without 12 shown and one that idles


def test_any_method_whose_fresh_answers_come_later_has_both_columns_and_genies_a_table_of_each_method():
    run = []
    for method, fresh in (("swift", 20.0), ("plain", 10.0), ("slow", 30.0)):
        run.append(Metric("frames_published", method, "all", "", 1, "frames"))
        run.append(Metric("first_answer_mean", method, "all", "", 10.0, "ms"))
        run.append(Metric("fresh_answer_mean", method, "all", "", fresh, "ms"))
    run.append(Metric("improvement_first_answer", "swift", "all", "plain", 0.5, "1"))
    run += [Metric("image_reuse", method, "car", "", 0.5, "1") for method in ("swift", "slow")]
    text = markdown(run)
    assert row_of(text, "mean [ms]") == ["10", "20", "10", "10", "30"]
    assert "| | swift first | swift fresh | plain | slow first | slow fresh |" in text
    for title in ("Improvement by swift, of the mean", "Genies under swift", "Genies under slow"):
        assert title in text
