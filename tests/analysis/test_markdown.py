"""Tables in Markdown."""

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import Cell, ResultTable, Row


def test_titles_hold_neither_html_nor_links():
    table = ResultTable(["a <b>|"], [Row("<img src=x> [see](http://x)", [Cell("text")])])
    shown = renderers.markdown(table)
    assert r"\<img src=x> [see]\(http://x)" in shown and r"a \<b>\|" in shown
