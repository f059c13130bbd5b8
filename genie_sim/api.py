"""genie-sim as a library.

>>> import genie_sim as gs
>>> run = gs.run("3car_hetero", {"cars[0].device": "orin_nano"}, seed=7)
>>> run.frames, run.lookups, run.metrics        # pandas tables
>>> run.figures.latency_cdf()                   # a matplotlib figure
>>> run.report("report.html")                   # one page for a browser
>>> gs.load("results/3car_hetero-2a7842fdfa41") # a run of the command line

What is wrong with the input raises ``gs.UserError``, with one line that names field, value and choices.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from genie_sim import runner
from genie_sim.errors import UserError
from genie_sim.paths import expanded
from genie_sim.recording.results import Figures, Run, load
from genie_sim.runner import Progress
from genie_sim.scenario import scenario
from genie_sim.scenario.scenario import Scenario

__all__ = ["Figures", "Run", "Scenario", "UserError", "load", "load_scenario", "run"]

Settings = Mapping[str, Any] | Sequence[str]


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    settings: Settings = (),
    *,
    seed: int | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> Run:
    """Simulates a scenario: a file or a shipped name, the same as a mapping, or one from ``load_scenario``.

    ``settings`` change single fields, as ``--set`` does: ``{"genie.eviction": "lru", "cars[0].link": "wifi"}``.
    ``seed`` is the root of all random streams (default: the scenario's). The run stays in memory, unless ``out`` names
    a folder that gets its result folder. ``progress`` is called with the seconds simulated, those to simulate, and the
    method. Raises ``UserError`` before anything is simulated.
    """
    setting = load_scenario(scenario, settings, seed=seed)
    if out is None:
        return runner.run_in_memory(setting, progress)
    return load(runner.run_to_folder(setting, expanded(out), progress).folder)


def load_scenario(
    source: str | Path | Mapping[str, Any] | Scenario, settings: Settings = (), *, seed: int | None = None
) -> Scenario:
    """A scenario, checked: a file or a shipped name, a mapping as in YAML, or another scenario, with ``settings``.

    Raises ``UserError``.
    """
    overrides = _overrides(settings)
    if isinstance(source, str | Path):
        return scenario.load_scenario(source, overrides, seed)
    if isinstance(source, Scenario):
        source = source.model_dump(mode="json", by_alias=True)
    return scenario.read_scenario({"name": "scenario", **source}, overrides, seed)


def _overrides(settings: Settings) -> Sequence[str]:
    """``path=value`` texts; a value becomes JSON, which is YAML too."""
    if isinstance(settings, str):
        raise UserError(f"settings: must be a mapping or a list such as ['seed=3'], not the text {settings!r}")
    if not isinstance(settings, Mapping):
        return settings
    return [f"{path}={json.dumps(value)}" for path, value in settings.items()]
