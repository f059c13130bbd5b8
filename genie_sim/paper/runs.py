"""The runs of the paper's evaluation: its scenarios, with a seed, and the variants that claims
need. Each is kept when it is done, so that an evaluation that was interrupted goes on.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.base.errors import UserError
from genie_sim.base.paths import atomic_write
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.paper import curves, numbers, sources
from genie_sim.paper.checks import ALL, CASE, HO, SHARED
from genie_sim.paper.curves import Key, Points
from genie_sim.paper.evidence import BASE
from genie_sim.paper.numbers import METHODS, Number
from genie_sim.paper.watch import WorldObserver
from genie_sim.record import provenance
from genie_sim.record.results import MetricValue
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.study.work import Parts, PointRun

if TYPE_CHECKING:
    import pandas as pd

CUT_S = 2.5  # when the links are cut
EVERY_METHOD = tuple(method.name for method in METHODS)
# What claims need, with as many seeds each: variant -> (scenarios, settings, methods).
VARIANTS: Mapping[str, tuple[Sequence[str], Sequence[str], Sequence[str]]] = {
    BASE: ((*ALL, CASE), (), EVERY_METHOD),
    "no_edge_sharing": (
        SHARED,
        ("genie.share_requests=false", "genie.share_answers=on_request"),
        ("genie",),
    ),
    "cut_link": (
        HO[:1],
        (f"faults=[{{fault: outage, target: car1, begin: {CUT_S} s}}]",),
        ("local", "genie"),
    ),
}


@dataclass(frozen=True, slots=True)
class EvaluationRun(PointRun):
    """A scenario of the paper with one seed, under a variant."""

    variant: str = BASE

    def measure(self, study: Path) -> Sequence[MetricValue]:
        """All numbers of the run. Its curves go beside the parts. Raises ``UserError``."""
        observer = WorldObserver(self.scenario.genie)
        run = run_in_memory(self.scenario, observer=observer)
        if self.variant == BASE:
            path = self.curves(study)
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as beside:
                curves.write(beside, curves.of_run(self.scenario.name, run.tables))
        run_numbers = numbers.of_run(run) | observer.numbers()
        return [
            MetricValue(*number, None if math.isnan(value) else float(value), "")
            for number, value in run_numbers.items()
        ]

    def curves(self, study: Path) -> Path:
        """The file of its curves. Raises ``UserError`` where a link leads elsewhere."""
        return provenance.contained(study, f"curves/{self.run_id}.parquet")

    def is_kept(self, study: Path) -> bool:
        """Whether its curves are there, or it has none."""
        if self.variant != BASE:
            return True
        try:
            return bool(curves.read(self.curves(study)))
        except UserError:
            return False


def planned(seeds: Sequence[int]) -> list[EvaluationRun]:
    """Every run that the claims need. Raises ``UserError``."""
    digests = sources.digests()
    runs = []
    for variant, (names, settings, methods) in VARIANTS.items():
        for name in names:
            for seed in seeds:
                scenario = load_scenario(name, settings, seed=seed, methods=methods)
                identity = json.dumps([plain_data(scenario), digests], sort_keys=True, default=str)
                run_id = hashlib.sha256(identity.encode()).hexdigest()[:12]
                place = f"{name}, {variant}, seed {seed}"
                runs.append(EvaluationRun(run_id, scenario, place, variant=variant))
    return runs


def simulate(
    runs: Sequence[EvaluationRun], store: Path, workers: int, progress: Progress | None = None
) -> "tuple[pd.DataFrame, dict[Key, Points]]":
    """Simulates what is not in ``store`` yet. Returns the numbers of all runs, with the columns of
    ``numbers.SCHEMA``, and the curves of the base runs over all seeds. Raises ``UserError``.
    """
    import pandas as pd

    parts = Parts(store)
    incomplete = [run.run_id for run in runs if not run.is_kept(store)]
    parts.run(runs, workers, progress, incomplete)
    about = pd.DataFrame(
        [(run.run_id, run.variant, run.scenario.name, run.scenario.seed) for run in runs],
        columns=["run_id", "variant", "scenario", "seed"],
    )
    measured = parts.read([run.run_id for run in runs])[["run_id", *Number._fields, "value"]]
    table = about.merge(measured, on="run_id").drop(columns="run_id")
    of_base = [run for run in runs if run.variant == BASE]
    return table, curves.pooled([curves.read(run.curves(store)) for run in of_base])
