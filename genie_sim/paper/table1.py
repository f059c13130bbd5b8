"""Table I of the paper, as printed, and our device profiles beside it."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import read_mapping

ROUNDING = 0.0051  # two decimals


@dataclass(frozen=True, slots=True)
class TableCell:
    """One model on one device: printed and our milliseconds (``None``: out of memory), printed and
    right speed-up.
    """

    model: str
    device: str
    printed_ms: float | None
    ours_ms: float | None
    printed_speedup: float | None
    speedup: float | None

    @property
    def misprinted(self) -> bool:
        if self.printed_speedup is None or self.speedup is None:
            return self.printed_speedup is not self.speedup
        return abs(self.printed_speedup - self.speedup) > ROUNDING

    def __str__(self) -> str:
        """As printed; a misprinted speed-up is followed by the right one in bold."""
        if self.printed_ms is None:
            return "out of memory"
        right = f" **{self.speedup:.2f}x**" if self.misprinted else ""
        return f"{self.printed_ms:.2f} / {self.printed_speedup:.2f}x{right}"


@cache
def _printed() -> dict[str, Any]:
    return read_mapping(Path(__file__).with_name("table1.yaml"))


def devices() -> dict[str, str]:
    """The device profile of each column."""
    profiles: dict[str, str] = _printed()["devices"]
    return profiles


def cells() -> list[TableCell]:
    """All 24 cells; the speed-up is over the slowest device that can run the model, as the caption
    says.
    """
    table = []
    for model, row in _printed()["models"].items():
        times = [(ms, speedup) for ms, speedup in (cell or (None, None) for cell in row["cells"])]
        slowest = max(ms for ms, _ in times if ms is not None)
        for (column, name), (ms, speedup) in zip(devices().items(), times, strict=True):
            median_ns = load_profile(name).models[row["profile"]].median_ns
            ours_ms = None if median_ns is None else median_ns / 1e6
            right = None if ms is None else slowest / ms
            table.append(TableCell(model, column, ms, ours_ms, speedup, right))
    return table


def markdown() -> str:
    """The table with its printed speed-ups."""
    rows: dict[str, list[str]] = {}
    for cell in cells():
        rows.setdefault(cell.model, []).append(str(cell))
    lines = [["model", *devices()], *([model, *texts] for model, texts in rows.items())]
    table = renderers.markdown_rows(lines, [False] * len(devices()))
    legend = (
        "Milliseconds / speed-up over the slowest device. Bold: what the printed one should be."
    )
    return f"{table}\n\n{legend}"
