"""The figures of the paper's Section V over all seeds, in the paper's arrangement: homogeneous above heterogeneous."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis import figures, metrics
from genie_sim.paper import sensitivity
from genie_sim.paper.checks import ALL, CASE, HE, HO
from genie_sim.paper.facts import METHODS
from genie_sim.paper.replicate import Outcome
from genie_sim.recording.columns import Columns, Text, concat

TITLES = {name: f"{name[0]} car{'s' if name[0] > '1' else ''}, {'hetero.' if name in HE else 'homo.'}" for name in ALL}
WRAPPED = {name: title.replace(", ", "\n") for name, title in TITLES.items()}


def draw_paper_figures(folder: Path, tables: Mapping[str, Sequence[Outcome]], footer: str) -> None:
    """Response times, reuse, confidence boost and the case study, as SVG and PNG. Raises OSError."""
    frames = {TITLES[name]: _pooled(tables[name], "frames") for name in (*HO, *HE)}
    lookups = {WRAPPED[name]: _pooled(tables[name], "lookups") for name in (*HO, *HE)}
    one_seed = {TITLES[name]: _table(tables[name][0], "lookups") for name in (*HO, *HE)}
    one = f"{footer}; the first seed"
    figures.save(figures.latency_cdf(frames, METHODS, footer, of="answered"), folder, "latency_cdf")
    figures.save(figures.latency_cdf(frames, METHODS, footer), folder, "latency_cdf_of_published")
    figures.save(figures.image_reuse(lookups, METHODS, footer), folder, "image_reuse")
    figures.save(figures.object_reuse(lookups, METHODS, footer), folder, "object_reuse")
    figures.save(figures.confidence_boost(one_seed, METHODS, one), folder, "confidence_boost")
    figures.save(_case_study(tables[CASE], footer), folder, "case_study")


def _case_study(outcomes: Sequence[Outcome], footer: str) -> Any:
    frames = _pooled(outcomes, "frames")
    lookups = _table(outcomes[0], "lookups")
    genie = frames.where(method="genie")
    times = {}
    for car, label in (("car2", "car2, no cameras"), ("car1", "car1, cameras")):
        values = metrics.response_ms(genie.where(car=car), "first")
        times[label] = values[~np.isnan(values)]
    reuse = {
        "objects, car2 (no cameras)": _running(lookups, "car2/genie", image=False),
        "images, car1 (cameras)": _running(lookups, "car1/genie", image=True),
    }
    return sensitivity.case_study(times, reuse, f"{footer}; reuse: the first seed")


def _running(lookups: Columns, genie: str, image: bool) -> tuple[Any, Any]:
    mine = (lookups["genie"] == genie) & ((lookups["kind"] == "image") == image) & (lookups["requests"] > 0)
    events = lookups.rows(mine)
    hits, requests = (np.cumsum(events.floats(name)) for name in ("hits", "requests"))
    return np.arange(1, len(events) + 1), hits / requests


def _pooled(outcomes: Sequence[Outcome], table: str) -> Columns:
    """All seeds in one table; each seed's Genies are Genies of their own, so bars are means over Genies and seeds."""
    parts = []
    for number, outcome in enumerate(outcomes):
        part = _table(outcome, table)
        if "genie" in part.names:
            genies = part["genie"]
            part = part.assign(genie=Text.of(genies.codes, [f"{genie}#{number}" for genie in genies.names]))
        parts.append(part)
    return concat(parts)


def _table(outcome: Outcome, name: str) -> Columns:
    found: Columns | None = getattr(outcome, name)
    assert found is not None, "base runs keep their tables"
    return found
