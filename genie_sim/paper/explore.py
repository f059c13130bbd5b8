"""Which claims hold where: a space-filling design over the paper's open choices, and what contradicts what.

``explore.yaml`` says what is drawn and what is asked; it is older than any result. ``points.csv`` in the folder gets a
line per finished point, so that a design that was interrupted goes on where it ended.
"""

import csv
import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.text_table import markdown
from genie_sim.errors import UserError
from genie_sim.paper.checks import ALL, load_claims
from genie_sim.paper.claims import holds_under
from genie_sim.paper.definitions import DEFINITIONS
from genie_sim.paper.evidence import BASE, Claim, Evidence, Values
from genie_sim.paper.replicate import EVERY_METHOD, Job, Progress, run_job
from genie_sim.paper.reproduce import FOR_CLAIMS
from genie_sim.parallel import in_processes
from genie_sim.paths import atomic_write
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import read_mapping

GENIE = ("genie",)
# Variant, scenarios, settings, methods: as in the evaluation, but without the case study's baselines.
RUNS: list[tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = [
    (BASE, ALL, (), EVERY_METHOD)
]
RUNS += [
    (name, of, more, GENIE if name == BASE else run) for name, (of, more, run) in FOR_CLAIMS.items()
]
Point = dict[str, str]  # choice -> level
DRIVERS, LEAST_SHARE = (
    3,
    0.05,
)  # how many choices are named for a claim, and from which share of variance on
SELDOM = (
    0.25  # of the points expected: claims that hold together no more often speak against each other
)


@functools.cache
def design() -> dict[str, Any]:
    """What ``explore.yaml`` says."""
    return read_mapping(Path(__file__).with_name("explore.yaml"))


def levels() -> dict[str, list[str]]:
    """Of each choice, and of each metric's definition, the levels, the default's first."""
    definitions = {f"metric {metric}": list(DEFINITIONS[metric]) for metric in design()["metrics"]}
    return {name: list(of) for name, of in design()["choices"].items()} | definitions


def points(count: int) -> list[Point]:
    """The first points of the design. More of them begin with the same."""
    from scipy.stats import qmc

    names = levels()
    sobol = qmc.Sobol(len(names), scramble=True, rng=design()["sequence"])
    drawn = sobol.random_base2(max(count - 1, 1).bit_length())[:count]
    return [
        {name: of[int(u * len(of))] for (name, of), u in zip(names.items(), row, strict=True)}
        for row in drawn
    ]


def judged(numbered: tuple[int, Point]) -> dict[str, str]:
    """A point simulated: of each claim ``1`` if it holds, ``0`` if not, empty where it cannot be tried."""
    number, point = numbered
    seed, choices = design()["first_seed"] + number, design()["choices"]
    settings = tuple(setting for name, of in choices.items() for setting in of[point[name]])
    runs = {}
    for variant, scenarios, more, methods in RUNS:
        for scenario in scenarios:
            runs[variant, scenario] = [
                run_job(Job(scenario, seed, (*settings, *more), methods)).facts
            ]
    evidence = Evidence(runs, {metric: point[f"metric {metric}"] for metric in design()["metrics"]})
    with np.errstate(
        all="ignore"
    ):  # a ratio to nothing is no number, and its claim cannot be tried
        found = {claim.id: holds_under(claim, {"": evidence}) for claim in _claims()}
    return {
        "point": str(number),
        **point,
        **{name: str(int(one[""])) if one else "" for name, one in found.items()},
    }


def explore(
    out: Path, jobs: int, progress: Progress | None = None, count: int | None = None
) -> dict[str, Any]:
    """Runs what is missing of the design in ``out``; returns, and writes there, what ``answers`` finds.

    Raises ``UserError`` where the folder cannot be written or holds points of another design."""
    provenance.check_writable(out.parent)
    wanted, path = dict(enumerate(points(count or design()["points"]))), out / "points.csv"
    done = {int(row["point"]): row for row in read_points(path)} if path.is_file() else {}
    for number, row in done.items():
        if wanted.get(number) != {name: row.get(name) for name in levels()}:
            raise UserError(
                f"{path}: point {number} is of another design; name another folder with --out"
            )
    out.mkdir(parents=True, exist_ok=True)
    missing = [(number, point) for number, point in wanted.items() if number not in done]
    with closing(in_processes(judged, missing, jobs)) as finished:
        for row in finished:
            done[int(row["point"])] = row
            _write(path, done.values())
            if progress is not None:
                progress(len(done), len(wanted), "points")
    rows = [done[number] for number in wanted]
    _write(path, rows)  # in order, however many processes there were
    found = answers(rows)
    provenance.write_json(out / "explore.json", found)
    return found


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
    """What the points say: how often each claim holds and what drives that, which pairs never hold together, and
    whether the points that are best by one half of the claims are good by the other."""
    claims = [claim.id for claim in _claims()]
    table = np.array([[float(row[claim] or "nan") for row in rows] for claim in claims])
    drawn = {name: np.array([row[name] for row in rows]) for name in levels()}
    held = np.nansum(table, axis=0)
    return {
        "points": len(rows),
        "most_at_once": int(held.max()),
        "mean_at_once": round(float(held.mean()), 2),
        "claims": {claim: _claim(of, drawn) for claim, of in zip(claims, table, strict=True)},
        "against_each_other": _against(claims, table),
        "split": _split(dict(zip(claims, table, strict=True))),
    }


def _claim(of: Values, drawn: Mapping[str, np.ndarray[Any, Any]]) -> dict[str, Any]:
    """How often a claim holds, and the choices that explain most of it, with how often it holds at each level."""
    tried = ~np.isnan(of)
    of, drawn = of[tried], {name: one[tried] for name, one in drawn.items()}
    drivers = {}
    if 0 < of.sum() < len(of):
        explained = {name: _explained(of, one) for name, one in drawn.items()}
        for name in sorted(explained, key=lambda one: -explained[one])[:DRIVERS]:
            at = {level: _rounded(of[drawn[name] == level].mean()) for level in levels()[name]}
            drivers[name] = {"share_of_variance": _rounded(explained[name]), "holds_at": at}
    return {"tried": len(of), "holds": _rounded(of.mean()) if len(of) else None, "drivers": drivers}


def _explained(of: Values, drawn: np.ndarray[Any, Any]) -> float:
    """The share of variance that a choice explains, without what chance alone would (omega squared), at least 0."""
    groups = [of[drawn == level] for level in np.unique(drawn)]
    total = float(((of - of.mean()) ** 2).sum())
    within = sum(float(((group - group.mean()) ** 2).sum()) for group in groups)
    noise = within / (len(of) - len(groups))
    return max(0.0, (total - within - (len(groups) - 1) * noise) / (total + noise))


def _against(claims: Sequence[str], table: Values) -> list[dict[str, Any]]:
    """The pairs of claims that hold together at no point, or much more seldom than chance would have it, although each
    holds at some; those first that chance would have together most often."""
    found = []
    for i, j in itertools.combinations(range(len(claims)), 2):
        both = table[[i, j]][:, ~np.isnan(table[[i, j]]).any(axis=0)]
        expected, together = (
            (float(both[0].mean() * both[1].sum()), int(both.prod(axis=0).sum()))
            if both.size
            else (0, 0)
        )
        if expected >= design()["expected_together"] and together <= SELDOM * expected:
            found.append(
                {
                    "claims": [claims[i], claims[j]],
                    "expected": _rounded(expected),
                    "together": together,
                }
            )
    return sorted(found, key=lambda one: (one["together"] > 0, -one["expected"]))


def _split(table: Mapping[str, Values]) -> list[dict[str, Any]]:
    """For each half: of how many of the other half's claims hold at the points that are best by it, and at all points.

    ``chance``: the 95 % interval of as many points drawn at random."""
    found, best = [], min(design()["best"], len(next(iter(table.values()))))
    scores = {
        name: np.nanmean([table[one] for one in of], axis=0)
        for name, of in design()["halves"].items()
    }
    for by, other in itertools.permutations(scores, 2):
        chosen, of = np.argsort(-scores[by], kind="stable")[:best], scores[other]
        half = 1.96 * float(of.std(ddof=1)) * np.sqrt((1 - best / len(of)) / best)
        shares = {
            "own": scores[by][chosen].mean(),
            "own_of_all": scores[by].mean(),
            "other": of[chosen].mean(),
        }
        shares |= {"other_of_all": of.mean()}
        chance = [_rounded(of.mean() - half), _rounded(of.mean() + half)]
        flat = scores[by].std() == 0 or of.std() == 0  # where every point is as good
        r = None if flat else _rounded(np.corrcoef(scores[by], of)[0, 1])
        found.append(
            {
                "by": by,
                **{name: _rounded(one) for name, one in shares.items()},
                "chance": chance,
                "r": r,
            }
        )
    return found


def _rounded(value: Any) -> float:
    return round(float(value), 3)


def text(found: Mapping[str, Any]) -> str:
    """The answers as Markdown tables."""
    claims = []
    for name, one in found["claims"].items():
        strong = {
            c: of for c, of in one["drivers"].items() if of["share_of_variance"] >= LEAST_SHARE
        }
        at = {
            c: ", ".join(f"{level} {held:.2f}" for level, held in of["holds_at"].items())
            for c, of in strong.items()
        }
        drivers = "; ".join(
            f"{c} ({of['share_of_variance']:.2f}): {at[c]}" for c, of in strong.items()
        )
        claims.append(
            [name, "not tried" if one["holds"] is None else format(one["holds"], ".0%"), drivers]
        )
    against = [
        [" and ".join(one["claims"]), str(one["together"]), f"{one['expected']:.0f}"]
        for one in found["against_each_other"]
    ]
    cells = ("{by}", "{own:.0%} (all points {own_of_all:.0%})", "{other:.1%}", "{other_of_all:.1%}",
             "{chance[0]:.1%} to {chance[1]:.1%}")  # fmt: skip
    split = [[cell.format_map(one) for cell in cells] for one in found["split"]]
    best = [
        "best by",
        "hold of these",
        "of the other half",
        "at all points",
        "95 % of random choices",
    ]
    what = "what explains most (share of variance): share at each level"
    return "\n\n".join([
        markdown(["claim", "holds at", what], claims),
        markdown(["claims", "hold together at", "points expected by chance"], against),
        markdown(best, split),
    ])  # fmt: skip
