"""The goals that were set for the recommended Genie, and what became of them: tables of
docs/explanation/looks.md and docs/where-it-pays.md, out of the files in ``results/where_it_pays``.

    python -m benchmarks.look_goals
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from benchmarks.where_it_pays import GENIE, MISSED, OUT, PAUSES, WITHOUT_GENIE
from benchmarks.where_it_pays_page import F1, PAGE, conditions, fill, gain, means, read
from genie_sim.analysis.text_table import markdown

LOOKS_PAGE = Path("docs/explanation/looks.md")
# Streaming F1 of the prototype with a p_min of .7, by condition; in the town edges tell cars.
PROTOTYPE = {
    "Ethernet, JPEG 80": 0.811,
    "Ethernet, raw": 0.804,
    "5G, raw": 0.764,
    "5G, JPEG 80": 0.804,
    "LTE, raw": 0.765,
    "LTE, JPEG 80": 0.801,
    "10 cars on one Quadro": 0.799,
    "all edges Orin Nano": 0.806,
    "links cut after 2.5 s": 0.793,
    "three laps": 0.781,
    "0006, Ethernet, raw": 0.924,
    "0006, 5G, 86 kB": 0.908,
    "0017, Ethernet, raw": 0.866,
    "0017, 5G, 86 kB": 0.858,
    "0015, Ethernet, raw": 0.725,
    "0015, 5G, 86 kB": 0.713,
    "town, 5G": 0.787,
    "town, LTE": 0.785,
    "town, Xavier edges": 0.704,
}
FOUR_CAMERAS = ("Ethernet, JPEG 80", "Ethernet, raw", "5G, JPEG 80")
AHEAD, AHEAD_IN = 0.005, 8
BELOW, LATER_LAP, FIRST_ANSWER_MS, UPLINK = 0.01, 0.02, 10.0, 0.4
Goal = tuple[str, str, str, bool]


def goals(seen: pd.DataFrame, held_out: pd.DataFrame) -> str:
    """A row for each goal: what was asked, what was measured, and whether it was met."""
    rows = [
        [asked, goal, value, "met" if is_met else "**missed**"]
        for asked, goal, value, is_met in (
            *_on_held_out(held_out),
            *_beside_prototype(seen),
            _ahead(seen),
            _laps(seen),
            *_prices(seen, held_out),
        )
    ]
    return markdown(["", "goal", "measured", ""], rows)


def _on_held_out(held_out: pd.DataFrame) -> list[Goal]:
    names = conditions(held_out)
    gains = {name: gain(held_out, name).value for name in names}
    mean, worst = sum(gains.values()) / len(gains), min(gains, key=gains.__getitem__)
    below = sum(value < -BELOW for value in gains.values())
    return [
        (
            "held out: mean over conditions, less the best tracker's without a Genie",
            "at least 0",
            f"{mean:+.4f}",
            mean >= 0,
        ),
        (
            "held out: the worst condition",
            f"at least −{BELOW:g}",
            f"{gains[worst]:+.3f} ({worst}); {below} of {len(gains)} are lower than −{BELOW:g}",
            below == 0,
        ),
    ]


def _beside_prototype(seen: pd.DataFrame) -> list[Goal]:
    by_place = means(seen)[F1]
    rows = []
    kinds = {"genie_prototype": "with the prototype's settings", GENIE: "as shipped"}
    for method, words in kinds.items():
        less = {name: by_place[name, method] - goal for name, goal in PROTOTYPE.items()}
        worst = min(less, key=less.__getitem__)
        rows.append(
            (
                f"F1 less the prototype's, {words}",
                f"at least −{BELOW:g} in each of {len(less)} conditions",
                f"{less[worst]:+.3f} ({worst}) to {max(less.values()):+.3f}",
                less[worst] >= -BELOW,
            )
        )
    return rows


def _ahead(seen: pd.DataFrame) -> Goal:
    ahead = [name for name in conditions(seen) if gain(seen, name).value >= AHEAD]
    return (
        f"conditions at least {AHEAD:g} above the best method without a Genie",
        f"{AHEAD_IN} of {len(conditions(seen))}",
        f"{len(ahead)}: {'; '.join(ahead)}",
        len(ahead) >= AHEAD_IN,
    )


def _laps(seen: pd.DataFrame) -> Goal:
    laps = means(seen[seen["condition"] == "three laps"]).loc[("three laps", GENIE)]
    later = laps["lap 3"] - laps["lap 1"]
    asked = "F1 of lap 3 less that of lap 1"
    return asked, f"at least −{LATER_LAP:g}", f"{later:+.3f}", bool(later >= -LATER_LAP)


def _prices(seen: pd.DataFrame, held_out: pd.DataFrame) -> list[Goal]:
    runs = pd.concat([seen, held_out])
    first_ms = means(runs).xs(GENIE, level="method")["first_answer_mean"].max()
    by_place = means(seen)["uplink_bytes"]
    shares = [by_place[name, GENIE] / by_place[name, "remote_tracker"] for name in FOUR_CAMERAS]
    return [
        (
            "mean first answer, on KITTI and in the town",
            f"at most {FIRST_ANSWER_MS:g} ms",
            f"at most {first_ms:.1f} ms",
            bool(first_ms <= FIRST_ANSWER_MS),
        ),
        (
            "bytes up, of remote's: four cameras, Ethernet or 5G with JPEG",
            f"at most {UPLINK:.0%}",
            ", ".join(f"{share:.0%}" for share in shares),
            max(shares) <= UPLINK,
        ),
    ]


def by_p_min(curves: pd.DataFrame, names: Sequence[str]) -> str:
    """F1 and ghosts of the Genie and the remote tracker with the same p_min."""
    titles = {GENIE: "Genie", "remote_tracker": "remote + tracker"}
    p_mins = sorted(curves["p_min"].unique())
    mean = curves.groupby(["condition", "method", "p_min"])[[F1, "ghost_share"]].mean()
    rows = []
    for name in names:
        for method, title in titles.items():
            of_method = mean.loc[(name, method)]
            cells = [f"{of_method[F1][p]:.3f}, {of_method['ghost_share'][p]:.2f}" for p in p_mins]
            rows.append([f"{name}: {title}", *cells])
    return markdown(["p_min: F1, ghosts", *(f"{p_min:g}" for p_min in p_mins)], rows)


def missed(curves: pd.DataFrame) -> str:
    """F1 by p_min on the sequence that was missed most."""
    return by_p_min(curves, [n for n in conditions(curves) if n.startswith(MISSED)])


def towns(curves: pd.DataFrame) -> str:
    """F1 by p_min in two towns."""
    return by_p_min(curves, ["town, 5G", "town of twelve, 5G"])


def tuned_to_town(curves: pd.DataFrame) -> str:
    """The Genie as it ships beside trackers with a p_min of .5, in the larger town."""
    chosen = {GENIE: (GENIE, 0.8), **{name: (name, 0.5) for name in WITHOUT_GENIE[:2]}}
    rows = []
    for name in [condition for condition in conditions(curves) if condition.startswith("town,")]:
        f1 = curves[curves["condition"] == name].pivot_table(
            index="seed", columns=["method", "p_min"], values=F1
        )
        others = {key: f1[pair] for key, pair in chosen.items() if pair in f1 and key != GENIE}
        best = max(others, key=lambda key: others[key].mean())
        less = f1[chosen[GENIE]] - others[best]
        cells = [f"{f1[pair].mean():.3f}" if pair in f1 else "" for pair in chosen.values()]
        by_seed = ", ".join(f"{value:+.3f}" for value in less)
        rows.append([name, *cells, f"{less.mean():+.3f} ({by_seed})"])
    heads = ["", "Genie", "local + tracker, .5", "remote + tracker, .5", "Genie less the better"]
    return markdown(heads, rows)


def laps(curves: pd.DataFrame) -> str:
    """F1 of lap 3 less that of lap 1, by p_min and by the pause between laps."""
    of_laps = curves[curves["condition"].str.startswith("three laps")]
    later = (of_laps["lap 3"] - of_laps["lap 1"]).groupby(
        [of_laps["condition"], of_laps["p_min"]], sort=False
    )
    mean = later.mean()
    p_mins = sorted(of_laps["p_min"].unique())
    rows = [
        [pause, *(f"{mean[f'three laps, {pause}', p_min]:+.3f}" for p_min in p_mins)]
        for pause in PAUSES
    ]
    return markdown(["pause; p_min:", *(f"{p_min:g}" for p_min in p_mins)], rows)


def ahead_by_p_min(second: pd.DataFrame) -> str:
    """On drive 0005, under seed 1: in how many conditions the Genie is ahead, by p_min."""
    best = second[second["method"].isin(WITHOUT_GENIE)].groupby("condition")[F1].max()
    genie = second[second["method"] == GENIE].pivot_table(
        index="condition", columns="p_min", values=F1
    )
    counts = [(genie[p_min] - best >= AHEAD).sum() for p_min in genie.columns]
    mean = [(genie[p_min] - best).mean() for p_min in genie.columns]
    heads = ["p_min", *(f"{p_min:g}" for p_min in genie.columns)]
    rows = [
        [f"conditions at least {AHEAD:g} above, of {len(best)}", *map(str, counts)],
        ["mean difference", *(f"{value:+.3f}" for value in mean)],
    ]
    return markdown(heads, rows)


def looks_blocks(
    seen: pd.DataFrame, held_out: pd.DataFrame, second: pd.DataFrame, curves: pd.DataFrame
) -> dict[str, str]:
    """The tables of the page on paced looks, by their names there."""
    return {
        "goals": goals(seen, held_out),
        "missed sequence": missed(curves),
        "later laps": laps(curves),
        "ahead": ahead_by_p_min(second),
    }


def town_blocks(curves: pd.DataFrame) -> dict[str, str]:
    """The tables of trackers tuned to the town, by their names on the page of where it pays."""
    return {"two towns": towns(curves), "tuned to the town": tuned_to_town(curves)}


def main() -> None:
    """Fills the pages."""
    seen, held_out, _, second = read()
    curves = pd.read_csv(OUT / "curves.csv")
    fill(LOOKS_PAGE, looks_blocks(seen, held_out, second, curves))
    fill(PAGE, town_blocks(curves))


if __name__ == "__main__":
    main()
