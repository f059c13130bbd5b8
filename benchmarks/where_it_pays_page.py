"""Tables and figure of docs/where-it-pays.md and docs/explanation/freshness.md, out of the files in
``results``.

python -m benchmarks.where_it_pays_page
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from benchmarks import look_rules
from benchmarks.freshness_policies import OUT as SEEDS
from benchmarks.speed_page import filled
from benchmarks.where_it_pays import (
    DEFAULTS,
    GENIE,
    OUT,
    WITHOUT_GENIE,
    both_stages,
    chosen,
)
from genie_sim.analysis import style
from genie_sim.analysis.statistics import over_seeds, t_quantile
from genie_sim.analysis.text_table import markdown

PAGE = Path("docs/where-it-pays.md")
FRESHNESS_PAGE = Path("docs/explanation/freshness.md")
POLICY_TITLES = {
    "autoware": "`existence`, `autoware`",
    "ipda": "`existence`, `ipda`",
    "paced": "the recommended Genie",
}
FIGURE = Path("docs/images/where_it_pays.png")
TITLES = {
    "local_tracker": "local + tracker",
    "remote_tracker": "remote + tracker",
    "paced_tracker": "paced remote + tracker",
    "genie_former": "Genie, formerly",
    GENIE: "Genie",
    "genie_prototype": "the prototype's settings",
    "genie_p90": "p_min .9",
    "genie_alone": "p_min .9, edges tell nothing",
}
F1 = "streaming_f1"


class Gain(NamedTuple):
    """Streaming F1 of a Genie less that of the best method without one, with its 95 % interval."""

    best: str
    value: float
    low: float
    high: float

    def text(self) -> str:
        """As it stands in a table."""
        return f"{self.value:+.3f} ({self.low:+.3f} to {self.high:+.3f})"


def gain(runs: pd.DataFrame, condition: str, method: str = GENIE) -> Gain:
    """Over the best method of the mean over the seeds; differences are paired by seed."""
    of_condition = runs[runs["condition"] == condition]
    f1 = of_condition.pivot_table(index="seed", columns="method", values=F1)
    best = str(f1[list(WITHOUT_GENIE)].mean().idxmax())
    value, half = over_seeds((f1[method] - f1[best]).tolist())
    return Gain(best, value, value - half, value + half)


def means(runs: pd.DataFrame) -> pd.DataFrame:
    """Means over the seeds, by condition and method."""
    return runs.groupby(["condition", "method"], sort=False).mean(numeric_only=True)


def conditions(runs: pd.DataFrame) -> list[str]:
    """In the order of the study."""
    return list(runs["condition"].unique())


def table(runs: pd.DataFrame) -> str:
    """A row for each condition."""
    shown = (*WITHOUT_GENIE, "genie_former", GENIE)
    heads = ["", *(TITLES[name] for name in shown), "Genie less the best without (95 %)"]
    heads += ["ghosts: that best, Genie", "uplink and edges, % of remote", "first answer, ms"]
    rows = []
    by_place = means(runs)
    for condition in conditions(runs):
        of_condition = by_place.loc[condition]
        genie, remote = of_condition.loc[GENIE], of_condition.loc["remote_tracker"]
        difference = gain(runs, condition)
        ghosts = of_condition["ghost_share"]
        shares = [100 * genie[name] / remote[name] for name in ("uplink_bytes", "edge_busy_s")]
        rows.append(
            [
                condition,
                *(_number(of_condition[F1].get(name)) for name in shown),
                f"{difference.text()}, {TITLES[difference.best]}",
                f"{ghosts[difference.best]:.2f}, {ghosts[GENIE]:.2f}",
                ", ".join(f"{share:.0f}" for share in shares),
                f"{genie['first_answer_mean']:.1f}",
            ]
        )
    return markdown(heads, rows)


def variants(runs: pd.DataFrame) -> str:
    """What the Genie's variants change, a row for each condition."""
    names = [
        name
        for name in ("genie_p90", "genie_prototype", "genie_alone")
        if name in set(runs["method"])
    ]
    by_place = means(runs)
    rows = []
    for condition in conditions(runs):
        of_condition = by_place.loc[condition]
        f1 = [of_condition[F1].get(name) for name in names]
        rows.append(
            [
                condition,
                f"{of_condition.loc[GENIE, F1]:.3f}",
                *map(_number, f1),
            ]
        )
    return markdown(["", TITLES[GENIE], *(TITLES[name] for name in names)], rows)


def _number(value: float | None) -> str:
    """Three digits; nothing for a method that did not run there."""
    return "" if value is None else f"{value:.3f}"


def laps(runs: pd.DataFrame) -> str:
    """Streaming F1 in each lap."""
    names = sorted(name for name in runs if name.startswith("lap "))
    of_laps = runs.dropna(subset=names).groupby("method", sort=False)[names].mean()
    rows = [
        [TITLES[str(method)], *(f"{value:.3f}" for value in row)]
        for method, row in zip(of_laps.index, of_laps.to_numpy(), strict=True)
    ]
    return markdown(["", *names], rows)


def choice(choose: pd.DataFrame) -> str:
    """Mean of streaming F1 over the tuning set."""
    pairs = list(dict.fromkeys(zip(choose["p_min"], choose["tau_ms"], strict=True)))
    rows = []
    for name in DEFAULTS:
        f1 = choose[choose["method"] == name].set_index(["p_min", "tau_ms"])[F1]
        rows.append([TITLES[name], *(f"{f1[pair]:.3f}" for pair in pairs)])
    return markdown(["p_min, tau", *(f"{p_min:g}, {tau} ms" for p_min, tau in pairs)], rows)


def second_choice(choose: pd.DataFrame, second: pd.DataFrame) -> str:
    """Mean of streaming F1 over the conditions of both stages, and what is chosen."""
    rows = []
    for name in DEFAULTS:
        own = chosen(choose, second, name)
        cells = []
        for (p_min, tau_ms), f1 in both_stages(choose, second, name).items():
            text = f"{p_min:g}, {tau_ms:g} ms: {f1:.3f}"
            cells.append(f"{text} (chosen)" if (p_min, tau_ms) == own else text)
        rows.append([TITLES[name], "; ".join(cells)])
    return markdown(["", "p_min, tau: mean F1"], rows)


def p_min_table(curve: pd.DataFrame) -> str:
    """Streaming F1 and ghosts of the Genie by condition and p_min."""
    f1, ghosts = (
        curve[curve["method"] == GENIE].pivot_table(
            index="condition", columns="p_min", values=name, sort=False
        )
        for name in (F1, "ghost_share")
    )
    rows = [
        [str(name), *(f"{f1.loc[name, p]:.3f}, {ghosts.loc[name, p]:.2f}" for p in f1.columns)]
        for name in f1.index
    ]
    return markdown(["p_min: F1, ghosts", *(f"{p_min:g}" for p_min in f1.columns)], rows)


def gains_by_drive(runs: pd.DataFrame, members: Sequence[str]) -> dict[str, list[float]]:
    """The gain of each recorded drive, the mean over its conditions and seeds, as ``drives``, and
    that of each town, the mean over its conditions, as ``towns``: every seed invents a town.
    """
    of_drive: dict[str, list[float]] = {}
    of_town: dict[int, list[float]] = {}
    for condition in members:
        best = gain(runs, condition).best
        f1 = runs[runs["condition"] == condition].pivot_table(
            index="seed", columns="method", values=F1
        )
        difference = f1[GENIE] - f1[best]
        if condition.startswith("town"):
            for seed, value in difference.items():
                of_town.setdefault(int(str(seed)), []).append(float(value))
        else:
            of_drive.setdefault(condition.partition(",")[0], []).append(float(difference.mean()))
    strata = {"drives": of_drive.values(), "towns": of_town.values()}
    return {
        name: [sum(values) / len(values) for values in gains]
        for name, gains in strata.items()
        if gains
    }


def stratified(strata: Sequence[tuple[float, Sequence[float]]]) -> tuple[float, float]:
    """The weighted mean of the means of several samples, and half of its 95 % interval.

    Each sample comes with its weight; the weights sum to 1. The degrees of freedom are Welch's,
    rounded down. With a single sample this is the t interval.
    """
    mean = sum(weight * sum(sample) / len(sample) for weight, sample in strata)
    parts = [
        (weight**2 * statistics.variance(sample) / len(sample), len(sample) - 1)
        for weight, sample in strata
    ]
    total = sum(variance for variance, _ in parts)
    if total == 0:
        return mean, 0.0
    freedom = total**2 / sum(variance**2 / free for variance, free in parts)
    return mean, t_quantile(math.floor(freedom + 1e-9)) * math.sqrt(total)


def over_drives(runs: pd.DataFrame, groups: Mapping[str, Sequence[str]]) -> str:
    """The mean difference over the conditions of each group, with an interval over its drives and
    towns.
    """
    lines = []
    for name, members in groups.items():
        samples = gains_by_drive(runs, members)
        in_town = sum(condition.startswith("town") for condition in members)
        counts = {"drives": len(members) - in_town, "towns": in_town}
        strata = [(counts[kind] / len(members), sample) for kind, sample in samples.items()]
        value, half = stratified(strata)
        worst = min(gain(runs, condition).value for condition in members)
        units = " and ".join(f"{len(sample)} {kind}" for kind, sample in samples.items())
        lines.append(
            f"- {name}: {value:+.3f} ({value - half:+.3f} to {value + half:+.3f} over {units}),"
            f" the worst of {len(members)} conditions {worst:+.3f}."
        )
    return "\n".join(lines)


def blocks(
    seen: pd.DataFrame, held_out: pd.DataFrame, choose: pd.DataFrame, second: pd.DataFrame
) -> dict[str, str]:
    """Every table of the page, by its name there."""
    held = conditions(held_out)
    groups = {
        "Drives over Ethernet": [name for name in held if "Ethernet" in name],
        "Drives over 5G": [name for name in held if "86 kB" in name],
        "Town": [name for name in held if name.startswith("town")],
        "All": held,
    }
    better = sum(gain(seen, name).low > 0 for name in conditions(seen))
    worse = sum(gain(seen, name).high < 0 for name in conditions(seen))
    counted = f"- Seen conditions: better in {better}, worse in {worse} of {len(conditions(seen))}."
    return {
        "choice": choice(choose),
        "second choice": second_choice(choose, second),
        "seen": table(seen),
        "held out": table(held_out),
        "means": f"{over_drives(held_out, groups)}\n{counted}",
        "variants": variants(seen),
        "laps": laps(seen),
        "p_min": p_min_table(second),
    }


def drawn(runs: pd.DataFrame) -> Figure:
    """Streaming F1 of every method, and the difference that the Genie makes, by condition."""
    names, by_place = conditions(runs), means(runs)
    places = range(len(names))
    figure = Figure(figsize=(9, 0.21 * len(names) + 1))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    methods = (*WITHOUT_GENIE, "genie_former", GENIE)
    for look, method in zip(style.method_looks(methods), methods, strict=True):
        f1 = [by_place.loc[(name, method), F1] for name in names]
        color, marker = style.method_colour(look), style.method_marker(look)
        points = {"linestyle": "none", "markersize": 4, "color": color, "marker": marker}
        left.plot(f1, places, label=TITLES[method], **points)
    gains = [gain(runs, name) for name in names]
    values = [difference.value for difference in gains]
    ends = [
        [difference.value - difference.low for difference in gains],
        [difference.high - difference.value for difference in gains],
    ]
    bars = {"fmt": "o", "markersize": 3, "capsize": 2, "color": "black"}
    right.errorbar(values, places, xerr=ends, **bars)
    right.locator_params(axis="x", nbins=4)
    right.axvline(0, color="grey", linewidth=0.8)
    left.set_yticks(places, names, fontsize=7)
    left.invert_yaxis()
    left.set_xlabel("streaming F1")
    right.set_xlabel("Genie less the best without, 95 %")
    left.legend(fontsize=6, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    for panel in (left, right):
        panel.grid(axis="x", alpha=0.3)
    return figure


def policies(runs: pd.DataFrame) -> str:
    """A row for each freshness policy, and the recommended Genie."""
    columns = {"ghost_share": 2, "object_recall_static": 2, "object_recall_moving": 2, F1: 3}
    by_place = means(runs)
    rows = []
    for method in runs["method"].unique():
        cells = [POLICY_TITLES.get(str(method), f"`{method}`")]
        for condition in conditions(runs):
            row = by_place.loc[(condition, method)]
            cells += [f"{row[name]:.{digits}f}" for name, digits in columns.items()]
        rows.append(cells)
    words = ("ghosts", "recall, static", "moving", "F1")
    heads = [f"{condition}: {word}" for condition in conditions(runs) for word in words]
    return markdown(["policy", *heads], rows)


def freshness_blocks() -> dict[str, str]:
    """The tables of the page on freshness, by their names there."""
    rules = pd.read_csv(look_rules.FILE)
    held_out = pd.read_csv(look_rules.HELD_OUT_FILE)
    return {
        "policies": policies(pd.read_csv(SEEDS)),
        "look rules": look_rules.table(rules),
        "look rules held out": look_rules.held_out_table(held_out),
    }


def read() -> list[pd.DataFrame]:
    """The seen conditions, the held-out ones, and both stages of the choice."""
    return [pd.read_csv(OUT / f"{name}.csv") for name in ("seeds", "held_out", "choose", "second")]


def fill(page: Path, tables: Mapping[str, str]) -> None:
    """Writes tables to their places."""
    text = page.read_text(encoding="utf-8")
    for name, block in tables.items():
        text = filled(text, name, block, str(page))
    page.write_text(text, encoding="utf-8")


def main() -> None:
    """Fills the pages and draws the figure."""
    seen, *others = read()
    fill(PAGE, blocks(seen, *others))
    fill(FRESHNESS_PAGE, freshness_blocks())
    figure = drawn(seen)
    figure.savefig(FIGURE, dpi=100, bbox_inches="tight", metadata={"Software": None})


if __name__ == "__main__":
    main()
