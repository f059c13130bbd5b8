"""Which claims hold where: a space-filling design over the paper's open choices, and what
contradicts what.

``explore.yaml`` says what is drawn and what is asked; it is older than any result. Points that are
in ``points.csv`` are not run again, nor are finished runs of the others, which wait in the folder.
"""

import csv
import functools
import itertools
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.text_table import markdown
from genie_sim.errors import UserError
from genie_sim.paper.checks import ALL, load_claims
from genie_sim.paper.claims import holds_under
from genie_sim.paper.definitions import CHOICES, Definitions
from genie_sim.paper.evaluation_run import EVERY_METHOD, GENIE_ALONE, EvaluationRun
from genie_sim.paper.evidence import BASE, Claim, Evidence, Values
from genie_sim.paper.facts import Facts
from genie_sim.paper.reproduce import FOR_CLAIMS
from genie_sim.paper.runs import simulate
from genie_sim.paths import atomic_write
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.study.parts import Parts, Progress

# Variant, scenarios, settings, methods: as in the evaluation, but without the case study's
# baselines.
RUNS: list[tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = [
    (BASE, ALL, (), EVERY_METHOD)
]
RUNS += [
    (name, of, more, GENIE_ALONE if name == BASE else run)
    for name, (of, more, run) in FOR_CLAIMS.items()
]
Point = dict[str, str]  # choice -> level
# how many choices are named for a claim, and from which share of variance on
DRIVERS, MIN_SHARE = 3, 0.05
# of the points expected: claims that hold together no more often speak against each other
SELDOM = 0.25


@functools.cache
def design() -> dict[str, Any]:
    """What ``explore.yaml`` says."""
    return read_mapping(Path(__file__).with_name("explore.yaml"))


def levels() -> dict[str, list[str]]:
    """Of each choice, and of each metric's definition, the levels, the default's first."""
    definitions = {f"metric {metric}": list(CHOICES[metric]) for metric in design()["metrics"]}
    return {
        name: list(settings_of_levels) for name, settings_of_levels in design()["choices"].items()
    } | definitions


def points(count: int) -> list[Point]:
    """The first points of the design. More of them begin with the same."""
    from scipy.stats import qmc

    names = levels()
    sobol = qmc.Sobol(len(names), scramble=True, rng=design()["sequence"])
    drawn = sobol.random_base2(max(count - 1, 1).bit_length())[:count]
    return [
        {
            name: levels_of_choice[int(u * len(levels_of_choice))]
            for (name, levels_of_choice), u in zip(names.items(), row, strict=True)
        }
        for row in drawn
    ]


def runs_of(number: int, point: Point) -> dict[tuple[str, str], EvaluationRun]:
    """The runs of a point by variant and scenario, all with the point's own seed."""
    choices = design()["choices"]
    settings = tuple(
        setting for name, of_levels in choices.items() for setting in of_levels[point[name]]
    )
    return {
        (variant, scenario): EvaluationRun(
            scenario,
            design()["first_seed"] + number,
            (*settings, *more),
            methods,
            definitions=(_definitions(point),),
        )
        for variant, scenarios, more, methods in RUNS
        for scenario in scenarios
    }


def _definitions(point: Point) -> Definitions:
    """What the point means by the metrics."""
    chosen: dict[str, Any] = {metric: point[f"metric {metric}"] for metric in design()["metrics"]}
    return Definitions(**chosen)


def judged(number: int, point: Point, facts: Mapping[tuple[str, str], Facts]) -> dict[str, str]:
    """A point's line in ``points.csv``: of each claim ``1`` if it holds, ``0`` if not, empty where
    it cannot be tried.
    """
    evidence = Evidence({place: [of_run] for place, of_run in facts.items()}, _definitions(point))
    row = {"point": str(number), **point}
    # a ratio to nothing is no number, and its claim cannot be tried
    with np.errstate(all="ignore"):
        for claim in _claims():
            holds = holds_under(claim, {"": evidence})
            row[claim.id] = str(int(holds[""])) if holds else ""
    return row


def explore(
    out: Path, workers: int, progress: Progress | None = None, count: int | None = None
) -> dict[str, Any]:
    """Runs what is missing of the design in ``out``; returns, and writes there, what ``answers``
    finds.

    Raises ``UserError`` where the folder cannot be written or holds points of another design."""
    provenance.check_writable(out.parent)
    design_points, path = dict(enumerate(points(count or design()["points"]))), out / "points.csv"
    done = {int(row["point"]): row for row in read_points(path)} if path.is_file() else {}
    for number, row in done.items():
        if design_points.get(number) != {name: row.get(name) for name in levels()}:
            raise UserError(
                f"{path}: point {number} is of another design; name another folder with --out"
            )
    out.mkdir(parents=True, exist_ok=True)
    runs = {
        number: runs_of(number, point)
        for number, point in design_points.items()
        if number not in done
    }
    unfinished = Parts(out / "unfinished")
    missing = [run for runs_of_point in runs.values() for run in runs_of_point.values()]
    outcomes = iter(simulate(missing, unfinished, workers, progress))
    for number, runs_of_point in runs.items():
        facts = {
            place: next(outcomes).judged[run.definitions[0]] for place, run in runs_of_point.items()
        }
        done[number] = judged(number, design_points[number], facts)
    rows = [done[number] for number in design_points]
    _write(path, rows)
    shutil.rmtree(unfinished.folder, ignore_errors=True)
    result = answers(rows)
    provenance.write_json(out / "explore.json", result)
    return result


def _write(path: Path, rows: Iterable[Mapping[str, str]]) -> None:
    with atomic_write(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        write = csv.DictWriter(
            file, ["point", *levels(), *(claim.id for claim in _claims())], lineterminator="\n"
        )
        write.writeheader()
        write.writerows(rows)


def _claims() -> list[Claim]:
    """Those that runs can tell of."""
    return [claim for claim in load_claims() if claim.kind != "table"]


def read_points(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def answers(rows: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """What the points say: how often each claim holds and what drives that, which pairs never hold
    together, and whether the points that are best by one half of the claims are good by the other.
    """
    claims = [claim.id for claim in _claims()]
    table = np.array([[float(row[claim] or "nan") for row in rows] for claim in claims])
    drawn = {name: np.array([row[name] for row in rows]) for name in levels()}
    held = np.nansum(table, axis=0)
    return {
        "points": len(rows),
        "most_at_once": int(held.max()),
        "mean_at_once": round(float(held.mean()), 2),
        "claims": {
            claim: _claim(outcomes, drawn) for claim, outcomes in zip(claims, table, strict=True)
        },
        "against_each_other": _against(claims, table),
        "split": _split(dict(zip(claims, table, strict=True))),
    }


def _claim(outcomes: Values, drawn: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """How often a claim holds, and the choices that explain most of it, with how often it holds at
    each level.
    """
    tried = ~np.isnan(outcomes)
    outcomes, drawn = (
        outcomes[tried],
        {name: levels_drawn[tried] for name, levels_drawn in drawn.items()},
    )
    drivers = {}
    if 0 < outcomes.sum() < len(outcomes):
        explained = {
            name: _explained(outcomes, levels_drawn) for name, levels_drawn in drawn.items()
        }
        for name in sorted(explained, key=lambda levels_drawn: -explained[levels_drawn])[:DRIVERS]:
            at = {
                level: _rounded(outcomes[drawn[name] == level].mean()) for level in levels()[name]
            }
            drivers[name] = {"share_of_variance": _rounded(explained[name]), "holds_at": at}
    return {
        "tried": len(outcomes),
        "holds": _rounded(outcomes.mean()) if len(outcomes) else None,
        "drivers": drivers,
    }


def _explained(outcomes: Values, drawn: np.ndarray[Any, Any]) -> float:
    """The share of variance that a choice explains, without what chance alone would (omega
    squared), at least 0.
    """
    groups = [outcomes[drawn == level] for level in np.unique(drawn)]
    if len(groups) == len(outcomes):
        return 0.0  # one point a level tells nothing of chance
    total = float(((outcomes - outcomes.mean()) ** 2).sum())
    within = sum(float(((group - group.mean()) ** 2).sum()) for group in groups)
    noise = within / (len(outcomes) - len(groups))
    return max(0.0, (total - within - (len(groups) - 1) * noise) / (total + noise))


def _against(claims: Sequence[str], table: Values) -> list[dict[str, Any]]:
    """The pairs of claims that hold together at no point, or much more seldom than chance would
    have it, although each holds at some; those first that chance would have together most often.
    """
    pairs = []
    for i, j in itertools.combinations(range(len(claims)), 2):
        both = table[[i, j]][:, ~np.isnan(table[[i, j]]).any(axis=0)]
        expected, together = (
            (float(both[0].mean() * both[1].sum()), int(both.prod(axis=0).sum()))
            if both.size
            else (0, 0)
        )
        if expected >= design()["expected_together"] and together <= SELDOM * expected:
            pairs.append(
                {
                    "claims": [claims[i], claims[j]],
                    "expected": _rounded(expected),
                    "together": together,
                }
            )
    return sorted(pairs, key=lambda pair: (pair["together"] > 0, -pair["expected"]))


def _split(table: Mapping[str, Values]) -> list[dict[str, Any]]:
    """For each half: of how many of the other half's claims hold at the points that are best by it,
    and at all points.

    ``chance``: the 95 % interval of as many points drawn at random."""
    halves, best = [], min(design()["best"], len(next(iter(table.values()))))
    scores = {
        name: np.nanmean([table[claim] for claim in claims], axis=0)
        for name, claims in design()["halves"].items()
    }
    for by, against in itertools.permutations(scores, 2):
        chosen = np.argsort(-scores[by], kind="stable")[:best]
        score, other = scores[by], scores[against]
        half = 1.96 * float(other.std(ddof=1)) * np.sqrt((1 - best / len(other)) / best)
        flat = score.std() == 0 or other.std() == 0  # where every point is as good
        halves.append(
            {
                "by": by,
                "own": _rounded(score[chosen].mean()),
                "own_of_all": _rounded(score.mean()),
                "other": _rounded(other[chosen].mean()),
                "other_of_all": _rounded(other.mean()),
                "chance": [_rounded(other.mean() - half), _rounded(other.mean() + half)],
                "r": None if flat else _rounded(np.corrcoef(score, other)[0, 1]),
            }
        )
    return halves


def _rounded(value: Any) -> float:
    return round(float(value), 3)


def text(result: Mapping[str, Any]) -> str:
    """What ``answers`` returns, as Markdown tables."""
    explained = "what explains most (share of variance): share at each level"
    claims = [
        [
            name,
            "not tried" if claim["holds"] is None else format(claim["holds"], ".0%"),
            "; ".join(
                _driver_text(choice, driver)
                for choice, driver in claim["drivers"].items()
                if driver["share_of_variance"] >= MIN_SHARE
            ),
        ]
        for name, claim in result["claims"].items()
    ]
    pairs = [
        [" and ".join(pair["claims"]), str(pair["together"]), f"{pair['expected']:.0f}"]
        for pair in result["against_each_other"]
    ]
    halves = [
        [
            half["by"],
            f"{half['own']:.0%} (all points {half['own_of_all']:.0%})",
            f"{half['other']:.1%}",
            f"{half['other_of_all']:.1%}",
            "{:.1%} to {:.1%}".format(*half["chance"]),
        ]
        for half in result["split"]
    ]
    of_halves = ["best by", "hold of these", "of the other half", "at all points"]
    return "\n\n".join(
        [
            markdown(["claim", "holds at", explained], claims),
            markdown(["claims", "hold together at", "points expected by chance"], pairs),
            markdown([*of_halves, "95 % of random choices"], halves),
        ]
    )


def _driver_text(choice: str, driver: Mapping[str, Any]) -> str:
    """A choice that explains a claim, with how often the claim holds at each of its levels."""
    levels = ", ".join(f"{level} {share:.2f}" for level, share in driver["holds_at"].items())
    return f"{choice} ({driver['share_of_variance']:.2f}): {levels}"
