"""Which claims of the paper hold where, over all that it leaves open, and which exclude each other?

    python studies/contradictions.py [--points 320] [--jobs 2]

``contradictions.yaml`` says what is drawn and what is asked; it is older than any result. Each
point is a row of ``results/contradictions/points.csv``: its level of every choice, and of each
claim whether it holds (``1``), fails (``0``) or cannot be tried (empty). Points that are in the
file are not run again; more of them begin with the same, so with all 320 there it only prints the
tables. All of them take about an hour on two cores.
"""

import argparse
import csv
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import qmc

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import ResultTable
from genie_sim.base.parallel import workers_here
from genie_sim.paper.checks import load_claims
from genie_sim.paper.claims import look
from genie_sim.paper.definitions import CHOICES, Definitions
from genie_sim.paper.evidence import Evidence
from genie_sim.paper.readings import load_reading
from genie_sim.paper.reproduce import facts_of, outcomes_of, runs_of
from genie_sim.scenario.yaml_input import read_mapping

OUT = Path("results/contradictions")
DESIGN = read_mapping(Path(__file__).with_suffix(".yaml"))
# of each choice, and of each metric's definition, the levels, the default's first
LEVELS = {name: list(levels) for name, levels in DESIGN["choices"].items()} | {
    f"metric {metric}": list(CHOICES[metric]) for metric in DESIGN["metrics"]
}
CLAIMS = [claim for claim in load_claims() if claim.kind != "table"]
NAMES = [claim.id for claim in CLAIMS]
DRIVERS, MIN_SHARE = 3, 0.05  # how many choices are named for a claim, from which share on
SELDOM = 0.25  # of the points expected: claims that hold together no more often are named

Point = dict[str, str]  # choice -> level
Values = np.ndarray[Any, np.dtype[np.float64]]  # one per point, NaN where a claim cannot be tried


# What is run


def points(count: int) -> list[Point]:
    """The first points of the design. More of them begin with the same."""
    sobol = qmc.Sobol(len(LEVELS), scramble=True, rng=DESIGN["sequence"])
    drawn = sobol.random_base2(max(count - 1, 1).bit_length())[:count]
    return [
        {
            name: levels[int(u * len(levels))]
            for (name, levels), u in zip(LEVELS.items(), row, strict=True)
        }
        for row in drawn
    ]


def definitions_of(point: Point) -> Definitions:
    chosen: dict[str, Any] = {metric: point[f"metric {metric}"] for metric in DESIGN["metrics"]}
    return Definitions(**chosen)


def settings_of(point: Point) -> tuple[str, ...]:
    choices = DESIGN["choices"]
    chosen = (setting for name in choices for setting in choices[name][point[name]])
    return *load_reading("street").settings(()), *chosen


def row_of(number: int, point: Point, jobs: int) -> dict[str, str]:
    """Runs a point on a seed of its own: its line of the table."""
    seed, definitions = DESIGN["first_seed"] + number, definitions_of(point)
    (outcomes,) = outcomes_of([runs_of(settings_of(point), [seed])], jobs)
    evidence, row = Evidence(facts_of(outcomes), definitions), {"point": str(number), **point}
    with np.errstate(all="ignore"):  # a ratio to nothing is no number
        for claim in CLAIMS:
            finding = look(claim, evidence)
            row[claim.id] = str(int(finding.holds)) if finding and finding.known else ""
    return row


# What the points say


def drivers_of(outcomes: Values, drawn: pd.DataFrame) -> dict[str, tuple[float, dict[str, float]]]:
    """The choices that explain most of a claim's variance: the share, and how often the claim holds
    at each level.
    """
    tried = ~np.isnan(outcomes)
    outcomes, drawn = outcomes[tried], drawn[tried]
    if not 0 < outcomes.sum() < len(outcomes):
        return {}
    shares = {name: explained(outcomes, drawn[name].to_numpy()) for name in LEVELS}
    return {
        name: (
            shares[name],
            {level: outcomes[drawn[name] == level].mean() for level in LEVELS[name]},
        )
        for name in sorted(shares, key=lambda name: -shares[name])[:DRIVERS]
        if round(shares[name], 3) >= MIN_SHARE
    }


def explained(outcomes: Values, drawn: np.ndarray[Any, Any]) -> float:
    """The share of variance that a choice explains beyond chance (omega squared), at least 0."""
    groups = [outcomes[drawn == level] for level in np.unique(drawn)]
    if len(groups) == len(outcomes):
        return 0.0  # one point a level tells nothing of chance
    total = float(((outcomes - outcomes.mean()) ** 2).sum())
    within = sum(float(((group - group.mean()) ** 2).sum()) for group in groups)
    noise = within / (len(outcomes) - len(groups))
    return max(0.0, (total - within - (len(groups) - 1) * noise) / (total + noise))


def contradictions(table: Values) -> list[tuple[str, int, float]]:
    """The pairs of claims that hold together much more seldom than chance would have it: both, at
    how many points, and how many were expected; those first that are never together.
    """
    pairs = []
    for i, j in itertools.combinations(range(len(NAMES)), 2):
        both = table[[i, j]][:, ~np.isnan(table[[i, j]]).any(axis=0)]
        if both.size:
            expected, together = both[0].mean() * both[1].sum(), int(both.prod(axis=0).sum())
            if expected >= DESIGN["expected_together"] and together <= SELDOM * expected:
                pairs.append((f"{NAMES[i]} and {NAMES[j]}", together, float(expected)))
    return sorted(pairs, key=lambda pair: (pair[1] > 0, -pair[2]))


def halves(table: Values) -> list[list[str]]:
    """For each half of the claims: how many of the other half hold at the points that are best by
    it, at all points, and, as a 95 % interval, at as many points drawn at random.
    """
    best = min(DESIGN["best"], table.shape[1])
    scores = {
        name: np.nanmean(table[[NAMES.index(claim) for claim in claims]], axis=0)
        for name, claims in DESIGN["halves"].items()
    }
    rows = []
    for by, against in itertools.permutations(scores, 2):
        chosen = np.argsort(-scores[by], kind="stable")[:best]
        own, other = scores[by], scores[against]
        half = 1.96 * float(other.std(ddof=1)) * np.sqrt((1 - best / len(other)) / best)
        rows.append(
            [
                by,
                f"{own[chosen].mean():.0%} (all points {own.mean():.0%})",
                f"{other[chosen].mean():.1%}",
                f"{other.mean():.1%}",
                f"{other.mean() - half:.1%} to {other.mean() + half:.1%}",
            ]
        )
    return rows


def tables(rows: Sequence[Mapping[str, str]]) -> str:
    """How often each claim holds and what drives it, what contradicts what, and whether one half of
    the claims predicts the other, in Markdown.
    """
    table = np.array([[float(row[claim] or "nan") for row in rows] for claim in NAMES])
    drawn = pd.DataFrame([{name: row[name] for name in LEVELS} for row in rows])
    claims = []
    for claim, outcomes in zip(NAMES, table, strict=True):
        tried = outcomes[~np.isnan(outcomes)]
        drivers = "; ".join(
            f"{name} ({share:.2f}): "
            + ", ".join(f"{level} {held:.2f}" for level, held in at.items())
            for name, (share, at) in drivers_of(outcomes, drawn).items()
        )
        claims.append([claim, f"{tried.mean():.0%}" if len(tried) else "not tried", drivers])
    pairs = [[pair, str(held), f"{expected:.0f}"] for pair, held, expected in contradictions(table)]
    explains = "what explains most (share of variance): share at each level"
    of_halves = ["best by", "hold of these", "of the other half", "at all points"]
    held = np.nansum(table, axis=0)
    tables = [
        (["claim", "holds at", explains], claims),
        (["claims", "hold together at", "points expected by chance"], pairs),
        ([*of_halves, "95 % of random choices"], halves(table)),
    ]
    text = "\n".join(
        [
            f"{len(rows)} points: at most {held.max():.0f} claims hold at once, "
            f"on average {held.mean():.1f}.\n",
            *(renderers.markdown(ResultTable.of_texts(*each)) for each in tables),
        ]
    )
    return text.rstrip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=DESIGN["points"])
    parser.add_argument("--jobs", type=int, default=workers_here())
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path, columns = options.out / "points.csv", ["point", *LEVELS, *NAMES]
    if not path.exists():
        path.write_text(",".join(columns) + "\n", encoding="utf-8")
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for number, point in enumerate(points(options.points)):
        if number < len(rows):
            if point != {name: rows[number].get(name) for name in LEVELS}:
                raise SystemExit(f"{path}: point {number} is of another design; use another --out")
            continue
        rows.append(row_of(number, point, options.jobs))
        with path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, columns, lineterminator="\n").writerow(rows[-1])
    print(tables(rows[: options.points]))


if __name__ == "__main__":
    main()
