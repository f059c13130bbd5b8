"""The paper's whole evaluation: calibration, replicated runs, ablations, sweeps, verdicts and figures in one folder.

Nothing here decides anything: assumptions.yaml does, before; claims.yaml says what is tested.
"""

import hashlib
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim import report
from genie_sim.errors import UserError
from genie_sim.paper import drives, quality, verdict_table
from genie_sim.paper import page as evaluation
from genie_sim.paper.arms import Arms, arms_of, run_arms
from genie_sim.paper.assumptions import Assumptions, load_assumptions
from genie_sim.paper.calibrate import Calibration, calibrate, most_jobs
from genie_sim.paper.checks import ALL, CASE, HE, HO, SHARED, improvements
from genie_sim.paper.claims import Verdict, judge
from genie_sim.paper.evidence import Evidence, Values, interval
from genie_sim.paper.facts import Facts
from genie_sim.paper.readings import DEFAULT, Reading, load_readings
from genie_sim.paper.replicate import (
    EVERY_METHOD,
    Job,
    Outcome,
    Progress,
    TimeLeft,
    in_parallel,
    prepare_job,
)
from genie_sim.paper.runs import Runs
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import read_mapping

QUICK_SEEDS = 4

# Runs that single claims need besides the six scenarios, with as many seeds: variant -> (scenarios, settings, methods).
FOR_CLAIMS: dict[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    "base": ((CASE,), (), EVERY_METHOD),
    "ideal_link": ((HE[0],), ("links=ideal",), ("remote", "genie")),
    "no_edge_sharing": (
        SHARED,
        ("genie.share_requests=false", "genie.share_answers=on_request"),
        ("genie",),
    ),
    "two_laps": ((HO[0], HE[0]), ("laps=2",), ("genie",)),
    "cut_link": ((HO[0],), ("link=cut",), ("local", "genie")),
}

Key = tuple[str, str]  # variant, scenario


@dataclass(frozen=True)
class Judged:
    """What the claims come to under one reading; ``plain``: by the default's metrics where the reading means others."""

    reading: Reading
    settings: tuple[str, ...]
    evidence: Evidence
    verdicts: list[Verdict]
    plain: list[Verdict] | None


@dataclass(frozen=True)
class Reproduction:
    """A finished evaluation; ``drives`` is the table of the claims on other drives, where it was wanted."""

    folder: Path
    readings: list[Judged]
    wall_time_s: float
    drives: str = ""


def reproduce(
    out: Path, quick: bool = False, seeds: int | None = None, workers: int | None = None,
    progress: Progress | None = None, with_drives: bool = False, reading: str | None = None,
) -> Reproduction:  # fmt: skip
    """Runs the evaluation and puts everything into ``out``, which appears when it is complete.

    ``quick``: few seeds, the calibration of the last full run, no variants and sweeps. ``seeds``: how many, instead of
    those of assumptions.yaml. ``with_drives``: the main claims on every sequence of KITTI's tracking benchmark, too.
    ``reading``: this one alone, by name or path; figures and what the answers are worth are those of the first reading,
    variants and sweeps those of the default. Raises ``UserError`` where ``out`` cannot be written, a reading does not
    fit the scenarios, or there are no such sequences.
    """
    provenance.check_writable(out.parent)
    provenance.check_replaceable(out)
    readings = load_readings(reading)
    assumptions, calibrated = load_assumptions(), last_calibration()
    for one in readings:
        check(one)
    on_drives = drives.jobs() if with_drives else []
    workers = workers or os.cpu_count() or 1
    used_seeds = _seeds(assumptions, quick, seeds)
    swept = not quick and readings[0].name == DEFAULT
    tell = TimeLeft(
        _total(assumptions, len(readings), quick, swept, len(used_seeds)) + len(on_drives), progress
    )
    runs = Runs(workers, tell)
    fitted = (
        calibrate(assumptions, runs) if not quick and any(one.fitted for one in readings) else None
    )
    if fitted is not None:
        calibrated = fitted.best.settings
    judged, tables = _evaluate(readings, calibrated, used_seeds, runs)
    arms = run_arms(assumptions, judged[0].settings, used_seeds, runs) if swept else None
    made = _Evaluation(
        judged, used_seeds, tables, fitted, arms, quality.summarise(judged[0].evidence, ALL)
    )
    driven = in_parallel(drives.run_drive, on_drives, workers, tell, "drives") if on_drives else []
    with provenance.result_folder(out) as folder:
        made.write(folder)
        table = drives.write(folder, driven) if driven else ""
        made.draw(folder / "figures", workers)
        wall_time_s = time.perf_counter() - tell.began_s
        about = {
            "quick": quick,
            "workers": workers,
            "wall_time_s": round(wall_time_s, 1),
            **made.provenance(),
        }
        provenance.write_json(folder / "run.json", about)
        report.write_text(folder / report.NAME, evaluation.page(folder))
    return Reproduction(out, judged, wall_time_s, table)


def last_calibration() -> tuple[str, ...]:
    """The fitted parameters of the last full run, as settings."""
    path = Path(__file__).with_name("calibrated.yaml")
    return tuple(f"{name}={value:g}" for name, value in read_mapping(path).items())


def check(reading: Reading) -> None:
    """Raises ``UserError`` where a scenario cannot have what the reading sets."""
    for number, choice in enumerate(reading.choices):
        try:
            for scenario in (HE[-1], CASE):
                prepare_job(Job(scenario, 1, choice.settings))
        except UserError as error:
            raise UserError(f"{reading.path}: choices[{number}].set: {error}") from error


@dataclass(frozen=True)
class _Evaluation:
    """Everything that came out; ``tables`` are the first reading's runs by scenario, ``arms`` is ``None`` where other
    values were not tried."""

    judged: list[Judged]
    seeds: tuple[int, ...]
    tables: Mapping[str, Sequence[Outcome]]
    fitted: Calibration | None
    arms: Arms | None
    worth: list[dict[str, Any]]

    def write(self, folder: Path) -> None:
        """Everything but figures and page. Raises OSError."""
        rows = [row for one in self.judged for row in _rows(one, self.arms)]
        readings = [one.reading.as_json() | {"settings": list(one.settings)} for one in self.judged]
        provenance.write_json(folder / "verdicts.json", rows)
        provenance.write_json(folder / "readings.json", readings)
        text = verdict_table.document(rows, readings, self.worth)
        (folder / "verdicts.md").write_text(text, encoding="utf-8")
        metrics = [
            {"reading": one.reading.name, **row}
            for one in self.judged
            for row in _metrics(one.evidence)
        ]
        provenance.write_json(folder / "metrics.json", metrics)
        provenance.write_json(folder / "quality.json", self.worth)
        if self.fitted is not None:
            provenance.write_json(folder / "calibration.json", self.fitted.as_json())
        if self.arms is not None:
            provenance.write_json(folder / "sensitivity.json", self.arms.as_json())

    def draw(self, folder: Path, workers: int) -> None:
        """The figures. Raises OSError."""
        from genie_sim.paper import paper_figures

        folder.mkdir()
        first = self.judged[0]
        footer = f"genie-sim reproduce, {first.reading.name}: {', '.join(first.settings)}, {len(self.seeds)} seeds"
        sweeps = self.arms.sweeps if self.arms is not None else []
        targets = load_assumptions().targets
        paper_figures.draw(
            folder, self.tables, self.fitted, sweeps, self.worth, targets, footer, workers
        )

    def provenance(self) -> dict[str, Any]:
        """For ``run.json``: what the numbers come from."""
        here = Path(__file__).parent
        inputs = [here / name for name in ("assumptions.yaml", "claims.yaml")]
        inputs += [one.reading.path for one in self.judged]
        names = [
            str(path.relative_to(here)) if path.is_relative_to(here) else path.name
            for path in inputs
        ]
        return {
            "settings": {one.reading.name: list(one.settings) for one in self.judged},
            "seeds": list(self.seeds),
            "calibration": "searched"
            if self.fitted
            else "that of the last full run (calibrated.yaml)",
            "inputs": {
                name: hashlib.sha256(path.read_bytes()).hexdigest()
                for name, path in zip(names, inputs, strict=True)
            },
            "trace": next(iter(prepare_job(Job(ALL[0], 1)).frames.digests().values())),
            **provenance.environment(),
        }


def _seeds(assumptions: Assumptions, quick: bool, seeds: int | None) -> tuple[int, ...]:
    if seeds is not None:
        return tuple(range(1, seeds + 1))
    return assumptions.seeds[:QUICK_SEEDS] if quick else assumptions.seeds


def _total(assumptions: Assumptions, readings: int, quick: bool, swept: bool, seeds: int) -> int:
    """How many runs will be asked for, about; the progress bar is told of those that are known already, too."""
    base = (
        readings
        * seeds
        * (len(ALL) + sum(len(scenarios) for scenarios, _, _ in FOR_CLAIMS.values()))
    )
    arms = (len(list(arms_of(assumptions))) + 1) * len(ALL) * seeds if swept else 0
    return base + arms + (0 if quick else most_jobs(assumptions))


def _evaluate(
    readings: Sequence[Reading], calibrated: Sequence[str], seeds: Sequence[int], runs: Runs
) -> tuple[list[Judged], dict[str, list[Outcome]]]:
    """The verdicts under each reading, and the runs of the first by scenario, with their tables."""
    places: list[Key] = [("base", scenario) for scenario in ALL]
    places += [
        (variant, scenario)
        for variant, (scenarios, _, _) in FOR_CLAIMS.items()
        for scenario in scenarios
    ]
    settings = [one.settings(calibrated) for one in readings]
    jobs = []
    for mine in settings:
        for variant, scenario in places:
            shown = mine is settings[0] and variant == "base"
            _, more, methods = FOR_CLAIMS[variant]
            jobs += [
                Job(scenario, seed, (*mine, *more), methods, shown, judged=shown) for seed in seeds
            ]
    outcomes = iter(runs(jobs, "claims"))
    grouped = [{place: [next(outcomes) for _ in seeds] for place in places} for _ in readings]
    facts = [
        {key: [one.facts for one in group] for key, group in found.items()} for found in grouped
    ]
    judged = in_parallel(_judged, list(zip(readings, settings, facts, strict=True)), runs.workers)
    return judged, {
        scenario: group for (variant, scenario), group in grouped[0].items() if variant == "base"
    }


def _judged(asked: tuple[Reading, tuple[str, ...], Mapping[Key, Sequence[Facts]]]) -> Judged:
    """The verdicts under one reading, from its settings and what its runs gave."""
    reading, settings, facts = asked
    evidence, fitted = Evidence(facts, reading.definitions), bool(reading.fitted)
    plain = judge(Evidence(facts), fitted) if reading.means_others else None
    return Judged(reading, settings, evidence, judge(evidence, fitted), plain)


def _rows(judged: Judged, arms: Arms | None) -> Iterator[dict[str, Any]]:
    """Each verdict as plain data."""
    arms = arms if judged.reading.name == DEFAULT else None
    plain = [None] * len(judged.verdicts) if judged.plain is None else judged.plain
    for verdict, other in zip(judged.verdicts, plain, strict=True):
        yield verdict_table.row(verdict, arms, judged.reading.name, other)


def _metrics(evidence: Evidence) -> list[dict[str, Any]]:
    """Every fact of the six scenarios and the case study, as a mean over seeds with its 95 % interval."""
    found = []
    for scenario in (*ALL, CASE):
        for name in evidence.names(scenario):
            values = evidence.of(scenario, name)
            if not np.isnan(values).all():
                found.append(_metric(scenario, name, values[~np.isnan(values)]))
    for answer in ("first", "fresh"):
        average = np.mean(list(improvements(evidence, answer).values()), axis=0)
        found.append(_metric("all", f"improvement_{answer}", average))
    return found


def _metric(scenario: str, name: str, values: Values) -> dict[str, Any]:
    value, low, high = (float(f"{number:.6g}") for number in interval(values))
    return {
        "scenario": scenario,
        "name": name,
        "value": value,
        "low": low,
        "high": high,
        "n": len(values),
    }
