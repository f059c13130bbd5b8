"""Metrics of the user's own: everywhere that others are, and one line for whatever is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.analysis import registry, summary
from genie_sim.analysis.compare import compare
from genie_sim.base.errors import UserError
from genie_sim.base.plugins import own_code
from genie_sim.base.settings import plain_data
from genie_sim.record.results import Run
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario

WINDOW = "cars[0].route.window=[0 s, 2 s]"
CODE = """
from genie_sim.analysis.frame_metrics import FrameShare, response_ms
from genie_sim.analysis.metric import Metric

class Slow(FrameShare):
    '''Share of the frames with a first answer after 100 ms.'''
    title = "slow frames"
    reads = "frames: received_ns, first_answer_ns"
    def flags(self, frames):
        return response_ms(frames, "first") > 100

class Raises(Slow):
    def flags(self, frames):
        return frames["nothing"]

class Reads(Slow):
    reads = "frames: nothing"

class Returns(Slow):
    def of(self, view):
        return 0.5

class Viewless(Metric):
    title = "t"

class Plain:
    title = view = "t"
    def of(self, view):
        return None
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the module, where Python finds it."""
    (tmp_path / "own_metric.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def ran(name: str) -> Run:
    scenario = load_scenario(
        "street_1car_homo", [WINDOW, "record=[]", f"metrics=[own_metric:{name}]"]
    )
    return run_in_memory(scenario)


def test_it_is_in_every_table_with_its_interval():
    run = ran("Slow")
    found = {one.method: one for one in run.measured if one.metric == "own_metric:Slow"}
    times = run.frames.query("method == 'local'").eval("first_answer_ns - received_ns") / 1e6
    assert found["local"].value == pytest.approx(float((times > 100).mean()))
    assert found["local"].low is not None and found["local"].n == len(times)
    assert "| slow frames [%] |" in summary.markdown(run)
    assert "| slow frames [%] |" in summary.table(run, "markdown")
    row = next(one for one in compare([run]).rows if one.metric == "own_metric:Slow")
    assert row.value == found["local"].value
    with own_code(allowed=False):
        assert registry.title_of("own_metric:Slow") == "own_metric:Slow", "its code does not run"


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("Raises", r"own_metric:Raises': KeyError: .*own_metric.py, line \d+, in flags"),
        ("Reads", "reads: frames: unknown column 'nothing'; known: "),
        ("Returns", "must return Measured or None, not 0.5"),
        ("Viewless", "has no view"),
        ("Plain", "is no subclass of genie_sim.analysis.metric.Metric"),
        ("Nobody", "has no attribute 'Nobody'"),
    ],
)
def test_what_is_wrong_with_it_is_one_line(name: str, says: str):
    with pytest.raises(UserError, match=says):
        ran(name)


def test_a_scenario_without_any_is_what_it_was():
    plain = plain_data(load_scenario("street_1car_homo"))
    assert "metrics" not in plain
    with pytest.raises(UserError, match=r"metrics.0.: unknown metric 'streaming_f1'"):
        load_scenario("street_1car_homo", ["metrics=[streaming_f1]"])
