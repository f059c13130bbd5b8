"""What a notebook shows of a run: its header, its table and the notes that go with it."""

from __future__ import annotations

from genie_sim import kinds
from genie_sim.analysis import summary
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.record.results import MetricValue, Run
from tests import make
from tests.make import METHODS


def made(seed: int, shift: float = 0.0) -> Run:
    measured = [
        MetricValue("first_answer_mean", method.name, "all", "", 10.0 + shift, "ms")
        for method in METHODS
    ]
    tables = {"frames": make.frames(1, 1).columns()}
    return make.run_of(measured, tables=tables, name="<town>", seed=seed, cars=[{}], edges=[])


def test_one_run_is_a_table_with_a_note_on_its_intervals():
    html = kinds.Run.of(made(1))._repr_html_()
    assert html.startswith("<p><b>&lt;town&gt;: 1 car, ")
    assert html.count("<th ") == len(METHODS) + 1 and html.count("<td>10</td>") == 3
    assert f"<p><small>{summary.ABOUT_INTERVALS}</small></p>" in html
    assert html.count("<small>") == 1, "nothing else is to be said"


def test_several_seeds_have_their_own_note():
    seeds = SeedRuns([made(1), made(2, shift=2.0), made(3, shift=4.0)])
    html = kinds.Runs.of(seeds)._repr_html_()
    assert f"<p><small>{summary.about_seeds(seeds)}</small></p>" in html
    assert summary.ABOUT_INTERVALS not in html and "<td>12 <small>(7.03 to 17)</small></td>" in html
