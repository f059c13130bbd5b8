"""Metrics of the user's own: everywhere that others are, and one line for whatever is wrong."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from genie_sim.analysis import compare_tables, registry, seed_runs, summary
from genie_sim.analysis.compare import Difference, compare
from genie_sim.base.errors import UserError
from genie_sim.base.plugins import own_code_allowed
from genie_sim.base.settings import plain_data
from genie_sim.cli.main import main
from genie_sim.record import provenance
from genie_sim.record.results import Run
from genie_sim.report.output import Output
from genie_sim.runs.folder import run_in_memory, run_to_folder
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.study.work import PointRun

WINDOW = "cars[0].route.window=[0 s, 2 s]"
CODE = """
import math
import sys
from dataclasses import replace
import numpy as np
from genie_sim.analysis.statistics import Estimate
from genie_sim.analysis.frame_metrics import response_ms
from genie_sim.analysis.metric import LOWER, Metric, Sample, mean_of, share_of

slow = Metric(
    "slow frames", "%", LOWER, meaning="Frames with a first answer after 100 ms.",
    formula=lambda frames: share_of(frames, response_ms(frames, "first") > 100),
)
plain = Metric("a number", "", formula=lambda frames: mean_of(frames, response_ms(frames, "first")))
raises = replace(slow, formula=lambda frames: share_of(frames, frames["nothing"]))
late = replace(slow, formula=lambda frames: share_of(frames, [True][len(frames)]))
rowless = replace(slow, kind="nothing")
exits = replace(slow, formula=lambda frames: exit(0))
leaves = replace(slow, formula=sys.exit)
numbered = replace(slow, title=5)
unitless = replace(slow, unit=5)
best = replace(slow, better="best")
unnamed = replace(slow, title=" ")
twin = replace(slow, title="first answer, mean")
returns = replace(slow, formula=lambda frames: 0.5)
infinite = replace(slow, formula=lambda frames: Estimate(math.inf))
undefined = replace(slow, formula=lambda frames: Estimate(1, low=math.nan))
huge = replace(slow, formula=lambda frames: Estimate(10**400))
above_1 = replace(
    slow, formula=lambda frames: Sample(frames, 2 + frames["frame"] % 3, np.ones(len(frames)))
)
of_numpy = replace(  # without rows it is not defined
    slow, formula=lambda frames: Estimate(np.mean(3 + 0 * frames["frame"]), n=np.int64(2))
)
other = "text"
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the module, where Python finds it."""
    (tmp_path / "own_metric.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def of(name: str) -> Scenario:
    return load_scenario("street_1car_homo", [WINDOW, "record=[]", f"metrics=[own_metric:{name}]"])


def ran(name: str) -> Run:
    return run_in_memory(of(name))


def test_it_is_in_every_table_with_its_interval():
    run = ran("slow")
    found = {one.method: one for one in run.measured if one.metric == "own_metric:slow"}
    times = run.frames.query("method == 'local'").eval("first_answer_ns - received_ns") / 1e6
    assert found["local"].value == pytest.approx(float((times > 100).mean()))
    assert found["local"].low is not None and found["local"].n == len(times)
    assert "| slow frames [%] |" in summary.markdown(run)
    assert "| slow frames [%] |" in summary.table(run, "markdown")
    row = next(one for one in compare([run]).rows if one.metric == "own_metric:slow")
    assert row.value == found["local"].value


def test_its_ratio_may_be_above_1():
    numbers = [one for one in ran("above_1").measured if one.metric == "own_metric:above_1"]
    assert numbers and all(2 <= one.low < one.value < one.high <= 4 for one in numbers)


def test_a_formula_that_was_changed_since_gives_no_interval(tmp_path: Path):
    (tmp_path / "edited_metric.py").write_text(CODE)
    settings = [WINDOW, "record=[]", "metrics=[edited_metric:slow]"]
    scenario = load_scenario("street_1car_homo", settings)
    folder = run_to_folder(scenario, tmp_path, output=Output(page=False)).folder
    run = seed_runs.load_run(folder)

    def paired() -> list[Difference]:
        rows = compare([run], metrics=["edited_metric:slow"]).rows
        return [row for row in rows if row.against]

    before = paired()
    assert before and all(row.low is not None for row in before)
    (tmp_path / "edited_metric.py").write_text(CODE.replace('"first") > 100', '"first") > 50'))
    without = [row._replace(low=None, high=None, by="", n=0) for row in before]
    assert [row[5:] for row in paired()] == [row[5:] for row in without]


def test_its_words_travel_with_the_results_and_its_code_does_not_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    scenario = load_scenario(
        "street_1car_homo", [WINDOW, "record=[]", "metrics=[own_metric:slow, own_metric:plain]"]
    )
    folder = run_to_folder(scenario, tmp_path, output=Output(page=False)).folder
    (tmp_path / "own_metric.py").write_text("raise AssertionError('ran')")
    with own_code_allowed(allowed=False):
        run = seed_runs.load_run(folder)
        for format in ("markdown", "latex"):
            assert r"slow frames [%]" in summary.table(run, format).replace("\\%", "%")
            assert "a number" in summary.table(run, format)
        assert "own_metric:plain,local,all,," in summary.table(run, "csv")
        assert "slow frames" in compare_tables.text(compare([run]))
    about = json.loads((folder / "run.json").read_text())
    about["metrics"]["own_metric:slow"]["tier"] = "high"
    (folder / "run.json").write_text(json.dumps(about))
    for command in ("table", "export"):
        assert main([command, str(folder)]) == 1
        assert "run.json: metrics: own_metric:slow: tier" in capsys.readouterr().err, command


def test_results_that_say_differently_of_it_keep_their_words_and_are_not_compared(tmp_path: Path):
    scenario = load_scenario("street_1car_homo", [WINDOW, "record=[]", "metrics=[own_metric:slow]"])
    folder = run_to_folder(scenario, tmp_path, output=Output(page=False)).folder
    first = seed_runs.load_run(folder)
    words = {"own_metric:slow": {**first.words["own_metric:slow"], "title": "late frames"}}
    other = replace(first, words=words, label="other")
    assert "slow frames [%]" in summary.table(first, "markdown")
    assert "late frames [%]" in summary.table(other, "markdown")
    facts = {**first.facts, "scenario": {**first.facts["scenario"], "name": "other"}}
    other = replace(other, facts=facts)
    made = compare([first, other])
    assert "own_metric:slow" not in {row.metric for row in made.rows}
    assert "Without own_metric:slow: results say of it both " in made.left_out
    assert "own_metric:slow" not in compare_tables.text(made, "csv")
    with pytest.raises(UserError, match=r"^compare: own_metric:slow: .* not one metric"):
        compare([first, other], metrics=["own_metric:slow"])


@pytest.mark.parametrize(
    "told", [[], {"own_metric:slow": {"title": "t"}}, {"own_metric:slow": {"title": 1}}]
)
def test_words_that_are_none_are_refused_in_one_line(told: object):
    with pytest.raises(UserError, match=r"^run.json: metrics: "):
        registry.checked_words(told, "run.json: metrics")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("raises", "own_metric:raises': unknown column 'nothing'; known: "),
        ("exits", "SystemExit: '0'"),
        ("leaves", "own_metric:leaves': SystemExit: "),
        ("numbered", "title: must be of type str, not 5"),
        ("unitless", "unit: must be of type str, not 5"),
        ("best", "better: 'best'"),
        ("unnamed", "title: is empty"),
        ("twin", "title: 'first answer, mean' is that of first_answer_mean, too"),
        ("rowless", "kind: unknown kind 'nothing'"),
        ("returns", "must return a Sample, Estimate or None, not 0.5"),
        ("other", "is no genie_sim.analysis.metric.Metric, but 'text'"),
        ("Nobody", "has no attribute 'Nobody'"),
    ],
)
def test_what_is_wrong_with_it_is_one_line_before_anything_is_simulated(name: str, says: str):
    with pytest.raises(UserError, match=says):
        prepare(of(name))


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("late", r"IndexError: .*, line \d+, in "),
        ("infinite", "value must be a finite number, or None where it is not defined, not inf"),
        ("undefined", "low must be a finite number"),
        ("huge", "value must be a finite number"),
    ],
)
def test_what_is_wrong_with_its_numbers_is_one_line_and_the_run_stays(
    name: str, says: str, caplog: pytest.LogCaptureFixture
):
    measured = {value.metric for value in ran(name).measured}
    assert "first_answer_mean" in measured and f"own_metric:{name}" not in measured
    (line,) = caplog.messages
    assert re.search(f"'own_metric:{name}': {says}", line) and "\n" not in line


def test_several_seeds_stay_without_the_one_that_fails(caplog: pytest.LogCaptureFixture):
    changes = [WINDOW, "record=[]", "metrics=[own_metric:late, own_metric:plain]"]
    scenario = load_scenario("street_1car_homo", changes)
    prepared = prepare(scenario)
    run = PointRun(provenance.run_id(prepared.facts), scenario, "", keep=True)
    names = {value.metric for value in run.measure(Path.cwd())}
    assert "own_metric:plain" in names and "own_metric:late" not in names
    assert len(caplog.messages) == 1
    names = {value.metric for value in replace(run, keep=False).measure(Path.cwd())}
    assert "own_metric:plain" in names and "own_metric:late" not in names


def test_its_number_may_be_of_numpy():
    numbers = [
        metric for metric in ran("of_numpy").measured if metric.metric == "own_metric:of_numpy"
    ]
    assert {(type(number.value), number.value, number.n) for number in numbers} == {(float, 3.0, 2)}


def test_a_scenario_has_none_unless_it_names_some():
    assert plain_data(load_scenario("street_1car_homo"))["metrics"] == []
    with pytest.raises(UserError, match=r"metrics.0.: must be a metric of your own"):
        load_scenario("street_1car_homo", ["metrics=[streaming_f1]"])
