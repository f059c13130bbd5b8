"""The evaluation: declared before, the same on any number of processes, whole or absent, shown as
it came out.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from genie_sim.analysis import text_table
from genie_sim.errors import UserError
from genie_sim.paper import calibrate, drives, table1, verdict_table
from genie_sim.paper.assumptions import load_assumptions
from genie_sim.paper.calibrate import FitPoint
from genie_sim.paper.checks import CASE, load_claims
from genie_sim.paper.definitions import USUAL
from genie_sim.paper.evaluation_run import EvaluationRun, simulated
from genie_sim.paper.facts import Fact, placed
from genie_sim.paper.readings import NAMES, load_readings
from genie_sim.paper.reproduce import last_calibration, reproduce
from genie_sim.paper.runs import Outcome, simulate
from genie_sim.recording import provenance
from genie_sim.runner import prepare
from genie_sim.scenario.scenario import load_scenario
from genie_sim.sim import nodes
from genie_sim.study.parts import Parts

REPOSITORY = Path(__file__).resolve().parents[2]
PAPER = REPOSITORY / "results" / "paper"
GENERATED = (REPOSITORY / "README.md", REPOSITORY / "docs" / "paper.md")
ASSUMED = load_assumptions()
MARKERS = {  # of a document's generated parts
    "readings": ("<!-- readings:begin -->", "<!-- readings:end -->"),
    "verdicts": ("<!-- verdicts:begin -->", "<!-- verdicts:end -->"),
    "counts": ("<!-- counts:begin -->", "<!-- counts:end -->"),
    "section V": ("<!-- section-v:begin -->", "<!-- section-v:end -->"),
    "worth": ("<!-- worth:begin -->", "<!-- worth:end -->"),
    "drives": ("<!-- drives:begin -->", "<!-- drives:end -->"),
    "table I": ("<!-- table-1:begin -->", "<!-- table-1:end -->"),
}


def section_v(rows: list[dict]) -> str:
    """Section V sentence by sentence: the figure and the verdicts."""
    found = verdict_table.by_claim(rows)
    readings = list(next(iter(found.values())))
    lines = [f"| Section V | the paper says | figure | {' | '.join(readings)} | here |"]
    lines.append(f"|---|---|---|{'---|' * len(readings)}---|")
    for one in verdict_table.sentences():
        figure = f"`{one['figure']}`" if one["figure"] else ""
        cells = [
            "; ".join(f"{claim}: {found[claim][name]['verdict']}" for claim in one["claims"])
            for name in readings
        ]
        lines.append(
            f"| {one['part']} | {one['says']} | {figure} | {' | '.join(cells)} |"
            f" {one['note'] or ''} |"
        )
    return "\n".join(lines)


def counts_table(rows: list[dict]) -> str:
    """How many claims of each kind are reproduced under each reading; a number that was fitted, as
    it was fitted.
    """
    readings = list(dict.fromkeys(one["reading"] for one in rows))
    lines = []
    for kind in dict.fromkeys(one["kind"] for one in rows):
        mine = [
            [one for one in rows if (one["reading"], one["kind"]) == (name, kind)]
            for name in readings
        ]
        held = [
            sum(one["verdict"] in ("reproduced", "calibrated") for one in ones) for ones in mine
        ]
        cells = [f"{n} of {len(ones)}" if ones else "" for n, ones in zip(held, mine, strict=True)]
        lines.append([kind.replace("_", " "), *cells])
    table = text_table.markdown(["reproduced", *readings], lines)
    return "\n".join([table, "", *verdict_table.counts(rows)])


def generated_parts(folder: Path) -> dict[str, str]:
    """What documents show of a result folder, by the name of the part. Raises ``UserError``."""
    rows = verdict_table.read_rows(folder)
    parts = {"verdicts": verdict_table.table(rows), "counts": counts_table(rows)}
    parts |= {"section V": section_v(rows), "table I": table1.markdown()}
    parts["readings"] = verdict_table.readings_text(provenance.read_json(folder / "readings.json"))
    quality = folder / "quality.json"
    if quality.is_file():
        parts["worth"] = verdict_table.map_quality_table(provenance.read_json(quality))
    if (folder / "drives.json").is_file():
        parts["drives"] = drives.markdown(provenance.read_json(folder / "drives.json"))
    return parts


def between(name: str, text: str) -> str | None:
    """A document's generated part of that name, ``None`` where it has none."""
    begin, end = MARKERS[name]
    if begin not in text or end not in text:
        return None
    return text.split(begin, 1)[1].split(end, 1)[0].strip()


def refreshed(text: str, parts: dict[str, str]) -> str:
    """The document with its generated parts made anew; a part it does not have is left out."""
    for name, part in parts.items():
        begin, end = MARKERS[name]
        if between(name, text) is not None:
            before, rest = text.split(begin, 1)
            text = f"{before}{begin}\n{part}\n{end}{rest.split(end, 1)[1]}"
    return text


def windows_s(*settings, scenario="3car_homo", seed=1):
    cars = EvaluationRun(scenario, seed, settings).prepare().scenario.cars
    return [tuple(t / 1e9 for t in car.route.window_ns) for car in cars]


def test_two_parameters_are_fitted_to_two_numbers_on_seeds_of_their_own():
    assert [one.name for one in ASSUMED.fitted] == ["overlap", "gate_m"]
    targets = ASSUMED.targets
    assert targets == {"object_reuse_mean": 0.31, "object_to_image_reuse": 4.0}
    assert not set(ASSUMED.calibration_seeds) & set(ASSUMED.seeds)
    assert len(ASSUMED.seeds) >= 10


def test_fitted_parameters_are_swept_over_more_than_their_plausible_ranges():
    swept = {sweep.parameter: sweep for sweep in ASSUMED.sweeps}
    for one in ASSUMED.fitted:
        assert swept[one.name].plausible == one.range
        assert max(swept[one.name].values) > one.range[1]


def test_everything_fixed_has_a_reason():
    for one in ASSUMED.fixed:
        assert one["value"] and len(one["why"]) > 40, one["what"]


def test_the_overlap_is_the_share_of_a_route_that_the_car_ahead_drives_too():
    assert windows_s("overlap=0") == [(0.0, 5.2), (5.2, 10.4), (10.4, 15.6)]
    assert len(set(windows_s("overlap=1"))) == 1
    (_, first_end), (second_begin, _), _ = windows_s("overlap=0.4")
    assert (first_end - second_begin) / 5.2 == pytest.approx(0.4)


def test_one_car_and_three_see_the_same_street_over_the_seeds():
    """Where a car drives on average: in the middle of the street, however many there are."""
    for scenario in ("1car_homo", "2car_homo", "3car_homo"):
        middles = [
            sum(w) / 2
            for seed in ASSUMED.seeds
            for w in windows_s("overlap=0.1", scenario=scenario, seed=seed)
        ]
        assert sum(middles) / len(middles) == pytest.approx(7.8, abs=0.6)
        assert all(
            begin >= 0 and end <= 15.6 + 1e-6
            for begin, end in windows_s("overlap=0.1", scenario=scenario)
        )


def test_the_car_without_cameras_drives_behind():
    (seeing, _), (blind, _) = windows_s("overlap=0.4", scenario="case_study")
    assert blind < seeing


@pytest.mark.parametrize("variant", ASSUMED.variants, ids=lambda variant: variant.name)
def test_every_variant_changes_the_scenario(variant):
    base = EvaluationRun("3car_hetero", 1, last_calibration()).prepare().scenario
    assert (
        EvaluationRun("3car_hetero", 1, (*last_calibration(), *variant.settings)).prepare().scenario
        != base
    )


@pytest.mark.parametrize("sweep", ASSUMED.sweeps, ids=lambda sweep: sweep.parameter)
def test_every_value_of_a_sweep_is_another_run(sweep):
    settings = [
        ("overlap=0.5", "gate_m=1", f"{sweep.parameter}={value:g}") for value in sweep.values
    ]
    prepared = [EvaluationRun("2car_homo", 1, one).prepare() for one in settings]
    assert len({(one.scenario.to_yaml(), one.drives["car1"].digest) for one in prepared}) == len(
        sweep.values
    )


@pytest.mark.parametrize("harm", ["nothing", "wraps a method", "changes its topics"])
def test_it_is_seen_when_attaching_a_genie_touches_the_node(harm, monkeypatch):
    attach_genie = nodes.attach

    def attach(graph, name, *arguments, **options):
        node = graph.node(name)
        genie = attach_genie(graph, name, *arguments, **options)
        if harm == "wraps a method":
            node.publish = node.publish
        elif harm == "changes its topics":
            node.subscribes = tuple(f"{topic}-local" for topic in node.subscribes)
        return genie

    monkeypatch.setattr("genie_sim.sim.world.attach", attach)
    short = load_scenario("1car_homo", ["cars[0].route.window=[0 s, 0.3 s]"])
    _, judged = simulated(prepare(short))
    assert judged[USUAL][Fact("detector_untouched")] == (harm == "nothing")


def test_a_genie_without_the_nodes_topics_ends_the_run(monkeypatch):
    attach_genie = nodes.attach

    def attach(graph, name, *arguments, **options):
        topics = {topic: topic for of_node in graph.topics_of(name) for topic in of_node}
        genie = attach_genie(graph, name, *arguments, **options)
        graph.remap(name, topics)
        return genie

    monkeypatch.setattr("genie_sim.sim.world.attach", attach)
    short = load_scenario("1car_homo", ["cars[0].route.window=[0 s, 0.3 s]"])
    with pytest.raises(UserError, match="frames of car1 do not reach its detector"):
        simulated(prepare(short))


def test_the_number_of_processes_does_not_change_a_number(tmp_path):
    places = [(scenario, seed) for scenario in ("1car_homo", "2car_hetero") for seed in (1, 2)]
    runs = [
        EvaluationRun(scenario, seed, last_calibration(), ("genie",)) for scenario, seed in places
    ]
    alone = simulate(runs, Parts(tmp_path / "alone"), 1)
    together = simulate(runs, Parts(tmp_path / "together"), 2)
    assert [repr(outcome.facts) for outcome in alone] == [
        repr(outcome.facts) for outcome in together
    ]


def test_the_search_finds_the_point_that_fits_and_stays_in_the_plausible_ranges():
    """A made-up world in which the object reuse is the gate / 2 m and the image reuse a quarter of
    the overlap.
    """

    def world(jobs, what):
        found = []
        for job in jobs:
            overlap, gate_m = (float(setting.split("=")[1]) for setting in job.settings[-2:])
            facts = {}
            for placement in ("car", "edge"):
                facts[placed("object_reuse", placement)] = gate_m / 2
                facts[placed("image_reuse", placement)] = overlap / 4
            found.append(Outcome({USUAL: facts}))
        return found

    found = calibrate.calibrate(ASSUMED, world)
    assert found.best.gate_m == pytest.approx(0.62, abs=0.25)
    assert found.best.overlap == pytest.approx(0.31, abs=0.1)
    assert all(0.0 <= one.overlap <= 0.8 and 0.25 <= one.gate_m <= 2.1 for one in found.tried)
    assert found.best == min(found.tried, key=lambda one: one.misfit(found.targets))


def test_the_search_goes_to_the_end_of_the_plausible_ranges_and_no_further():
    def world(jobs, what):
        settings = [dict(setting.split("=") for setting in job.settings[-2:]) for job in jobs]
        rates = [(float(one["gate_m"]) / 20, float(one["overlap"]) / 40) for one in settings]
        return [
            Outcome(
                {
                    USUAL: {
                        placed(metric, at): rate
                        for metric, rate in (("object_reuse", hits), ("image_reuse", images))
                        for at in ("car", "edge")
                    }
                }
            )
            for hits, images in rates
        ]

    found = calibrate.calibrate(ASSUMED, world)
    assert (found.best.overlap, found.best.gate_m) == (0.8, 2.1)
    assert all(0.0 <= one.overlap <= 0.8 and 0.25 <= one.gate_m <= 2.1 for one in found.tried)


def test_the_search_averages_scenarios_seeds_and_roles_and_halves_its_grid():
    """A world in which every scenario, seed and role has other reuse, and only their mean follows
    from the parameters; the best point lies off the coarse grid.
    """
    places = [
        (scenario, seed) for scenario in ASSUMED.scenarios for seed in ASSUMED.calibration_seeds
    ]
    shift = dict(zip(places, np.linspace(-0.1, 0.1, len(places)), strict=True))

    def world(runs, what):
        found = []
        for run in runs:
            overlap, gate_m = (float(setting.split("=")[1]) for setting in run.settings[-2:])
            of_run = shift[run.scenario, run.seed]
            facts = {}
            for placement, of_role in (("car", 0.08), ("edge", -0.08)):
                facts[placed("object_reuse", placement)] = gate_m / 2 + of_run + of_role
                facts[placed("image_reuse", placement)] = overlap / 4 + of_run - of_role
            found.append(Outcome({USUAL: facts}))
        return found

    found = calibrate.calibrate(ASSUMED, world)
    for point in found.tried:
        assert point.object_reuse == pytest.approx(point.gate_m / 2)
        assert point.image_reuse == pytest.approx(point.overlap / 4)
    for values, (low, high) in (
        ({point.overlap for point in found.tried}, ASSUMED.fitted[0].range),
        ({point.gate_m for point in found.tried}, ASSUMED.fitted[1].range),
    ):
        finest = (high - low) / (calibrate.GRID - 1) / 2**calibrate.REFINEMENTS
        assert np.diff(sorted(values)).min() == pytest.approx(finest, abs=1e-4)


@pytest.mark.parametrize(
    ("share", "reached"), [(1.09, True), (1.11, False), (0.91, True), (0.89, False)]
)
def test_a_fit_is_reached_within_ten_percent_of_both_targets(share, reached):
    targets = ASSUMED.targets
    level = FitPoint(0.4, 1.0, 0.31 * share, 0.31 * share / 4)
    ratio = FitPoint(0.4, 1.0, 0.31, 0.31 / 4 / share)
    for point in (level, ratio):
        assert calibrate.Calibration(point, (), targets).reached == reached


def test_a_fit_that_misses_is_not_called_reached():
    targets = ASSUMED.targets
    assert calibrate.Calibration(FitPoint(0.4, 1.0, 0.31, 0.0775), (), targets).reached
    assert not calibrate.Calibration(FitPoint(0.4, 1.0, 0.55, 0.1375), (), targets).reached
    assert math.isclose(FitPoint(0.4, 1.0, 0.31, 0.0775).misfit(targets), 0.0, abs_tol=1e-12)


@pytest.mark.slow
def test_a_quick_evaluation_judges_every_claim_and_draws_every_figure(tmp_path):
    told = []
    result = reproduce(
        tmp_path / "out", quick=True, seeds=1, workers=1, progress=lambda *what: told.append(what)
    )
    rows = verdict_table.read_rows(result.folder)
    assert [(one["reading"], one["id"]) for one in rows] == [
        (name, one.id) for name in NAMES for one in load_claims()
    ]
    assert told[-1][0] == told[-1][1], "the progress ends at its end"
    for name in (
        "latency_cdf",
        "image_reuse",
        "object_reuse",
        "confidence_boost",
        "case_study",
        "worth",
    ):
        assert (result.folder / "figures" / f"{name}.svg").stat().st_size > 10_000
    assert "| streaming precision |" in (result.folder / "verdicts.md").read_text()
    assert json.loads((result.folder / "run.json").read_text())["quick"] is True


def test_an_interrupted_evaluation_leaves_no_result_and_the_next_one_goes_on_with_its_runs(
    tmp_path, monkeypatch
):
    def interrupt(done, total, what):
        if done:
            raise KeyboardInterrupt

    base = {"base": ((CASE,), (), ("genie",))}
    monkeypatch.setattr("genie_sim.paper.reproduce.FOR_CLAIMS", base)
    monkeypatch.setattr("genie_sim.paper.reproduce.ALL", ("1car_homo", "1car_hetero"))
    monkeypatch.setattr("genie_sim.study.parts.TASK_FRAMES", 1)
    quick = {"quick": True, "seeds": 1, "workers": 1, "reading": "default"}
    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path / "out", progress=interrupt, **quick)
    assert [path.name for path in tmp_path.iterdir()] == [".out.runs"]
    measure, scenarios = EvaluationRun.measure, []
    monkeypatch.setattr(
        EvaluationRun,
        "measure",
        lambda run, *arguments: scenarios.append(run.scenario) or measure(run, *arguments),
    )
    with pytest.raises(KeyboardInterrupt):
        reproduce(
            tmp_path / "out", progress=lambda done, of, _: interrupt(done == of, of, _), **quick
        )
    assert len(scenarios) == 2


def test_the_committed_results_are_those_of_the_committed_assumptions():
    about = json.loads((PAPER / "run.json").read_text())
    here = REPOSITORY / "genie_sim" / "paper"
    for name, digest in about["inputs"].items():
        assert hashlib.sha256((here / name).read_bytes()).hexdigest() == digest, (
            f"{name} changed: evaluate anew"
        )
    assert about["quick"] is False
    assert tuple(about["seeds"]) == ASSUMED.seeds
    assert {name: tuple(used) for name, used in about["settings"].items()} == {
        one.name: one.settings(last_calibration()) for one in load_readings()
    }


def test_the_committed_results_are_small():
    committed = [path for path in PAPER.rglob("*") if path.is_file() and path.name != "report.html"]
    assert sum(path.stat().st_size for path in committed) < 4_000_000


@pytest.mark.parametrize("document", GENERATED, ids=lambda path: path.name)
def test_the_documents_show_the_committed_verdicts(document):
    text = document.read_text(encoding="utf-8")
    for name, part in generated_parts(PAPER).items():
        shown = between(name, text)
        assert shown is None or shown == part, (
            f"{document.name} shows other {name}: python tests/paper/test_reproduce.py"
        )
    if document.name == "README.md":
        assert between("counts", text) is not None
    if document.name == "paper.md":
        assert between("verdicts", text) is not None
        assert between("section V", text) is not None


def refresh(repository):
    """Writes the committed evaluation into the fitted parameters and the documents of a
    repository.
    """
    best = json.loads((PAPER / "calibration.json").read_text())["best"]
    fitted = repository / "genie_sim" / "paper" / "calibrated.yaml"
    comments = [
        line for line in fitted.read_text(encoding="utf-8").splitlines() if line.startswith("#")
    ]
    fitted.write_text(
        "\n".join([*comments, *(f"{one.name}: {best[one.name]:g}" for one in ASSUMED.fitted)])
        + "\n"
    )
    for path in GENERATED:
        path = repository / path.relative_to(REPOSITORY)
        shown = refreshed(path.read_text(encoding="utf-8"), generated_parts(PAPER))
        path.write_text(shown, encoding="utf-8")


def test_refreshing_what_is_committed_changes_nothing(tmp_path):
    """What ``python tests/paper/test_reproduce.py`` does after an evaluation."""
    files = [*GENERATED, REPOSITORY / "genie_sim" / "paper" / "calibrated.yaml"]
    for path in files:
        (tmp_path / path.relative_to(REPOSITORY)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, tmp_path / path.relative_to(REPOSITORY))
    refresh(tmp_path)
    for path in files:
        assert (tmp_path / path.relative_to(REPOSITORY)).read_bytes() == path.read_bytes(), path


if __name__ == "__main__":
    refresh(REPOSITORY)
