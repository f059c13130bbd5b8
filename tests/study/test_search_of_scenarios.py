"""Searches of real scenarios: spaces, files, the command line and the library."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import genie_sim as gs
from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.settings import SettingError, from_plain
from genie_sim.cli.main import main
from genie_sim.methods import METHODS
from genie_sim.scenario.yaml_input import dump
from genie_sim.study.search import Search
from genie_sim.study.search_design import (
    Constraint,
    Objectives,
    Parameter,
    Point,
    Space,
    load,
    target_of,
)
from genie_sim.study.tasks import LocalWorkers
from genie_sim.version import PACKAGE_FOLDER

SPACE = {
    "method": "remote",
    "space": {
        "queue": {"set": "queue_length", "range": {"from": 1, "to": 3, "whole": True}},
        "consumer": {"set": "consumer", "list": ["newest", "tracker"]},
    },
}
SHORT = {
    "scenario": "street_1car_homo",
    "set": {"cars[0].route.window": ["0 s", "1.5 s"], "record": ["held"]},
    "methods": {"remote": SPACE},
    "objectives": {"maximize": "streaming_f1", "minimize": "first_answer_p95"},
    "points": 3,
    "batch": 3,
    "seeds": {"tuning": 2, "held_out": 2},
}


def write(data: dict[str, Any], name: str = "s.yaml") -> str:
    Path(name).write_text(dump(data))
    return name


def search(*arguments: Any) -> Search:
    return Search(load(*arguments), Path("out"), LocalWorkers(1))


@pytest.mark.parametrize("name", sorted(METHODS))
def test_every_method_has_a_space_whose_values_all_make_a_scenario(name: str):
    """A search prepares them before it runs any."""
    assert search("baselines", [name]).design.methods[name].method == name


def test_the_shipped_searches_can_be_read():
    for name in files.available(files.SEARCH):
        search(name)


@pytest.mark.slow
def test_a_search_from_the_command_line_and_a_design_that_runs(capsys: pytest.CaptureFixture[str]):
    assert main(["search", write(SHORT), "--jobs", "1"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("Most accurate: remote-") and "Fastest: remote-" in printed
    designs = pd.read_csv("results/s/designs.csv")
    assert designs["design"].tolist()[:3] == ["local", "remote", "genie"], "as in the scenario"
    assert not designs["tuned"][:3].any() and designs["tuned"][3:].all()
    about = json.loads(Path("results/s/search.json").read_text())
    pick = about["picks"][0]
    assert (pick["file"], pick["method"]) == ("most_accurate", "remote")
    runs = gs.run("results/s/designs/most_accurate.yaml", seeds=[3, 4], jobs=1)  # held out
    again = runs.metrics.set_index(["metric", "component"]).loc[("streaming_f1", "")]
    held_out = designs.set_index("design").loc[pick["design"]]
    for end, column in (("value", ""), ("low", " low"), ("high", " high")):
        assert again[end] == pytest.approx(held_out[f"streaming_f1{column}"], rel=1e-9)


@pytest.mark.slow
def test_figures_are_of_the_tuning_set_and_in_the_words_of_metrics():
    assert main(["search", write(SHORT), "--jobs", "1"]) == 0
    names = ("remote_slices", "remote_importances", "remote_front_first_answer_p95")
    assert {path.stem for path in Path("results/s/figures").iterdir()} == set(names)
    for name in names:
        text = Path(f"results/s/figures/{name}.svg").read_text()
        assert "remote, tuning set" in text and "streaming F1 [%]" in text
    assert "first answer, p95 [ms]" in text


@pytest.mark.slow
def test_a_method_with_nothing_to_search_has_the_front_alone():
    fixed = {"method": "remote", "space": {"queue": {"set": "queue_length", "list": [1]}}}
    assert main(["search", write(SHORT | {"methods": {"fixed": fixed}}), "--jobs", "1"]) == 0
    drawn = {path.stem for path in Path("results/s/figures").iterdir()}
    assert drawn == {"fixed_front_first_answer_p95"}


def test_a_point_sets_what_its_parameters_say():
    work = search("street_3car_hetero", ["sim_lru", "genie"])
    values = {"radius": 0.25, "feature": "yolox_gap", "consumer": "tracker", "encoding": "jpeg90"}
    scenario = work.scenario(Point("a", "sim_lru", values), {})
    (entry,) = scenario.methods
    assert entry.method.parameters["radius"] == 0.25
    assert entry.method.parameters["feature"] == "yolox_gap"
    assert scenario.image_encoding == "jpeg90" and scenario.record == ("held",)
    values = {"algorithm": "recommended", "every": 120.0, "in_flight": 3.0, "p_min": 0.55}
    genie = work.scenario(Point("b", "genie", values), {}).genie
    assert genie.looks is not None and genie.looks.every_ns == 120_000_000
    assert genie.looks.in_flight == 3 and genie.object_map.freshness.parameters["p_min"] == 0.55


def test_the_methods_of_the_scenario_are_reported_as_they_are():
    work = search("where_it_pays", ["remote"])
    points = work.references()
    trackers = ["local_tracker", "remote_tracker"]
    expected = ["local", "remote", *trackers, "genie", "genie_recommended"]
    assert [point.name for point in points] == expected
    scenario = work.scenario(points[-1], {})
    assert [entry.name for entry in scenario.methods] == ["genie_recommended"]
    looks = scenario.method_settings[scenario.methods[0].name].genie.looks
    assert looks is not None and scenario.record == ("held",)


def test_a_setting_that_is_fixed_is_not_searched_and_conditions_know_it():
    fixed = {"image_encoding": "jpeg80", "genie.algorithm": "recommended"}
    fixed |= {
        "genie.capacity": None,
        "genie.object_map.freshness.name": "recommended",
        "genie.object_map.freshness.measured": False,
    }
    design = load("street_3car_hetero", ["genie"], {"set": fixed})
    space = design.methods["genie"]
    assert not {"encoding", "algorithm"} & space.free(design.settings).keys()
    names = {name for name, _ in space.samples(design.settings)}
    assert {"every", "own"} <= names and not {"threshold", "lifetime"} & names


def test_the_library_returns_the_designs():
    designs = gs.search({**SHORT, "name": "mine"}, jobs=1, settings={"consumer": "tracker"})
    assert "consumer" not in designs.columns and {"queue", "streaming_f1 low"} <= set(designs)
    assert not Path("results").exists()


def test_every_metric_of_a_run_can_be_an_objective_or_a_constraint():
    """Also those of a lap, of a link and of a node of a host."""
    run = gs.run("street_1car_homo", settings={"cars[0].route.window": ["0 s", "1.5 s"]}, out="r")
    names = run.metrics[["metric", "placement", "component"]].drop_duplicates()
    targets = [target_of(*name) for name in names.itertuples(index=False)]
    assert any("->" in target for target in targets)
    for target in [*targets, "lap_f1/all/lap 2"]:
        assert Objectives(maximize=(target,)).targets == (target,)
        constraint = Constraint.expand(f"{target} <= 30 %")
        assert (constraint.target, constraint.bound) == (target, 0.3)


# What was edited since, and a kill


OWN = {
    "edges": [{"name": "edge1", "device": "agx_xavier"}],
    "cars": [
        {"name": "car1", "device": "mine", "edge": "edge1", "route": {"window": ["0 s", "1 s"]}}
    ],
}
EDITS = {
    "the scenario": ("own.yaml", "1 s", "1.5 s"),
    "a device profile": ("device_profiles/mine.yaml", "value: 2.28 ms", "value: 9 ms"),
}


@pytest.fixture
def own() -> str:
    """A search of a scenario and a device profile of the user's own."""
    profile = Path("device_profiles/mine.yaml")
    profile.parent.mkdir()
    shipped = files.find(files.DEVICE, "jetson_tx2").read_text(encoding="utf-8")
    profile.write_text(shipped.replace("name: jetson_tx2", "name: mine", 1), encoding="utf-8")
    write(OWN, "own.yaml")
    return write({**SHORT, "scenario": "own.yaml", "set": {"record": ["held"]}})


def edit(what: str) -> None:
    name, before, after = EDITS[what]
    text = Path(name).read_text(encoding="utf-8")
    assert before in text
    Path(name).write_text(text.replace(before, after), encoding="utf-8")


@pytest.mark.parametrize("what", EDITS)
@pytest.mark.slow
def test_after_an_edit_no_number_of_before_is_reported(
    what: str, own: str, caplog: pytest.LogCaptureFixture
):
    def numbers(out: str) -> list[bytes]:
        assert main(["search", own, "--jobs", "1", "--out", out]) == 0
        return [Path(out, "s", f"{name}.csv").read_bytes() for name in ("points", "designs")]

    before = numbers("out")
    assert numbers("out") == before
    assert not caplog.messages
    edit(what)
    resumed = numbers("out")
    (told,) = caplog.messages
    assert told.startswith("out/s: the search, its scenario or a file that it uses has changed")
    assert resumed == numbers("fresh")
    assert resumed[0] != before[0] and resumed[1] != before[1]


@pytest.mark.parametrize("what", EDITS)
def test_after_an_edit_while_it_runs_there_is_no_report(what: str, own: str):
    work = search(own)
    work.run()
    edit(what)
    with pytest.raises(UserError, match="has changed while it ran; run the same command again"):
        work.finish()
    assert not Path("out/s/designs.csv").exists()


@pytest.mark.process
@pytest.mark.unix
def test_kill_9_and_resume_loses_nothing():
    write({**SHORT, "points": 6, "batch": 2})

    def numbers(out: str) -> list[bytes]:
        assert main(["search", "s.yaml", "--jobs", "1", "--out", out]) == 0
        return [path.read_bytes() for path in sorted(Path(out, "s").glob("*.csv"))]

    command = ["search", "s.yaml", "--out", "killed", "--jobs", "1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", *command],
        env={**os.environ, "PYTHONPATH": str(PACKAGE_FOLDER.parent)},
        start_new_session=True,
        stdout=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 300
    parts = Path("killed/s/parts")
    while len(list(parts.glob("[!.]*.parquet"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = {path: path.stat().st_mtime_ns for path in parts.glob("[!.]*.parquet")}
    assert before and not Path("killed/s/designs.csv").exists()
    assert numbers("killed") == numbers("whole")
    assert before == {path: path.stat().st_mtime_ns for path in before}


MISTAKES = {
    "an unknown metric": (
        {"objectives": {"maximize": "streaming_f2"}},
        "s.yaml: objectives.maximize[0]: unknown metric 'streaming_f2' (did you mean",
    ),
    "a metric twice": (
        {"objectives": {"maximize": "streaming_f1", "minimize": "streaming_f1"}},
        "s.yaml: objectives: the metric streaming_f1 comes twice",
    ),
    "no objective": ({"objectives": {}}, "must name a metric to maximize or to minimize"),
    "a constraint that is none": (
        {"subject_to": "ghost_share < 3"},
        "s.yaml: subject_to[0]: must be such as 'ghost_share <= 0.3', not 'ghost_share < 3'",
    ),
    "an unknown setting": (
        {"methods": {"m": {**SPACE, "space": {"q": {"set": "queue_lenth", "list": [1, 2]}}}}},
        "s: methods.m.space.q: queue_lenth=1: queue_lenth: unknown field; did you mean "
        "'queue_length'",
    ),
    "a setting of the method that it does not have": (
        {"methods": {"m": {**SPACE, "space": {"q": {"set": "method.radius", "list": [1, 2]}}}}},
        "s: methods.m.space.q: ",
    ),
    "a value out of range": (
        {
            "methods": {
                "m": {
                    **SPACE,
                    "space": {"q": {"set": "queue_length", "range": {"from": -2, "to": 1}}},
                }
            }
        },
        "s: methods.m.space.q: queue_length=-2: queue_length: must be",
    ),
    "a space without points": (
        {"methods": {"m": {"method": "remote", "space": {}}}},
        "s.yaml: methods.m.space: must not be empty",
    ),
    "all settings fixed": (
        {"set": {"queue_length": 1, "consumer": "newest"}},
        "s.yaml: methods.remote.space: has no points: 'set' fixes all of its settings",
    ),
    "a condition on nothing": (
        {
            "methods": {
                "m": {**SPACE, "space": {"q": {**SPACE["space"]["queue"], "when": {"x": 1}}}}
            }
        },
        "s.yaml: methods.m.space.q.when: unknown earlier parameter 'x'",
    ),
    "seeds in both sets": (
        {"seeds": {"tuning": [1, 2], "held_out": [2, 3]}},
        "s.yaml: seeds.held_out: seed 2 is a tuning seed, too",
    ),
    "one held-out seed": ({"seeds": {"held_out": 1}}, "s.yaml: seeds.held_out: at least 2"),
    "a drive in both sets": (
        {"drives": {"tuning": {"a": {"x": 1}}, "held_out": {"b": {"x": 1}}}},
        "s.yaml: drives.held_out.b: is a tuning drive, too",
    ),
    "a held-out drive that cannot be, before anything is run": (
        {"drives": {"tuning": {"a": {"seed": 1}}, "held_out": {"b": {"queue_lenth": 1}}}},
        "s: drives.held_out.b: queue_lenth=1: queue_lenth: unknown field; did you mean",
    ),
    "a setting of all designs": (
        {"set": {"cars[0].rout.window": ["0 s", "1 s"]}},
        "cars[0].rout: unknown field; did you mean 'route'?",
    ),
    "an unknown scenario": ({"scenario": "1car_homos"}, "unknown scenario '1car_homos'"),
    "a column's name": (
        {"methods": {"m": {**SPACE, "space": {"state": SPACE["space"]["queue"]}}}},
        "s.yaml: methods.m.space.state: is a column of the tables",
    ),
    "an objective that no run records": (
        {"objectives": {"maximize": "image_reuse"}},
        "objectives: image_reuse: no run records it; unknown recorded metric",
    ),
    "an objective of another placement": (
        {"objectives": {"maximize": "streaming_f1/cra"}},
        "objectives: streaming_f1/cra: no run records it; streaming_f1 is recorded as "
        "streaming_f1, streaming_f1/all/zero_delay",
    ),
    "what a search no longer has": ({"sampler": "nsga2"}, "s.yaml: sampler: was removed"),
}


@pytest.mark.parametrize("what", sorted(MISTAKES))
def test_mistakes_are_told_in_one_line(what: str, capsys: pytest.CaptureFixture[str]):
    change, expected = MISTAKES[what]
    assert main(["search", write({**SHORT, **change}), "--jobs", "1"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("genie-sim: ") and expected in line
    assert not list(Path().glob("results/*/designs*"))


def test_names_that_are_unknown():
    with pytest.raises(UserError, match=r"unknown search or scenario 'where_it_pay' .did you mean"):
        load("where_it_pay")
    with pytest.raises(UserError, match=r"unknown space 'genies' .did you mean 'genie'"):
        load("street_3car_hetero", ["genies"])
    for wrong in ("image_encoding", "=raw"):
        assert main(["search", "where_it_pays", "--set", wrong]) == 1


# Spaces and files

RULE = {"set": "genie.object_map.rule", "list": ["ema", "noisy_or"]}
RATE = {"set": "genie.object_map.rate", "range": {"from": 0.1, "to": 0.9}, "when": {"rule": "ema"}}
RADIUS = {"set": "method.radius", "range": {"from": 0.1, "to": 0.4}}
CASES = {"list": {"near": {"genie.view_range": "30 m"}, "far": {"genie.view_range": "90 m"}}}
NESTED = {"set": "seed", "list": [1, 2], "when": {"rule": ["noisy_or"], "view": ["near", "far"]}}


def space(**parameters: Any) -> Space:
    return from_plain(Space, {"method": "genie", "set": {"seed": 5}, "space": parameters})


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"rate": RATE, "rule": RULE}, "unknown earlier parameter 'rule'"),
        ({"rule": RULE, "rate": {**RATE, "when": {"rule": "max"}}}, "unknown rule 'max'"),
        ({"radius": RADIUS, "rate": {**RATE, "when": {"radius": 0.2}}}, "radius is a range"),
        ({"state": RULE}, "is a column of the tables"),
        ({"streaming_f1": RULE}, "is a column of the tables"),
        ({"rule": {"set": "seed"}}, "must have either 'range' or 'list', has none"),
        (
            {"rule": {**RADIUS, "list": [1]}},
            "must have either 'range' or 'list', has range and list",
        ),
        ({"rule": {"list": [1, 2]}}, "say which setting"),
        ({"rule": {**RULE, "list": ["ema", "ema"]}}, "the value 'ema' comes twice"),
    ],
)
def test_spaces_that_cannot_be(parameters: dict[str, Any], message: str):
    with pytest.raises(SettingError) as error:
        space(**parameters)
    assert message in error.value.message


def test_a_parameter_counts_where_those_before_it_have_the_values_it_names():
    of, fixed = space(rule=RULE, rate=RATE, view=CASES), {"genie.object_map.rule": "ema"}

    def first(name: str, parameter: Parameter) -> Any:
        return parameter.levels[-1]

    assert of.chosen({}, first) == {"rule": "noisy_or", "view": "far"}
    assert of.chosen(fixed, first) == {"rate": 0.9, "view": "far"}
    assert {*of.free({"genie.view_range": "50 m"})} == {"rule", "rate"}


def test_a_point_sets_the_method_and_the_scenario():
    of = space(rule=RULE, radius=RADIUS, view=CASES)
    values = {"rule": "ema", "radius": 0.25, "view": "far"}
    assert of.overrides("best", values, {"seed": 1, "record": ["held"]}) == [
        'methods=[{"name": "best", "method": "genie", "radius": 0.25}]',
        "seed=5",
        'record=["held"]',
        'genie.object_map.rule="ema"',
        'genie.view_range="90 m"',
    ]


def test_samples_use_every_value_of_lists_and_both_ends_of_ranges():
    of = space(rule=RULE, rate=RATE, view=CASES, nested=NESTED)
    samples = list(of.samples({}))
    assert [values["rate"] for name, values in samples if name == "rate"] == [0.1, 0.9]
    assert all(values["rule"] == "ema" for name, values in samples if name == "rate")
    assert [values["rule"] for name, values in samples if name == "rule"] == ["ema", "noisy_or"]
    nested = [values for name, values in samples if name == "nested"]
    assert nested == [{"rule": "noisy_or", "view": "near", "nested": level} for level in (1, 2)]
    fixed = {"genie.object_map.rule": "noisy_or"}
    assert {name for name, _ in of.samples(fixed)} == {"view", "nested"}


def test_changes_of_a_search_are_added_to_its_settings_and_replace_all_else():
    settings = {"record": ["held"], "queue_length": 3}
    changes = {"set": {"queue_length": 4, "spread": "loaded"}, "points": 5}
    design = load({**SHORT, "set": settings}, changes=changes)
    assert design.settings == {"record": ["held"], "queue_length": 4, "spread": "loaded"}
    assert design.points == 5 and design.batch == 3
    plain = {key: value for key, value in SHORT.items() if key != "set"}
    assert load(plain, changes={"set": {"spread": "loaded"}}).settings == {"spread": "loaded"}
