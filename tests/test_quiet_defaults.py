"""What holds when nothing is said: pages are written, and no figures."""

from __future__ import annotations

from genie_sim.report.output import DEFAULT_OUTPUT, Output


def test_several_seeds_have_a_page_and_no_figures():
    assert Output(page=True, figures=()) == DEFAULT_OUTPUT
