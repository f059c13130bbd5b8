"""Tables in LaTeX: numbers, intervals below them, a note for every sign."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from genie_sim.analysis import renderers, summary
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.record.results import MethodInfo, MetricValue
from tests.make import run_of

METHODS = [
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("mine", "my_50% & $x$", baseline=False),
]


def test_numbers_stand_at_the_right_with_their_signs_and_none_is_a_dash():
    rows = [Row("a", [Cell(342), Cell()]), Row("b", [Cell(-9.124), Cell(1.5, sign="+")])]
    text = renderers.latex(ResultTable(["x", "y"], rows, "c"), "c")
    assert re.findall(r"^  (\w+)$", text, re.MULTILINE) == ["rr"]
    assert r"a & 342 & -- \\" in text and r"b & $-$9.12 & +1.5 \\" in text
    assert "--: not defined." in text
    assert r"\begin{table}" in text and r"\label{tab:c}" in text and r"\caption{c}" in text


def test_more_columns_than_fit_one_of_two_span_the_page():
    text = renderers.latex(ResultTable(list("wxyz"), [Row("a", [Cell(1)] * 4)], "c", ["n"]), "c")
    assert r"\begin{table*}" in text and r"\end{table*}" in text and "n}" in text


def test_a_run_s_table_says_what_its_brackets_are_and_has_no_range():
    measured = [
        MetricValue("frames_published", "local", "all", "", 5, "frames"),
        MetricValue("frames_published", "mine", "all", "", 5, "frames"),
        MetricValue("first_answer_mean", "local", "all", "", 342.0, "ms", 328.0, 356.0),
        MetricValue("first_answer_mean", "mine", "all", "", 9.12, "ms", 9.12, 9.12),
        MetricValue("image_reuse", "mine", "car", "", 0.25, "1", range_low=0.1, range_high=0.4),
    ]
    run = run_of(measured, METHODS, name="two_cars", seed=3)
    text = summary.table(run, "latex")
    assert "first answer, mean [ms] & 342 & 9.12" in text
    assert r"{\scriptsize [328, 356]}" in text
    assert "[9.12, 9.12]" not in text, "an interval without width is none"
    assert "No brackets: the interval rounds" in text
    assert r"image reuse on cars [\%] & -- & 25" in text
    assert "response times" in text
    assert "response times" not in summary.table(run, "latex", ["image_reuse"])
    assert "[10, 40]" not in text, "a range is no interval"
    assert "95 \\% intervals inside the run" in text
    assert r"\shortstack[r]{my\_50\% \& \$x\$}" in text
    assert "differences" not in text, "one seed has no paired differences over seeds"


def test_what_fits_no_page_is_divided_into_several_tables():
    rows = [Row(f"row {number}", [Cell(1)] * 8) for number in range(30)]
    text = renderers.latex(ResultTable(list("abcdefgh"), rows, "c", ["n"]), "c")
    assert re.findall(r"\\label\{(.*)\}", text) == ["tab:c", "tab:c-2", "tab:c-3", "tab:c-4"]
    assert re.findall(r"\\caption\{(.*)\}", text)[3] == "c (part 4 of 4)"
    assert len(re.findall(r"^  r{4}$", text, re.MULTILINE)) == 4 and text.count("row 29 &") == 2
    assert text.count("{n}") == 1, "notes stand below the last part"


def test_a_unit_that_begins_a_line_of_a_heading_is_no_length():
    text = renderers.latex(ResultTable(["share of frames [%]"], [], "c"), "c")
    assert r"share of\\{}frames [\%]" in text


def test_a_column_of_texts_is_no_column_of_numbers():
    text = renderers.latex(
        ResultTable(["verdict", "n"], [Row("C1", [Cell("50 % & up"), Cell(3)])], "c"), "c"
    )
    assert re.findall(r"^  (\w+)$", text, re.MULTILINE) == ["lr"]
    assert r"C1 & 50 \% \& up & 3 \\" in text


def test_levels_of_axes_are_columns_in_which_none_is_repeated():
    keys = [("5", "lru", "a"), ("5", "lru", "b"), ("5", "lfu", "a"), ("10", "lfu", "a")]
    rows = [Row(first, [*map(Cell, others), Cell(2.0, 1.0, 3.0)]) for first, *others in keys]
    table = ResultTable(["rule", "method", "x"], rows, "c", corner="rate", keys=2)
    text = renderers.latex(table, "c")
    assert re.findall(r"^.*& 2 \\\\$", text, re.MULTILINE) == [
        r"5 & lru & a & 2 \\",
        r"&  & b & 2 \\",
        r"& lfu & a & 2 \\",
        r"10 & lfu & a & 2 \\",
    ]
    assert text.count(r"\addlinespace") == 1 and text.count("[1, 3]") == 4
    assert table.cut(slice(1, 2)).columns == ["rule", "method"], "each part has the keys"


def test_thousands_are_grouped_as_on_a_terminal():
    table = ResultTable(["a"], [Row("time", [Cell(1234.5, 1200.0, 12345.0)])])
    text = renderers.latex(table, "times")
    assert "[1,200, 12,345]" in text
    assert "1,234 (1,200 to 12,345)" in renderers.terminal(table, 80)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pdflatex", "lualatex"])
def test_latex_takes_any_text_of_users(engine, tmp_path):
    if shutil.which(engine) is None:
        pytest.skip(f"no {engine} on this machine")
    text = r"50% & $x_1$ {\evil} #~^ \input{a} [x] * Größe"
    text += " → 日本" if engine == "lualatex" else ""
    rows = [
        Row(title, [Cell(text), Cell(1.5, 1.0, 2.0), Cell(text)]) for title in (text, "[x]", "[x]")
    ]
    titles = [text, text, "b"]
    table = renderers.latex(ResultTable(titles, rows, text, [text], corner=text, keys=1), text)
    assert ("lualatex" in table) == (engine == "lualatex")
    whole = r"\documentclass{article}\usepackage{booktabs,array}\begin{document}%s\end{document}"
    (tmp_path / "a.tex").write_text(whole % table, encoding="utf-8")
    command = [engine, "-interaction=nonstopmode", "-halt-on-error", "a.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout.decode(errors="replace")[-2000:]
