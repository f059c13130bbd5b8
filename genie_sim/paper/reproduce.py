"""The paper's whole evaluation: replicated runs, ablations, verdicts and figures in one folder.

Nothing here decides anything: assumptions.yaml does, before; claims.yaml says what is tested.
"""

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.statistics import wilson
from genie_sim.base.errors import UserError
from genie_sim.base.parallel import in_parallel, workers_here
from genie_sim.base.paths import sha256_of
from genie_sim.base.progress import Progress
from genie_sim.paper import figure_data, page, quality, rows, sources, verdict_table
from genie_sim.paper.checks import ALL, CASE, HE, HO, SHARED, improvements
from genie_sim.paper.claims import Verdict, judge
from genie_sim.paper.definitions import USUAL, Definitions, meant
from genie_sim.paper.evidence import BASE, Evidence, Values, interval, rounded
from genie_sim.paper.facts import Fact, Facts
from genie_sim.paper.readings import MAIN, NAMES, Reading, load_readings
from genie_sim.paper.runs import EVERY_METHOD, EvaluationRun, Outcome, simulate
from genie_sim.paper.sources import ASSUMPTIONS
from genie_sim.record import provenance
from genie_sim.report import html_page
from genie_sim.scenario.yaml_input import read_mapping

log = logging.getLogger(__name__)
QUICK_SEEDS = 2
QUICK_READINGS = (MAIN,)

# What claims need, with as many seeds each: variant -> (scenarios, settings, methods).
VARIANTS: dict[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    BASE: ((*ALL, CASE), (), EVERY_METHOD),
    "ideal_link": ((HE[0],), ("links=ideal",), ("remote", "genie")),
    "no_edge_sharing": (
        SHARED,
        ("genie.share_requests=false", "genie.share_answers=on_request"),
        ("genie",),
    ),
    "two_laps": ((HO[0], HE[0]), ("laps=2",), ("genie",)),
    "cut_link": ((HO[0],), ("link=cut",), ("local", "genie")),
}

Place = tuple[str, str]  # variant, scenario: a ``rows.Place`` of one reading


@dataclass(frozen=True)
class ReadingVerdicts:
    """What the claims come to under one reading: ``verdicts`` by the metrics as it means them, and
    ``plain`` by those of a run, ``None`` where these are the same.
    """

    reading: Reading
    settings: tuple[str, ...]
    evidence: Evidence
    verdicts: list[Verdict]
    plain: list[Verdict] | None


@dataclass(frozen=True)
class Reproduction:
    """A finished evaluation."""

    folder: Path
    wall_time_s: float


def reproduce(
    out: Path,
    *,
    quick: bool = False,
    seeds: int | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    reading: str | None = None,
) -> Reproduction:
    """Runs the evaluation. The result appears when it is complete.

    Parameters
    ----------
    out : Path
        The result folder.
    quick : bool
        Few seeds of the main reading alone.
    seeds : int, optional
        How many seeds, instead of those of assumptions.yaml.
    workers : int, optional
        How many processes; default: one a core.
    progress : callable, optional
        Told how many runs are done, of how many, and of what.
    reading : str, optional
        This one alone, by name or path. Figures and answer quality are those of the first reading.

    Raises
    ------
    UserError
        If ``out`` cannot be written, or a reading does not fit the scenarios.
    """
    provenance.check_writable(out.parent)
    provenance.check_replaceable(out)
    began_s = time.perf_counter()
    edited = sources.edited_set_ups()
    for line in edited:
        log.warning("%s", line)
    readings = load_readings(reading, QUICK_READINGS if quick else NAMES)
    for each in readings:
        check(each)
    workers = workers or workers_here()
    if seeds is not None:
        used_seeds = tuple(range(1, seeds + 1))
    else:
        used_seeds = declared_seeds()[: QUICK_SEEDS if quick else None]
    settings = [each.settings(calibrated_settings()) for each in readings]
    wanted = [
        runs_of(of_reading, used_seeds, shown=number == 0)
        for number, of_reading in enumerate(settings)
    ]
    outcomes = outcomes_of(wanted, workers, progress)
    facts = [facts_of(of_reading) for of_reading in outcomes]
    by_reading = judge_readings(readings, settings, facts, workers)
    tables_shown = {
        scenario: [outcome.tables for outcome in group]
        for (variant, scenario), group in outcomes[0].items()
        if variant == BASE
    }
    answer_quality = quality.summarise(by_reading[0].evidence, ALL)
    with provenance.result_folder(out) as folder:
        _write(folder, by_reading, answer_quality)
        figure_data.write(folder, tables_shown, readings[0].definitions)
        rows.write(folder, used_seeds, _places(readings, facts))
        (folder / "figures").mkdir()
        in_parallel(_draw, [(folder, name) for name in figure_data.FIGURES], workers)
        wall_time_s = time.perf_counter() - began_s
        files = [*page.files_of(folder), figure_data.FILE, rows.FILE]
        about = {
            "quick": quick,
            "workers": workers,
            "wall_time_s": round(wall_time_s, 1),
            "settings": {one.reading.name: list(one.settings) for one in by_reading},
            "seeds": list(used_seeds),
            "edited": edited,
            "sources": sources.digests(),
            "inputs": _inputs(readings),
            "trace": outcomes[0][BASE, ALL[0]][0].trace,
            # the sources say which code it was; a commit is lost where it is rewritten
            **{name: one for name, one in provenance.environment().items() if name != "commit"},
            "digests": provenance.digests(folder, files),
        }
        provenance.write_json(folder / "run.json", about)
        html_page.write_text(folder / html_page.NAME, page.page(folder))
    return Reproduction(out, wall_time_s)


def declared_seeds() -> tuple[int, ...]:
    """The seeds of assumptions.yaml."""
    return tuple(read_mapping(ASSUMPTIONS)["evaluation"]["seeds"])


def calibrated_settings() -> tuple[str, ...]:
    """The two fitted parameters, as settings."""
    path = Path(__file__).with_name("calibrated.yaml")
    return tuple(f"{name}={value:g}" for name, value in read_mapping(path).items())


def check(reading: Reading) -> None:
    """Raises ``UserError`` where a scenario cannot have what the reading sets."""
    for number, choice in enumerate(reading.choices):
        try:
            for scenario in (HE[-1], CASE):
                EvaluationRun(scenario, 1, choice.settings).load()
        except UserError as error:
            raise UserError(f"{reading.path}: choices[{number}].set: {error}") from error


def runs_of(
    settings: tuple[str, ...],
    seeds: Sequence[int],
    *,
    shown: bool = False,
) -> dict[Place, list[EvaluationRun]]:
    """The runs that the claims need under some settings, by variant and scenario. Figures show the
    base runs, where they are ``shown``.
    """
    return {
        (variant, scenario): [
            EvaluationRun(
                scenario,
                seed,
                (*settings, *more),
                methods,
                shown=shown and variant == BASE,
            )
            for seed in seeds
        ]
        for variant, (scenarios, more, methods) in VARIANTS.items()
        for scenario in scenarios
    }


def outcomes_of(
    wanted: Sequence[Mapping[Place, Sequence[EvaluationRun]]],
    workers: int,
    progress: Progress | None = None,
) -> list[dict[Place, list[Outcome]]]:
    """What came out of the runs, arranged as they are. Raises ``UserError``."""
    every = [run for runs in wanted for group in runs.values() for run in group]
    outcomes = iter(simulate(every, workers, progress))
    return [
        {place: [next(outcomes) for _ in group] for place, group in runs.items()} for runs in wanted
    ]


def facts_of(outcomes: Mapping[Place, Sequence[Outcome]]) -> dict[Place, list[Facts]]:
    """The numbers of runs, arranged as they are."""
    return {place: [outcome.facts for outcome in group] for place, group in outcomes.items()}


def judge_readings(
    readings: Sequence[Reading],
    settings: Sequence[tuple[str, ...]],
    facts: Sequence[Mapping[Place, Sequence[Facts]]],
    workers: int,
) -> list[ReadingVerdicts]:
    """The verdicts under each reading, from its settings and the numbers of its runs."""
    evidence = [
        Evidence(of_reading, reading.definitions)
        for reading, of_reading in zip(readings, facts, strict=True)
    ]
    verdicts = in_parallel(_verdicts, list(zip(evidence, readings, strict=True)), workers)
    return [
        ReadingVerdicts(reading, its_settings, evidence=its_evidence, verdicts=judged, plain=plain)
        for reading, its_settings, its_evidence, (judged, plain) in zip(
            readings, settings, evidence, verdicts, strict=True
        )
    ]


def _verdicts(job: tuple[Evidence, Reading]) -> tuple[list[Verdict], list[Verdict] | None]:
    """``verdicts`` and ``plain`` of a reading's ``ReadingVerdicts``, in a process of its own."""
    evidence, reading = job

    def judged(definitions: Definitions) -> list[Verdict]:
        of_meaning = evidence.with_definitions(definitions)
        return judge(of_meaning, bool(reading.fitted), reading.retrodicted)

    own = reading.definitions
    return judged(own), None if own == USUAL else judged(USUAL)


def _write(
    folder: Path, by_reading: Sequence[ReadingVerdicts], answer_quality: list[dict[str, Any]]
) -> None:
    """Writes verdicts, readings, metrics and answer quality. Raises OSError."""
    verdicts = [row for one in by_reading for row in _rows(one)]
    readings = [one.reading.as_json() | {"settings": list(one.settings)} for one in by_reading]
    metrics = [
        {"reading": one.reading.name, **row} for one in by_reading for row in _metrics(one.evidence)
    ]
    for name, content in (
        ("verdicts", verdicts),
        ("readings", readings),
        ("metrics", metrics),
        ("quality", answer_quality),
    ):
        provenance.write_json(folder / f"{name}.json", content)
    document = verdict_table.document(verdicts, readings, answer_quality)
    (folder / "verdicts.md").write_text(document, encoding="utf-8")


def _places(
    readings: Sequence[Reading], facts: Sequence[Mapping[Place, Sequence[Facts]]]
) -> Iterator[tuple[rows.Place, Sequence[Facts]]]:
    """The numbers of each run, by reading, variant and scenario."""
    for reading, of_reading in zip(readings, facts, strict=True):
        for place, of_seeds in of_reading.items():
            yield (reading.name, *place), of_seeds


def _inputs(readings: Sequence[Reading]) -> dict[str, str]:
    """The digests of the files that say what is run and tested, by name."""
    package = Path(__file__).parent
    paths = [ASSUMPTIONS, package / "claims.yaml", *(reading.path for reading in readings)]
    return {
        str(path.relative_to(package)) if path.is_relative_to(package) else path.name: (
            sha256_of(path)
        )
        for path in paths
    }


def _draw(job: tuple[Path, str]) -> None:
    """Draws one figure, in a process of its own: the first one does not wait for matplotlib."""
    from genie_sim.paper import paper_figures

    paper_figures.save(*job)


def _rows(of_reading: ReadingVerdicts) -> Iterator[dict[str, Any]]:
    """Each verdict as plain data."""
    plain = [None] * len(of_reading.verdicts) if of_reading.plain is None else of_reading.plain
    for verdict, other in zip(of_reading.verdicts, plain, strict=True):
        yield verdict_table.row(verdict, of_reading.reading, other)


def _metrics(evidence: Evidence) -> list[dict[str, Any]]:
    """Every fact of the six scenarios and the case study, as a mean over seeds with its 95 %
    interval: what is a metric of a run has the run's name and the run's value.
    """
    plain, found = evidence.with_definitions(USUAL), []
    for scenario in (*ALL, CASE):
        for fact in plain.facts(scenario):
            values = plain.of(scenario, fact)
            if not np.isnan(values).all():
                found.append(_metric(scenario, fact, values[~np.isnan(values)]))
    for answer in ("first", "result"):
        average = np.mean(list(improvements(evidence, answer).values()), axis=0)
        name = meant(f"improvement_{answer}_answer", evidence.definitions)
        found.append(_metric("all", Fact(name), average))
    return found


def _metric(scenario: str, fact: Fact, values: Values) -> dict[str, Any]:
    """A number over seeds, with the interval that several seeds of a run have: of a share
    Wilson's.
    """
    value, low, high = interval(values)
    known = METRICS.get(fact.metric)
    if (
        known is not None
        and known.unit_in_files == "1"
        and not fact.metric.startswith(("confidence_boost", "improvement"))
    ):
        low, high = wilson(value, high - value)
    return {
        "scenario": scenario,
        **fact._asdict(),
        "value": rounded(value),
        "low": rounded(low),
        "high": rounded(high),
        "n": len(values),
    }
