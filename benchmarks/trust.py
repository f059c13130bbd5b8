"""What do lies cost, and what do defences? The study of docs/trust.md.

    python -m benchmarks.trust run [SEED ...]
    python -m benchmarks.trust show

``run`` simulates the attacks on the town of the scenario ``lying_car`` with every seed and writes
``results/trust/points.csv`` after each of them; what is there already is not simulated again.
``show`` prints the tables of the page.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim import runner
from genie_sim.analysis.attacks import of_attacks
from genie_sim.analysis.metrics import compute
from genie_sim.perception.sources import Frames
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import MethodInfo
from genie_sim.scenario.scenario import load_scenario

RESULTS = Path(__file__).parents[1] / "results/trust/points.csv"
KINDS = ("spoof", "remove", "shift", "replay", "inflate")
SETTINGS = {"spoof": "moves: true", "replay": "delay: 1 s"}
SHARE, SHARES = 0.25, (0.125, 0.25, 0.5)
EDGE = "edge_0_0"
TIMES = "begin: 1.5 s, end: 4 s"
DEFENCES = {
    "none": "{}",
    "corroborate": "{defence: corroborate}",
    "reputation": "{defence: reputation}",
    "guarded": "{defence: guarded, signed: true}",
    "strict": "{defence: {name: guarded, misses: 1}, signed: true}",
}
MAX_POISON, MAX_RECALL = 1.2, 0.03  # the target: times the clean value, and share
USUAL = {
    "object_recall": "recall",
    "ghost_share": "ghosts",
    "bytes_up_per_frame": "bytes_up",
    "bytes_down_per_frame": "bytes_down",
}
COLUMNS = (
    "seed",
    "attacker",
    "attack",
    "share",
    "defence",
    "recall",
    "ghosts",
    "bytes_up",
    "bytes_down",
    "poisoned",
    "poisoned_clean",
    "suppressed",
    "suppressed_clean",
    "spread",
)
Row = dict[str, Any]


def fault(kind: str, where: str, applied: bool = True) -> str:
    """An attack in YAML."""
    more = f", {SETTINGS[kind]}" if kind in SETTINGS else ""
    return f"{{fault: {kind}, {where}, {TIMES}, applied: {str(applied).lower()}{more}}}"


def attacks() -> Iterator[tuple[str, str, float | None]]:
    """Attacker, kind and share of all attacks of the study."""
    for kind in KINDS:
        for share in SHARES if kind == "spoof" else (SHARE,):
            yield "cars", kind, share
    for kind in KINDS:
        yield "edge", kind, None


def simulated(faults: Sequence[str], seed: int, frames: Frames | None) -> tuple[Any, Any]:
    """The tables of a run with these faults under every defence, and what it was made of."""
    entries = [
        f"{{name: {name}, method: genie, genie: {{algorithm: recommended, looks: {looks}}}}}"
        for name, looks in DEFENCES.items()
    ]
    overrides = [f"methods=[{', '.join(entries)}]", f"faults=[{', '.join(faults)}]"]
    scenario = replace(load_scenario("lying_car", overrides), seed=seed)
    prepared = runner.prepare(scenario) if frames is None else runner.on_frames(scenario, frames)
    tables = runner.simulate(prepared)
    return {name: table.columns() for name, table in tables.items()}, prepared


def usual_metrics(tables: dict[str, Columns], methods: Sequence[MethodInfo]) -> dict[str, Row]:
    """Recall, ghosts and bytes of every defence."""
    rows: dict[str, Row] = {method.name: {} for method in methods}
    few = {name: tables[name] for name in ("frames", "hosts", "power", "held")}
    for metric in compute(methods, few, intervals=False):
        if metric.metric in USUAL and metric.placement == "all" and not metric.component:
            rows[metric.method][USUAL[metric.metric]] = metric.value
    return rows


def poison(tables: dict[str, Columns], forgeries: Columns) -> dict[str, Row]:
    """What others hold of these forgeries under every defence."""
    rows: dict[str, Row] = {name: {} for name in DEFENCES}
    for metric in of_attacks(forgeries, tables["held"], tables["held_objects"], list(DEFENCES)):
        if metric.component == "others":
            rows[metric.method][metric.metric] = metric.value
    return rows


def of_attackers(forgeries: Columns, kind: str, attackers: set[str]) -> Columns:
    """The forgeries of a kind by these attackers."""
    chosen = np.array([name in attackers for name in forgeries["attacker"].tolist()], dtype=bool)
    return forgeries.rows(chosen).where(attack=kind)


def run(seed: int) -> None:
    """Every attack of one seed, and the run without any."""
    done = {(row["seed"], row["attacker"], row["attack"], row["share"]) for row in read()}
    dry = [
        fault(kind, where, applied=False)
        for where in (f"share: {max(SHARES)}", f"target: {EDGE}")
        for kind in KINDS
    ]
    clean, prepared = simulated(dry, seed, None)
    methods, frames = runner.methods_of(prepared), prepared.frames
    if (str(seed), "nobody", "", "") not in done:
        of_clean = usual_metrics(clean, methods)
        nobody = {"seed": seed, "attacker": "nobody", "attack": "", "share": None}
        write([row(nobody, name, of_clean[name]) for name in DEFENCES])
    for attacker, kind, share in attacks():
        if (str(seed), attacker, kind, "" if share is None else str(share)) in done:
            continue
        where = f"target: {EDGE}" if share is None else f"share: {share}"
        tables, _ = simulated([fault(kind, where)], seed, frames)
        attackers = set(tables["faults"]["target"].tolist()[0].split(", "))
        values = usual_metrics(tables, methods)
        attacked = poison(tables, tables["attacks"])
        without = poison(clean, of_attackers(clean["attacks"], kind, attackers))
        for name in DEFENCES:
            values[name] |= {
                "poisoned": attacked[name].get("poisoned_objects"),
                "poisoned_clean": without[name].get("poisoned_objects"),
                "suppressed": attacked[name].get("suppressed_objects"),
                "suppressed_clean": without[name].get("suppressed_objects"),
                "spread": attacked[name].get("poison_spread"),
            }
        attack = {"seed": seed, "attacker": attacker, "attack": kind, "share": share}
        write([row(attack, name, values[name]) for name in DEFENCES])


def row(where: Row, defence: str, values: Row) -> Row:
    """A row of the table: seed, attacker, attack and share, and what was measured under a
    defence.
    """
    short = {
        name: None if value is None else f"{float(value):.6g}" for name, value in values.items()
    }
    return {**where, "defence": defence, **short}


def read() -> list[dict[str, str]]:
    """The rows that there are."""
    if not RESULTS.exists():
        return []
    with RESULTS.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write(rows: Sequence[Row]) -> None:
    """Adds rows at the end."""
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    is_new = not RESULTS.exists()
    with RESULTS.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if is_new:
            writer.writeheader()
        writer.writerows(rows)


def means(rows: Sequence[dict[str, str]], column: str, **where: str) -> float | None:
    """The mean of a column over the seeds; ``None`` if it is empty."""
    values = [
        float(item[column])
        for item in rows
        if item[column] and all(item[name] == value for name, value in where.items())
    ]
    return sum(values) / len(values) if values else None


def price_table(rows: Sequence[dict[str, str]]) -> Iterator[list[str]]:
    """What each defence costs where nobody attacks, line by line; bold: within the target."""
    before = means(rows, "recall", attacker="nobody", defence="none")
    assert before is not None
    for name in DEFENCES:
        where = {"attacker": "nobody", "defence": name}
        columns = ("recall", "ghosts", "bytes_up", "bytes_down")
        recall, ghosts, up, down = (means(rows, column, **where) or 0.0 for column in columns)
        cell = bold(f"{100 * recall:.2f}", within=before - recall <= MAX_RECALL)
        yield [name, cell, f"{100 * ghosts:.2f}", f"{up:,.0f}", f"{down:,.0f}"]


def attack_table(rows: Sequence[dict[str, str]], column: str) -> Iterator[list[str]]:
    """Objects at others in every attack that had any, line by line: the clean value, and under each
    defence; bold: within the target.
    """
    for attacker, kind, share in attacks():
        where = {"attacker": attacker, "attack": kind, "share": "" if share is None else str(share)}
        clean = means(rows, f"{column}_clean", defence="none", **where)
        values = [means(rows, column, defence=name, **where) for name in DEFENCES]
        if clean is None or not any(values):
            continue
        who = EDGE if share is None else f"{share:.3g} of the cars"
        cells = [
            "-" if value is None else bold(f"{value:.4f}", within=value <= MAX_POISON * clean)
            for value in values
        ]
        yield [f"{kind}, {who}", f"{clean:.4f}", *cells]


def poison_table(rows: Sequence[dict[str, str]]) -> Iterator[list[str]]:
    """Poisoned objects."""
    return attack_table(rows, "poisoned")


def suppressed_table(rows: Sequence[dict[str, str]]) -> Iterator[list[str]]:
    """Suppressed objects."""
    return attack_table(rows, "suppressed")


def bold(text: str, *, within: bool) -> str:
    """A cell in Markdown."""
    return f"**{text}**" if within else text


def show() -> None:
    """Prints the tables of the page."""
    rows = read()
    for table in (price_table, poison_table, suppressed_table):
        for cells in table(rows):
            print(f"| {' | '.join(cells)} |")
        print()


if __name__ == "__main__":
    what, *seeds = sys.argv[1:]
    if what == "show":
        show()
    for text in seeds:
        run(int(text))
