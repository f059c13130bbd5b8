"""The paper's whole evaluation: calibration, replicated runs, ablations, sweeps, verdicts and figures in one folder.

Nothing here decides anything: assumptions.yaml does, before; claims.yaml says what is tested.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim import report
from genie_sim.paper import drives, quality, verdict_table
from genie_sim.paper import page as evaluation
from genie_sim.paper.arms import Arms, arms_of, run_arms
from genie_sim.paper.assumptions import Assumptions, load_assumptions
from genie_sim.paper.calibrate import Calibration, calibrate, most_jobs
from genie_sim.paper.checks import ALL, CASE, HE, HO, SHARED, improvements
from genie_sim.paper.claims import Verdict, judge
from genie_sim.paper.evidence import Evidence, Values, interval
from genie_sim.paper.facts import Facts
from genie_sim.paper.replicate import Job, Outcome, Progress, TimeLeft, prepare_job, run_jobs
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import read_mapping

QUICK_SEEDS = 4

# Runs that single claims need besides the six scenarios, with as many seeds: variant -> (scenarios, settings).
FOR_CLAIMS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "base": ((CASE,), ()),
    "ideal_link": ((HE[0],), ("links=ideal",)),
    "no_edge_sharing": (SHARED, ("genie.share_requests=false", "genie.share_answers=on_request")),
    "two_laps": ((HO[0], HE[0]), ("laps=2",)),
    "cut_link": ((HO[0],), ("link=cut",)),
}

Key = tuple[str, str]  # variant, scenario


@dataclass(frozen=True)
class Reproduction:
    """A finished evaluation; ``drives`` is the table of the claims on other drives, where it was wanted."""

    folder: Path
    verdicts: list[Verdict]
    wall_time_s: float
    drives: str = ""


def reproduce(
    out: Path, quick: bool = False, seeds: int | None = None, workers: int | None = None,
    progress: Progress | None = None, with_drives: bool = False,
) -> Reproduction:  # fmt: skip
    """Runs the evaluation and puts everything into ``out``, which appears when it is complete.

    ``quick``: few seeds, the calibration of the last full run, no variants and sweeps. ``seeds``: how many, instead of
    those of assumptions.yaml. ``with_drives``: the main claims on every sequence of KITTI's tracking benchmark, too.
    Raises ``UserError`` where ``out`` cannot be written, or where there are no such sequences.
    """
    provenance.check_writable(out.parent)
    provenance.check_replaceable(out)
    on_drives = drives.jobs() if with_drives else []
    assumptions = load_assumptions()
    workers = workers or os.cpu_count() or 1
    used_seeds = _seeds(assumptions, quick, seeds)
    tell = TimeLeft(_total(assumptions, quick, len(used_seeds)) + len(on_drives), progress)
    fitted = None if quick else calibrate(assumptions, workers, tell)
    settings = (*assumptions.settings, *(last_calibration() if fitted is None else fitted.best.settings))
    runs, tables = _base_runs(settings, used_seeds, workers, tell)
    base = {scenario: runs["base", scenario] for scenario in ALL}
    evidence = Evidence(runs)
    made = _Evaluation(
        settings,
        used_seeds,
        evidence,
        judge(evidence),
        tables,
        fitted,
        None if quick else run_arms(assumptions, settings, used_seeds, base, workers, tell),
        quality.summarise(evidence, ALL),
    )
    driven = drives.run_drives(on_drives, workers, tell) if on_drives else []
    with provenance.result_folder(out) as folder:
        made.write(folder)
        table = drives.write(folder, driven) if driven else ""
        made.draw(folder / "figures")
        wall_time_s = time.perf_counter() - tell.began_s
        about = {"quick": quick, "workers": workers, "wall_time_s": round(wall_time_s, 1), **made.provenance()}
        provenance.write_json(folder / "run.json", about)
        evaluation.write(folder / report.NAME, folder)
    return Reproduction(out, made.verdicts, wall_time_s, table)


def last_calibration() -> tuple[str, ...]:
    """The fitted parameters of the last full run, as settings."""
    path = Path(__file__).with_name("calibrated.yaml")
    return tuple(f"{name}={value:g}" for name, value in read_mapping(path).items())


@dataclass(frozen=True)
class _Evaluation:
    """Everything that came out; ``arms`` is ``None`` in a quick one."""

    settings: tuple[str, ...]
    seeds: tuple[int, ...]
    evidence: Evidence
    verdicts: list[Verdict]
    tables: Mapping[str, Sequence[Outcome]]
    fitted: Calibration | None
    arms: Arms | None
    worth: list[dict[str, Any]]

    def write(self, folder: Path) -> None:
        """Everything but figures and page. Raises OSError."""
        rows = [verdict_table.row(verdict, self.arms) for verdict in self.verdicts]
        provenance.write_json(folder / "verdicts.json", rows)
        text = verdict_table.document(rows, self.settings, self.worth)
        (folder / "verdicts.md").write_text(text, encoding="utf-8")
        provenance.write_json(folder / "metrics.json", _metrics(self.evidence))
        provenance.write_json(folder / "quality.json", self.worth)
        if self.fitted is not None:
            provenance.write_json(folder / "calibration.json", self.fitted.as_json())
        if self.arms is not None:
            provenance.write_json(folder / "sensitivity.json", self.arms.as_json())

    def draw(self, folder: Path) -> None:
        """The figures. Raises OSError."""
        from genie_sim.paper.paper_figures import draw_paper_figures
        from genie_sim.paper.sensitivity import draw_sensitivity

        folder.mkdir()
        footer = f"genie-sim reproduce, {', '.join(self.settings)}, {len(self.seeds)} seeds"
        draw_paper_figures(folder, self.tables, footer)
        sweeps = self.arms.sweeps if self.arms is not None else []
        draw_sensitivity(folder, self.fitted, sweeps, self.worth, load_assumptions().targets, footer)

    def provenance(self) -> dict[str, Any]:
        """For ``run.json``: what the numbers come from."""
        here = Path(__file__).parent
        inputs = ("assumptions.yaml", "claims.yaml")
        return {
            "settings": list(self.settings),
            "seeds": list(self.seeds),
            "calibration": "searched" if self.fitted else "that of the last full run (calibrated.yaml)",
            "inputs": {name: hashlib.sha256((here / name).read_bytes()).hexdigest() for name in inputs},
            "trace": next(iter(prepare_job(Job(ALL[0], 1)).frames.digests().values())),
            **provenance.environment(),
        }


def _seeds(assumptions: Assumptions, quick: bool, seeds: int | None) -> tuple[int, ...]:
    if seeds is not None:
        return tuple(range(1, seeds + 1))
    return assumptions.seeds[:QUICK_SEEDS] if quick else assumptions.seeds


def _total(assumptions: Assumptions, quick: bool, seeds: int) -> int:
    """How many runs there will be, about."""
    base = seeds * (len(ALL) + sum(len(scenarios) for scenarios, _ in FOR_CLAIMS.values()))
    if quick:
        return base
    return base + most_jobs(assumptions) + len(list(arms_of(assumptions))) * len(ALL) * seeds


def _base_runs(
    settings: tuple[str, ...], seeds: Sequence[int], workers: int, progress: Progress
) -> tuple[dict[Key, list[Facts]], dict[str, list[Outcome]]]:
    """Facts of all runs that the claims need, and the tables of the base runs by scenario."""
    places: list[Key] = [("base", scenario) for scenario in ALL]
    places += [(variant, scenario) for variant, (scenarios, _) in FOR_CLAIMS.items() for scenario in scenarios]
    jobs = []
    for variant, scenario in places:
        more = FOR_CLAIMS[variant][1]
        base = variant == "base"
        jobs += [Job(scenario, seed, (*settings, *more), keep_tables=base, judged=base) for seed in seeds]
    outcomes = iter(run_jobs(jobs, workers, progress, "claims"))
    grouped = {place: [next(outcomes) for _ in seeds] for place in places}
    facts = {place: [outcome.facts for outcome in group] for place, group in grouped.items()}
    return facts, {scenario: group for (variant, scenario), group in grouped.items() if variant == "base"}


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
    return {"scenario": scenario, "name": name, "value": value, "low": low, "high": high, "n": len(values)}

