"""Which claims of the paper depend on what it leaves open? One choice is changed at a time.

    python studies/other_readings.py [--seeds 10] [--jobs 2] [--only NAME ...]

Every other reading and value of ``other_readings.yaml`` runs the six scenarios on the seeds of the
evaluation, with the settings of the reading ``street``. A row of
``results/other_readings/claims.csv`` says how much was reused, how long answers took, and of each
claim whether its test holds (``1``), fails (``0``) or cannot be tried (empty: the six scenarios
lack what it needs). What is in the file already is not run again. About 25 minutes on two cores.
"""

import argparse
import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import ResultTable
from genie_sim.base import files
from genie_sim.base.parallel import workers_here
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.paper.checks import ALL, BOTH_IMAGES, BOTH_OBJECTS, load_claims
from genie_sim.paper.claims import look
from genie_sim.paper.evidence import BASE, Evidence, interval, rounded
from genie_sim.paper.facts import Fact
from genie_sim.paper.readings import load_reading
from genie_sim.paper.reproduce import calibrated_settings, declared_seeds
from genie_sim.paper.runs import EvaluationRun, simulate
from genie_sim.scenario.yaml_input import read_mapping

OUT = Path("results/other_readings")
MEASURES = {
    "object_reuse": BOTH_OBJECTS,
    "image_reuse": BOTH_IMAGES,
    "first_answer_ms": (Fact("first_answer_mean"),),
    "result_answer_ms": (Fact("result_answer_mean"),),
}
CLAIMS = [claim for claim in load_claims() if claim.kind != "table"]
COLUMNS = (
    "name",
    "plausible",
    "seeds",
    *(f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")),
    *(claim.id for claim in CLAIMS),
)


def street_settings() -> tuple[str, ...]:
    """What every arm changes one thing of."""
    return load_reading("street").settings(calibrated_settings())


Arm = tuple[str, str, tuple[str, ...]]  # name, whether it is plausible, settings


def arms(folder: Path) -> Iterator[Arm]:
    """What is tried; first the evaluation as it is. Filtered traces go into the folder."""
    design = read_mapping(Path(__file__).with_suffix(".yaml"))
    yield "as it is", "yes", ()
    for variant in design["variants"]:
        yield variant["name"], variant["plausible"], tuple(variant["set"])
    for sweep in design["sweeps"]:
        low, high = sweep["plausible"]
        for value in sweep["values"]:
            plausible = "yes" if low <= value <= high else "no"
            if sweep["set"] == "trace":
                path = folder / f"{sweep['name']}_{value}.parquet"
                if not path.exists():
                    write_trace(path, filtered(sweep["name"], value))
                setting = f"perception.trace={path}"
            else:
                setting = sweep["set"].format(value)
            yield f"{sweep['name']}={value:g}", plausible, (setting,)


def filtered(name: str, value: float) -> Trace:
    """The shipped trace without weak detections, or with every n-th frame of its 10 Hz."""
    whole = read_trace(files.find(files.TRACE, "kitti_0005"))
    if name == "min_score":
        return whole.at_least(value)
    frames = {camera: of_camera[:: round(10 / value)] for camera, of_camera in whole.frames.items()}
    provenance = {key: about for key, about in whole.provenance.items() if key != "features"}
    return replace(whole, frames=frames, provenance=provenance)


def row_of(arm: Arm, seeds: Sequence[int], jobs: int) -> dict[str, Any]:
    """Runs a reading or value: its line of the table."""
    name, plausible, settings = arm
    places = [(scenario, seed) for scenario in ALL for seed in seeds]
    every = (*street_settings(), *settings)
    outcomes = simulate([EvaluationRun(*place, every) for place in places], jobs)
    evidence = Evidence(
        {(BASE, scenario): [next(outcomes).facts for _ in seeds] for scenario in ALL}
    )
    row: dict[str, Any] = {"name": name, "plausible": plausible, "seeds": len(seeds)}
    for measure, facts in MEASURES.items():
        ends = map(rounded, interval(evidence.mean_of(ALL, facts)))
        row |= zip((measure, f"{measure}_low", f"{measure}_high"), ends, strict=True)
    with np.errstate(all="ignore"):  # a ratio to nothing is no number
        for claim in CLAIMS:
            finding = look(claim, evidence)
            known = finding is not None and finding.known
            row[claim.id] = int(finding.holds) if finding and known else ""
    return row


def tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """What holds under each reading or value, and under which each claim holds, in Markdown."""
    of_arms = [
        [
            row["name"],
            row["plausible"],
            str(sum(str(row[claim.id]) == "1" for claim in CLAIMS)),
            *(f"{float(row[name]):.3g}" for name in MEASURES),
        ]
        for row in rows
    ]
    of_claims = []
    for claim in CLAIMS:
        tried = [row for row in rows[1:] if str(row[claim.id]) != ""]
        holds = [row["name"] for row in tried if str(row[claim.id]) == "1"]
        of_claims.append([claim.id, f"{len(holds)} of {len(tried)}", ", ".join(holds)])
    headings = ["reading or value", "plausible", "claims that hold", *MEASURES]
    under = ["claim", "holds under", "which"]
    found = ResultTable.of_texts(headings, of_arms), ResultTable.of_texts(under, of_claims)
    return "\n".join(map(renderers.markdown, found)).rstrip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=len(declared_seeds()))
    parser.add_argument("--jobs", type=int, default=workers_here())
    parser.add_argument("--only", nargs="*", metavar="NAME", help="these readings and values")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    (options.out / "traces").mkdir(parents=True, exist_ok=True)
    path = options.out / "claims.csv"
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with path.open(newline="", encoding="utf-8") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    done = {row["name"] for row in rows}
    for arm in arms(options.out / "traces"):
        if arm[0] in done or (options.only and arm[0] not in options.only):
            continue
        rows.append(row_of(arm, declared_seeds()[: options.seeds], options.jobs))
        with path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(rows[-1])
    print(tables(rows))


if __name__ == "__main__":
    main()
