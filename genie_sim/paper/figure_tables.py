"""The tables that the evaluation's figures are drawn from, beside its numbers: of the runs of the
first reading, all seeds of each scenario, the columns that a figure needs.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from genie_sim.paper.runs import Outcome
from genie_sim.record import tables
from genie_sim.record.columns import Columns, concat
from genie_sim.record.records import FRAMES, LOOKUPS
from genie_sim.record.tables import Column, Schema

SCENARIO = Column("scenario", "text", "", "the scenario that was simulated")
SEED = Column("seed", "int32", "", "its seed")
DRAWN = {
    FRAMES: ("method", "car", "stamp_ns", "received_ns", "first_answer_ns", "fresh_answer_ns"),
    LOOKUPS: (
        "method",
        "t_ns",
        "genie",
        "placement",
        "kind",
        "requester",
        "requests",
        "hits",
        "updates",
        "boost_sum",
        "entries",
    ),
}
SCHEMAS = {
    of_run.name: Schema(
        f"evaluation_{of_run.name}",
        f"{of_run.description} Of every scenario and seed.",
        (SCENARIO, SEED, *(column for column in of_run.columns if column.name in names)),
    )
    for of_run, names in DRAWN.items()
}
FILES = {name: f"{name}.parquet" for name in SCHEMAS}
FIGURES = (  # by their file names; those that take longest come first
    "latency_cdf",
    "latency_cdf_of_published",
    "confidence_boost",
    "case_study",
    "object_reuse",
    "image_reuse",
    "worth",
)

# by scenario, of each seed the tables by name
Tables = Mapping[str, Sequence[Mapping[str, Columns]]]


def write(folder: Path, runs: Mapping[str, Sequence[Outcome]], seeds: Sequence[int]) -> None:
    """Writes the tables of runs that are shown, by scenario and in the order of the seeds. Raises
    OSError.
    """
    for name, schema in SCHEMAS.items():
        wanted = [column.name for column in schema.columns[2:]]
        parts = []
        for scenario, outcomes in runs.items():
            for seed, outcome in zip(seeds, outcomes, strict=True):
                table = outcome.tables[name]
                columns = Columns({column: table[column] for column in wanted})
                parts.append(columns.assign(scenario=scenario, seed=np.full(len(table), seed)))
        tables.write(folder / FILES[name], schema, concat(parts))


def read(folder: Path) -> Tables:
    """The tables of an evaluation, each seed's rows in their order. Raises ``UserError``."""
    found: dict[str, dict[int, dict[str, Columns]]] = {}
    for name, schema in SCHEMAS.items():
        for scenario, rows in tables.read(folder / FILES[name], schema).groups("scenario"):
            for seed in np.unique(rows["seed"]).tolist():
                of_seed = found.setdefault(scenario, {}).setdefault(seed, {})
                of_seed[name] = rows.rows(rows["seed"] == seed)
    return {
        scenario: [of_seeds[seed] for seed in sorted(of_seeds)]
        for scenario, of_seeds in found.items()
    }
