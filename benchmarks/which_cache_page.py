"""Tables and figure of docs/which-cache.md, out of results/which_cache/designs.csv.

python -m benchmarks.which_cache_page
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from benchmarks.speed_page import DOCS, filled, table
from benchmarks.which_cache import LOOKS, OUT, TITLES
from genie_sim.analysis import style
from genie_sim.analysis.drawing import in_style
from genie_sim.analysis.statistics import over_seeds, wilson
from genie_sim.study.search_report import WITHIN

PAGE = DOCS / "which-cache.md"
FIGURE = DOCS / "images" / "which_cache.png"
GENIE, LONG = "genie", "long"
COLUMNS, MIN_F1 = 3, 0.5  # panels a row; where the axis begins
LOOKS_OF = {"genie": "genie_recommended", "published": "genie"}  # in figures
METHODS = {
    "local": "local",
    "remote": "remote",
    "paced_remote": "paced remote",
    "deadline": "deadline",
    "genie": "Genie, tuned",
    "looks": "Genie as it ships",
    "published": "Genie as published",
    "central": "central cache",
    "sim_lru": "SIM-LRU",
    "rnd_lru": "RND-LRU",
    "potluck": "Potluck",
    "foggycache": "FoggyCache",
    "cachier": "Cachier",
}
HEADS = (
    "method",
    "F1",
    "less the Genie's",
    "kB up a frame",
    "edges, s",
    "first answer, ms",
    "ghosts, %",
    "J a frame",
    "cheapest: kB, F1",
)


class Interval(NamedTuple):
    """A mean with its 95 % interval."""

    value: float
    low: float
    high: float


def interval(values: Sequence[float], is_share: bool = False) -> Interval:
    """Mean and 95 % t interval, to ten digits; of a share Wilson's, which stays within 0 and 1."""
    mean, half = over_seeds(values)
    low, high = wilson(mean, half) if is_share else (mean - half, mean + half)
    return Interval(*(float(f"{number:.10g}") for number in (mean, low, high)))


def read() -> pd.DataFrame:
    """A row for each design and replicate."""
    return pd.read_csv(DOCS.parent / OUT / "designs.csv")


def accurate(designs: pd.DataFrame) -> str:
    """The design with the highest F1 over the tuning set; of equals the one with fewest bytes."""
    order = designs.sort_values(["tuning_f1", "tuning_bytes"], ascending=[False, True])
    return str(order["design"].iloc[0])


def cheapest(designs: pd.DataFrame, best_f1: float) -> str | None:
    """The design with the fewest bytes up among those within ``WITHIN`` of an accuracy, by the
    tuning set; ``None`` where there is none.
    """
    near = designs[designs["tuning_f1"] >= best_f1 - WITHIN]
    if near.empty:
        return None
    return str(near.sort_values(["tuning_bytes", "tuning_edge"])["design"].iloc[0])


def values(of_condition: pd.DataFrame, design: str, column: str) -> pd.Series:
    """The numbers of a design by replicate."""
    own = of_condition[of_condition["design"] == design]
    return own.set_index("replicate")[column]


def difference(of_condition: pd.DataFrame, one: str, other: str, column: str = "f1") -> Interval:
    """Mean and interval of the paired difference of two designs."""
    pairs = values(of_condition, one, column) - values(of_condition, other, column)
    return interval(pairs.to_numpy())


def signed(measured: Interval) -> str:
    """As it stands in a table."""
    return f"{measured.value:+.3f} ({measured.low:+.3f} to {measured.high:+.3f})"


def of_condition(designs: pd.DataFrame) -> str:
    """The table of a condition: a row for each method's most accurate design, the best first."""
    best_f1 = designs["tuning_f1"].max()
    genie = accurate(designs[designs["method"] == GENIE])
    rows = []
    for method, own in designs.groupby("method", sort=False):
        design = accurate(own)
        f1 = interval(values(designs, design, "f1").to_numpy(), is_share=True)
        means = own[own["design"] == design].mean(numeric_only=True)
        energy = means.get("energy")
        row = [
            METHODS[str(method)],
            f"{f1.value:.3f} ({f1.low:.3f} to {f1.high:.3f})",
            "" if method == GENIE else signed(difference(designs, design, genie)),
            f"{means['bytes'] / 1000:.1f}",
            f"{means['edge']:.1f}",
            f"{means['first_ms']:.0f}",
            "-" if pd.isna(means["ghosts"]) else f"{100 * means['ghosts']:.0f}",
            "-" if energy is None or pd.isna(energy) else f"{energy:.2f}",
            _cheapest(own, best_f1),
        ]
        rows.append((-f1.value, row))
    return table(HEADS, [row for _, row in sorted(rows)])


def _cheapest(own: pd.DataFrame, best_f1: float) -> str:
    design = cheapest(own, best_f1)
    if design is None:
        return "-"
    kilobytes = values(own, design, "bytes").mean() / 1000
    return f"{kilobytes:.1f}, {values(own, design, 'f1').mean():.3f}"


def summary(designs: pd.DataFrame) -> str:
    """A row for each condition: the most accurate method beside the Genie, and who is cheapest."""
    heads = ("condition", "best other", "the Genie less it", "bytes, %", "edges, %", "cheapest")
    rows = []
    for name, own in designs.groupby("condition", sort=False):
        genie = accurate(own[own["method"] == GENIE])
        others = own[~own["method"].isin([GENIE, LOOKS, "published"])]
        other = accurate(others)
        shares = [
            values(own, genie, column).mean() / max(values(own, other, column).mean(), 1e-12)
            for column in ("bytes", "edge")
        ]
        has_costs = values(own, other, "bytes").mean() > 0
        design = cheapest(own, own["tuning_f1"].max())
        assert design is not None
        rows.append(
            (
                TITLES[str(name)],
                METHODS[_method(own, other)],
                signed(difference(own, genie, other)),
                *(f"{100 * share:.0f}" if has_costs else "-" for share in shares),
                METHODS[_method(own, design)],
            )
        )
    return table(heads, rows)


def _method(designs: pd.DataFrame, design: str) -> str:
    return str(designs[designs["design"] == design]["method"].iloc[0])


def longer(designs: pd.DataFrame) -> str:
    """Designs of the longer search's Genie that are no worse than it as it ships, in accuracy,
    bytes and edge time, by their means over the held-out set.
    """
    own = designs[designs["condition"] == LONG]
    shipped = accurate(own[own["method"] == LOOKS])
    numbers = means_of(own)
    tuned = own[own["method"] == GENIE]["design"].unique()
    rows = []
    for name in (shipped, *(name for name in tuned if is_no_worse(numbers, name, shipped))):
        row = numbers.loc[name]
        settings = str(own[own["design"] == name]["settings"].iloc[0])
        cells = (
            "as it ships" if name == shipped else name,
            f"{row['f1']:.3f}",
            "" if name == shipped else signed(difference(own, name, shipped)),
            f"{row['bytes'] / 1000:.2f}",
            f"{row['edge']:.1f}",
            f"{row['first_ms']:.2f}",
            "every 75 ms" if name == shipped else settings,
        )
        rows.append((-row["f1"], cells))
    heads = ("design", "F1", "less as it ships", "kB up a frame", "edges, s", "first answer, ms")
    return table((*heads, "settings"), [cells for _, cells in sorted(rows)])


def means_of(of_one: pd.DataFrame) -> pd.DataFrame:
    """Held-out means of a condition, by design."""
    return of_one.groupby("design", sort=False)[["f1", "bytes", "edge", "first_ms"]].mean()


def is_no_worse(numbers: pd.DataFrame, name: str, other: str) -> bool:
    """Whether a design is at least as good as another in accuracy, bytes and edge time."""
    one, two = numbers.loc[name], numbers.loc[other]
    return bool(
        one["f1"] >= two["f1"] and one["bytes"] <= two["bytes"] and one["edge"] <= two["edge"]
    )


class MostAccurate:
    """Numbers of each method's most accurate design, as they stand in sentences."""

    def __init__(self, designs: pd.DataFrame) -> None:
        self._conditions = dict(iter(designs.groupby("condition", sort=False)))

    def less(self, condition: str, method: str, other: str, column: str = "f1") -> str:
        """A method less another."""
        own = self._conditions[condition]
        one, two = (accurate(own[own["method"] == name]) for name in (method, other))
        return signed(difference(own, one, two, column))

    def mean(self, condition: str, method: str, column: str) -> float:
        """Over the replicates."""
        own = self._conditions[condition]
        return float(values(own, accurate(own[own["method"] == method]), column).mean())

    def kilobytes(self, condition: str, method: str) -> str:
        """Sent up per frame."""
        return f"{self.mean(condition, method, 'bytes') / 1000:.1f} kB"

    def first_answer(self, method: str) -> str:
        """From the least to the largest mean of all conditions."""
        times = sorted(
            round(self.mean(name, method, "first_ms"))
            for name, own in self._conditions.items()
            if method in set(own["method"])
        )
        return f"{times[0]} ms" if times[0] == times[-1] else f"{times[0]} to {times[-1]} ms"


class AtThePrice(NamedTuple):
    """A design that sends no more than another, and what it is less that."""

    design: str
    kilobytes: str
    f1: str
    edge: str
    energy: str


def at_the_price(of_one: pd.DataFrame, method: str, other: str) -> AtThePrice:
    """The most accurate design of a method, by the tuning set, that sends no more bytes up there
    than the most accurate one of another method.
    """
    limit = of_one[of_one["design"] == accurate(of_one[of_one["method"] == other])]
    own = of_one[of_one["method"] == method]
    design = accurate(own[own["tuning_bytes"] <= limit["tuning_bytes"].iloc[0]])
    target = str(limit["design"].iloc[0])
    return AtThePrice(
        design,
        f"{values(own, design, 'bytes').mean() / 1000:.1f} kB",
        *(signed(difference(of_one, design, target, name)) for name in ("f1", "edge", "energy")),
    )


def conclusions(designs: pd.DataFrame) -> str:
    """What the tables say, with their numbers."""
    of = MostAccurate(designs)
    paced, ships, remote = "paced_remote", LOOKS, "remote"
    edge = 100 * of.mean(LONG, GENIE, "edge") / of.mean(LONG, ships, "edge")
    at_price = at_the_price(designs[designs["condition"] == LONG], paced, GENIE)
    sentences = (
        "**On one recorded street with a link that suffices, paced remote execution with a "
        "tracker is the most accurate**: in F1 the Genie less it is "
        f"{of.less('caches', GENIE, paced)} over [Ethernet](#other-caches), "
        f"{of.less('lte', GENIE, paced)} over LTE, and {of.less(LONG, GENIE, paced)} after "
        "[a longer search](#a-longer-search).",
        "**On drives that nothing was tuned to, none that uses an edge wins**: on streets the "
        f"Genie less paced remote execution is {of.less('streets', GENIE, paced)}, less remote "
        f"execution {of.less('streets', GENIE, remote)}; on pairs of real cars with faster "
        f"detectors it is {of.less('pairs', GENIE, paced)} and "
        f"{of.less('pairs', GENIE, remote)}, and less local execution "
        f"{of.less('pairs', GENIE, 'local')} ([other drives](#other-drives)).",
        f"**The Genie answers first, everywhere**: after {of.first_answer(GENIE)} on average, "
        f"where paced remote execution takes {of.first_answer(paced)} and local execution "
        f"{of.first_answer('local')} (all tables).",
        "**A search makes the Genie cheaper and no less accurate**: with "
        f"{of.kilobytes(LONG, GENIE)} up a frame in place of {of.kilobytes(LONG, ships)} and "
        f"{edge:.0f} % of the edge time, its F1 less that of the Genie as it ships is "
        f"{of.less(LONG, GENIE, ships)} ([longer search](#a-longer-search)).",
        "**At the Genie's bytes paced remote execution is as accurate, and takes more of the "
        f"edge**: its most accurate design that sends no more, {at_price.kilobytes} a frame, less "
        f"the Genie is {at_price.f1} in F1, {at_price.edge} s in edge time and "
        f"{at_price.energy} J a frame, for the Genie's car detects as well "
        "([longer search](#a-longer-search)).",
        "**No cache that compares pictures is worth building here**: less remote execution, "
        f"RND-LRU is {of.less('caches', 'rnd_lru', remote)}, FoggyCache "
        f"{of.less('caches', 'foggycache', remote)} and SIM-LRU "
        f"{of.less('caches', 'sim_lru', remote)}, and at their most accurate they hardly save a "
        "byte ([cold](#other-caches)).",
        "**Warm caches replay the past**: SIM-LRU is "
        f"{of.less('warm', 'sim_lru', GENIE)} and the Genie as published "
        f"{of.less('warm', 'published', GENIE)} from the Genie with paced looks, which ties with "
        f"remote execution ({of.less('warm', GENIE, remote)}, [warm](#other-caches)).",
        "**With ten cars on one edge, batches decide**: one by one the Genie ties with remote "
        f"execution ({of.less('ten', GENIE, remote)}), in fours it loses "
        f"({of.less('ten_fours', GENIE, remote)}, [many cars](#many-cars-on-one-edge)).",
        "**Where raw pictures go over 5G, detect in the car**: less local execution with a "
        f"tracker, remote execution is {of.less('raw_5g', remote, 'local')} and the Genie "
        f"{of.less('raw_5g', GENIE, 'local')} ([raw pictures](#links-and-encodings)).",
        "**In a town, where cars share what they see, the Genie is first, beyond doubt only where "
        f"cars share radio cells**: tuned, it less remote execution is "
        f"{of.less('town', GENIE, remote)} over links of their own and "
        f"{of.less('cell', GENIE, remote)} in cells, as it ships {of.less('town', ships, remote)} "
        f"and {of.less('cell', ships, remote)} ([towns](#towns)).",
    )
    return "\n".join(f"{place}. {text}" for place, text in enumerate(sentences, start=1))


def blocks(designs: pd.DataFrame) -> Mapping[str, str]:
    """Every table of the page, by its place."""
    tables = {
        "conclusions": conclusions(designs),
        "summary": summary(designs),
        "longer": longer(designs),
    }
    for name, own in designs.groupby("condition", sort=False):
        tables[str(name)] = of_condition(own)
    return tables


def figure(designs: pd.DataFrame) -> Figure:
    """Fronts: streaming F1 against bytes up, a panel for each condition."""
    names = list(designs["condition"].unique())
    looks = dict(
        zip(METHODS, style.method_looks([LOOKS_OF.get(x, x) for x in METHODS]), strict=True)
    )
    rows = -(-len(names) // COLUMNS)
    drawn = Figure(figsize=(2.2 * style.COLUMN_IN, 1.8 * rows + 0.6), layout="constrained")
    handles = {}
    for place, name in enumerate(names):
        ax = drawn.add_subplot(rows, COLUMNS, place + 1)
        of_one = designs[designs["condition"] == name]
        for method in METHODS:
            own = of_one[of_one["method"] == method]
            numbers = own.groupby("design", sort=False)[["f1", "bytes"]].mean().sort_values("bytes")
            if len(numbers):
                (handles[method],) = ax.plot(
                    numbers["bytes"] / 1000,
                    numbers["f1"],
                    marker=style.method_marker(looks[method]),
                    color=style.method_colour(looks[method]),
                    linestyle="none",
                    markersize=3,
                )
        ax.set_title(TITLES[name], fontsize=7)
        ax.set_xscale("symlog", linthresh=1)
        ax.set_xlim(left=-0.3)
        ax.set_ylim(bottom=max(MIN_F1, ax.get_ylim()[0]))
        if place >= len(names) - COLUMNS:
            ax.set_xlabel("sent up per frame [kB]", fontsize=7)
        ax.tick_params(labelsize=6)
    drawn.supylabel("streaming F1", fontsize=8)
    shown = [method for method in METHODS if method in handles]
    drawn.legend(
        [handles[method] for method in shown],
        [METHODS[method] for method in shown],
        loc="outside lower center",
        ncols=5,
        fontsize=6,
    )
    return drawn


def write(page: Path = PAGE) -> None:
    """Fills the page and draws its figure."""
    designs = read()
    text = page.read_text(encoding="utf-8")
    for name, block in blocks(designs).items():
        text = filled(text, name, block, str(page))
    page.write_text(text, encoding="utf-8")
    with in_style():
        figure(designs).savefig(FIGURE, metadata={"Software": None})


if __name__ == "__main__":
    write()
