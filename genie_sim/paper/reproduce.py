"""The paper's whole evaluation: calibration, replicated runs, ablations, sweeps, verdicts and
figures in one folder.

Nothing here decides anything: assumptions.yaml does, before; claims.yaml says what is tested.
"""

import hashlib
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim import report
from genie_sim.errors import UserError
from genie_sim.paper import drives, figure_tables, page, quality, verdict_table
from genie_sim.paper.arms import Arms, arms_of, run_arms
from genie_sim.paper.assumptions import Assumptions, load_assumptions
from genie_sim.paper.calibrate import Calibration, calibrate, max_runs
from genie_sim.paper.checks import ALL, CASE, HE, HO, SHARED, improvements
from genie_sim.paper.claims import Verdict, judge
from genie_sim.paper.definitions import USUAL, Definitions
from genie_sim.paper.evaluation_run import EVERY_METHOD, EvaluationRun
from genie_sim.paper.evidence import Evidence, Values, interval, rounded
from genie_sim.paper.facts import Fact
from genie_sim.paper.readings import DEFAULT, Reading, load_readings
from genie_sim.paper.runs import BatchProgress, EvaluationRuns, Outcome
from genie_sim.parallel import in_parallel, workers_here
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.study.parts import Parts, Progress

QUICK_SEEDS = 4

# Runs that single claims need besides the six scenarios, with as many seeds: variant -> (scenarios,
# settings, methods).
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
    """What the claims come to under one reading; ``plain``: by the default's metrics where the
    reading means others.
    """

    reading: Reading
    settings: tuple[str, ...]
    evidence: Evidence
    verdicts: list[Verdict]
    plain: list[Verdict] | None


@dataclass(frozen=True)
class Reproduction:
    """A finished evaluation; ``drives`` is the table of the claims on other drives, where it was
    wanted.
    """

    folder: Path
    readings: list[Judged]
    wall_time_s: float
    drives: str = ""


def reproduce(
    out: Path,
    *,
    quick: bool = False,
    seeds: int | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    with_drives: bool = False,
    reading: str | None = None,
) -> Reproduction:
    """Runs the evaluation. The result appears when it is complete; until then finished runs are
    kept beside it, and an evaluation that was interrupted goes on with them.

    Parameters
    ----------
    out : Path
        The result folder.
    quick : bool
        Few seeds, the calibration of the last full run, no variants and no other values.
    seeds : int, optional
        How many seeds, instead of those of assumptions.yaml.
    workers : int, optional
        How many processes; default: one a core.
    progress : callable, optional
        Told how many runs are done, of how many, and of what.
    with_drives : bool
        The main claims on every sequence of KITTI's tracking benchmark, too.
    reading : str, optional
        This one alone, by name or path. Figures and answer quality are those of the first reading,
        variants and other values those of the default.

    Raises
    ------
    UserError
        If ``out`` cannot be written, a reading does not fit the scenarios, or there are no such
        sequences.
    """
    provenance.check_writable(out.parent)
    provenance.check_replaceable(out)
    readings = load_readings(reading)
    assumptions, calibrated = load_assumptions(), last_calibration()
    for each in readings:
        check(each)
    on_drives = drives.all_runs() if with_drives else []
    workers = workers or workers_here()
    used_seeds = _seeds(assumptions, quick, seeds)
    swept = not quick and readings[0].name == DEFAULT
    tell = BatchProgress(
        _total(assumptions, len(readings), quick, swept, len(used_seeds)) + len(on_drives), progress
    )
    unfinished = Parts(out.with_name(f".{out.name}.runs"))
    runs = EvaluationRuns(unfinished, workers, tell)
    fitted = (
        calibrate(assumptions, runs)
        if not quick and any(each.fitted for each in readings)
        else None
    )
    if fitted is not None:
        calibrated = fitted.best.settings
    judged, tables = _evaluate(readings, calibrated, used_seeds, runs)
    arms = run_arms(assumptions, judged[0].settings, used_seeds, runs) if swept else None
    evaluation = _Evaluation(
        judged=judged,
        seeds=used_seeds,
        tables=tables,
        fitted=fitted,
        arms=arms,
        worth=quality.summarise(judged[0].evidence, ALL),
    )
    driven = drives.simulate(on_drives, unfinished, workers, tell) if on_drives else []
    with provenance.result_folder(out) as folder:
        evaluation.write(folder)
        table = drives.write(folder, driven) if driven else ""
        (folder / "figures").mkdir()
        in_parallel(_draw, [(folder, name) for name in figure_tables.figures(folder)], workers)
        wall_time_s = time.perf_counter() - tell.began_s
        about = {
            "quick": quick,
            "workers": workers,
            "wall_time_s": round(wall_time_s, 1),
            **evaluation.provenance(),
            "digests": provenance.digests(
                folder, [*page.files_of(folder), *figure_tables.FILES.values()]
            ),
        }
        provenance.write_json(folder / "run.json", about)
        report.write_text(folder / report.NAME, page.page(folder))
    shutil.rmtree(unfinished.folder, ignore_errors=True)
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
                EvaluationRun(scenario, 1, choice.settings).prepare()
        except UserError as error:
            raise UserError(f"{reading.path}: choices[{number}].set: {error}") from error


@dataclass(frozen=True)
class _Evaluation:
    """Everything that came out; ``tables`` are the first reading's runs by scenario, ``arms`` is
    ``None`` where other values were not tried.
    """

    judged: list[Judged]
    seeds: tuple[int, ...]
    tables: Mapping[str, Sequence[Outcome]]
    fitted: Calibration | None
    arms: Arms | None
    worth: list[dict[str, Any]]

    def write(self, folder: Path) -> None:
        """Everything but figures and page. Raises OSError."""
        figure_tables.write(folder, self.tables, self.seeds)
        rows = [row for judged in self.judged for row in _rows(judged, self.arms)]
        readings = [
            judged.reading.as_json() | {"settings": list(judged.settings)} for judged in self.judged
        ]
        provenance.write_json(folder / "verdicts.json", rows)
        provenance.write_json(folder / "readings.json", readings)
        text = verdict_table.document(rows, readings, self.worth)
        (folder / "verdicts.md").write_text(text, encoding="utf-8")
        metrics = [
            {"reading": judged.reading.name, **row}
            for judged in self.judged
            for row in _metrics(judged.evidence)
        ]
        provenance.write_json(folder / "metrics.json", metrics)
        provenance.write_json(folder / "quality.json", self.worth)
        if self.fitted is not None:
            provenance.write_json(folder / "calibration.json", self.fitted.as_json())
        if self.arms is not None:
            provenance.write_json(folder / "sensitivity.json", self.arms.as_json())

    def provenance(self) -> dict[str, Any]:
        """For ``run.json``: what the numbers come from."""
        package = Path(__file__).parent
        inputs = [package / name for name in ("assumptions.yaml", "claims.yaml")]
        inputs += [judged.reading.path for judged in self.judged]
        names = [
            str(path.relative_to(package)) if path.is_relative_to(package) else path.name
            for path in inputs
        ]
        return {
            "settings": {judged.reading.name: list(judged.settings) for judged in self.judged},
            "seeds": list(self.seeds),
            "calibration": "searched"
            if self.fitted
            else "that of the last full run (calibrated.yaml)",
            "inputs": {
                name: hashlib.sha256(path.read_bytes()).hexdigest()
                for name, path in zip(names, inputs, strict=True)
            },
            "trace": next(iter(EvaluationRun(ALL[0], 1).prepare().frames.digests().values())),
            **provenance.environment(),
        }


def _seeds(assumptions: Assumptions, quick: bool, seeds: int | None) -> tuple[int, ...]:
    if seeds is not None:
        return tuple(range(1, seeds + 1))
    return assumptions.seeds[:QUICK_SEEDS] if quick else assumptions.seeds


def _total(assumptions: Assumptions, readings: int, quick: bool, swept: bool, seeds: int) -> int:
    """How many runs will be asked for, about; the progress bar is told of those that are known
    already, too.
    """
    base = (
        readings
        * seeds
        * (len(ALL) + sum(len(scenarios) for scenarios, _, _ in FOR_CLAIMS.values()))
    )
    arms = (len(list(arms_of(assumptions))) + 1) * len(ALL) * seeds if swept else 0
    return base + arms + (0 if quick else max_runs(assumptions))


def _evaluate(
    readings: Sequence[Reading],
    calibrated: Sequence[str],
    seeds: Sequence[int],
    runs: EvaluationRuns,
) -> tuple[list[Judged], dict[str, list[Outcome]]]:
    """The verdicts under each reading, and the runs of the first by scenario, with their tables."""
    places: list[Key] = [("base", scenario) for scenario in ALL]
    places += [
        (variant, scenario)
        for variant, (scenarios, _, _) in FOR_CLAIMS.items()
        for scenario in scenarios
    ]
    settings = [reading.settings(calibrated) for reading in readings]
    wanted = [
        _run_of(reading, of_reading, variant, scenario, seed, shown=number == 0)
        for number, (reading, of_reading) in enumerate(zip(readings, settings, strict=True))
        for variant, scenario in places
        for seed in seeds
    ]
    outcomes = iter(runs(wanted, "claims"))
    grouped = [{place: [next(outcomes) for _ in seeds] for place in places} for _ in readings]
    judged = _judged(readings, settings, grouped, runs.workers)
    first = grouped[0].items()
    return judged, {scenario: group for (variant, scenario), group in first if variant == "base"}


def _run_of(
    reading: Reading,
    settings: tuple[str, ...],
    variant: str,
    scenario: str,
    seed: int,
    *,
    shown: bool,
) -> EvaluationRun:
    """A run that the claims need under a reading. The base runs of the reading that is ``shown`` in
    figures keep their tables, and what consumers hold is judged.
    """
    _, more, methods = FOR_CLAIMS[variant]
    shown = shown and variant == "base"
    return EvaluationRun(
        scenario,
        seed,
        (*settings, *more),
        methods,
        keep_tables=shown,
        judged=shown,
        definitions=tuple(dict.fromkeys((USUAL, reading.definitions))),
    )


def _judged(
    readings: Sequence[Reading],
    settings: Sequence[tuple[str, ...]],
    groups: Sequence[Mapping[Key, Sequence[Outcome]]],
    workers: int,
) -> list[Judged]:
    """The verdicts under each reading, from its settings and what its runs gave."""
    meant = [  # by each reading, and by all
        (place, definitions)
        for place, reading in enumerate(readings)
        for definitions in dict.fromkeys((reading.definitions, USUAL))
    ]
    evidence = {key: _evidence(groups[key[0]], key[1]) for key in meant}
    jobs = [(evidence[key], bool(readings[key[0]].fitted)) for key in meant]
    verdicts = dict(zip(meant, in_parallel(_verdicts, jobs, workers), strict=True))
    return [
        Judged(
            reading,
            settings[place],
            evidence=evidence[place, reading.definitions],
            verdicts=verdicts[place, reading.definitions],
            plain=verdicts[place, USUAL] if reading.definitions != USUAL else None,
        )
        for place, reading in enumerate(readings)
    ]


def _evidence(groups: Mapping[Key, Sequence[Outcome]], definitions: Definitions) -> Evidence:
    """What the runs of one reading say, with the metrics as these definitions mean them."""
    facts = {
        place: [outcome.judged[definitions] for outcome in group] for place, group in groups.items()
    }
    return Evidence(facts, definitions)


def _verdicts(job: tuple[Evidence, bool]) -> list[Verdict]:
    """The verdicts on one reading's evidence, in a process of its own."""
    evidence, fitted = job
    return judge(evidence, fitted)


def _draw(job: tuple[Path, str]) -> None:
    """Draws one figure, in a process of its own: the first one does not wait for matplotlib."""
    from genie_sim.paper import paper_figures

    paper_figures.save(*job)


def _rows(judged: Judged, arms: Arms | None) -> Iterator[dict[str, Any]]:
    """Each verdict as plain data."""
    arms = arms if judged.reading.name == DEFAULT else None
    plain = [None] * len(judged.verdicts) if judged.plain is None else judged.plain
    for verdict, other in zip(judged.verdicts, plain, strict=True):
        yield verdict_table.row(verdict, arms, judged.reading.name, other)


def _metrics(evidence: Evidence) -> list[dict[str, Any]]:
    """Every fact of the six scenarios and the case study, as a mean over seeds with its 95 %
    interval.
    """
    rows = []
    for scenario in (*ALL, CASE):
        for fact in evidence.facts(scenario):
            values = evidence.of(scenario, fact)
            if not np.isnan(values).all():
                rows.append(_metric(scenario, fact, values[~np.isnan(values)]))
    for answer in ("first", "fresh"):
        average = np.mean(list(improvements(evidence, answer).values()), axis=0)
        rows.append(_metric("all", Fact(f"improvement_{answer}_answer"), average))
    return rows


def _metric(scenario: str, fact: Fact, values: Values) -> dict[str, Any]:
    value, low, high = (rounded(number) for number in interval(values))
    return {
        "scenario": scenario,
        **fact._asdict(),
        "value": value,
        "low": low,
        "high": high,
        "n": len(values),
    }
