"""The numbers of each run of an evaluation. A later run of the same scenario and seed is compared
with them, and the claims can be judged again from them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from genie_sim.paper.facts import Fact, Facts
from genie_sim.record import tables
from genie_sim.record.tables import Column, Schema, Table

FILE = "seeds.parquet"
RELATIVE = 1e-6  # sums of floats may end differently on another machine
KEYS = ("reading", "variant", "scenario", *Fact._fields)
SCHEMA = Schema(
    "evaluation_seeds",
    "A number of a run of the evaluation, under a reading of the paper.",
    (
        Column("reading", "text", "", "the reading of the paper"),
        Column("variant", "text", "", "what was changed for some claims, or base"),
        Column("scenario", "text", "", "the scenario that was simulated"),
        Column("metric", "text", "", "as in the metrics of a run, or the evaluation's own"),
        Column("method", "text", "", "the method"),
        Column("placement", "text", "", "car, edge or all"),
        Column("component", "text", "", "a baseline, a car, an edge, a Genie or a lap, or empty"),
        Column("seed", "int32", "", "the seed"),
        Column("value", "float64", "", "NaN where it is not defined"),
    ),
)

Place = tuple[str, str, str]  # reading, variant, scenario


def write(
    folder: Path, seeds: Sequence[int], runs: Iterable[tuple[Place, Sequence[Facts]]]
) -> None:
    """Writes the numbers of runs: at each place of every seed. Raises OSError."""
    table = Table(SCHEMA)
    for place, of_seeds in runs:
        for seed, facts in zip(seeds, of_seeds, strict=True):
            for fact, value in sorted(facts.items()):
                table.append((*place, *fact, seed, value))
    table.write(folder / FILE)


def read(folder: Path) -> dict[Place, dict[int, Facts]]:
    """The numbers of an evaluation, by place and seed. Raises ``UserError``."""
    rows = tables.read(folder / FILE, SCHEMA)
    keys = zip(*(rows[name].tolist() for name in KEYS), strict=True)
    found: dict[Place, dict[int, Facts]] = {}
    for (reading, variant, scenario, *fact), seed, value in zip(
        keys, rows["seed"].tolist(), rows["value"].tolist(), strict=True
    ):
        of_place = found.setdefault((reading, variant, scenario), {})
        of_place.setdefault(seed, {})[Fact(*fact)] = value
    return found


def differences(committed: Mapping[Fact, float], found: Mapping[Fact, float]) -> list[str]:
    """The numbers that one has and the other has not, or that differ."""
    lines = [str(fact) for fact in sorted(committed.keys() ^ found.keys())]
    for fact in sorted(committed.keys() & found.keys()):
        one, other = committed[fact], found[fact]
        same = math.isclose(one, other, rel_tol=RELATIVE, abs_tol=1e-12)
        if not (same or (math.isnan(one) and math.isnan(other))):
            lines.append(f"{fact}: {one:g} is now {other:g}")
    return lines
