"""Tunes a Genie with Optuna: the front of two metrics on some seeds, reported on others.

    python search_settings.py [FOLDER]

Optuna proposes batches of designs, and each batch is a sweep whose finished runs are kept. A search
that was killed therefore goes on: the same seed proposes the same designs.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import optuna
import pandas as pd

import genie_sim as gs

SCENARIO = "street_2car_homo"
FIXED = {"cars[*].route.window": ["0 s", "2 s"], "record": ["held"]}
METRICS: dict[str, Literal["maximize", "minimize"]] = {
    "streaming_f1": "maximize",
    "bytes_up_per_frame": "minimize",
}
TUNING, HELD_OUT = (1, 2), (3, 4, 5)  # seeds
BATCHES, BATCH = 3, 4

Designs = dict[str, dict[str, Any]]  # settings by the design's name


def design(trial: optuna.Trial) -> dict[str, Any]:
    """The settings of a design. An ``if`` here makes a parameter depend on another."""
    object_map = {
        "rate": trial.suggest_float("rate", 0.05, 1.0),
        "rule": trial.suggest_categorical("rule", ["noisy_or", "ema"]),
    }
    return {"methods": [{"name": "genie", "method": "genie", "genie": {"object_map": object_map}}]}


def measure(designs: Designs, seeds: Sequence[int], folder: Path) -> pd.DataFrame:
    """Mean and 95 % interval over the seeds: a row for each design and metric."""
    axes = {"design": {"list": designs}}
    table = gs.sweep(SCENARIO, axes, FIXED, seeds=list(seeds), out=folder).metrics
    shown = table["metric"].isin(METRICS) & (table["placement"] == "all")
    return table[shown & (table["component"] == "")].set_index(["design", "metric"])


def search(
    folder: Path, batches: int = BATCHES, batch: int = BATCH
) -> tuple[Mapping[str, dict[str, Any]], pd.DataFrame]:
    """The parameters of the designs on the front of ``METRICS`` over the seeds ``TUNING``, by the
    design's name, and their metrics over ``HELD_OUT``, which the search has not seen.
    """
    sampler = optuna.samplers.TPESampler(seed=1, multivariate=True, group=True)
    study = optuna.create_study(directions=list(METRICS.values()), sampler=sampler)
    designs: Designs = {}
    for number in range(batches):
        trials = {f"genie-{trial.number}": trial for trial in (study.ask() for _ in range(batch))}
        proposed = {name: design(trial) for name, trial in trials.items()}
        tuning = measure(proposed, TUNING, folder / f"tuning-{number}")
        for name, trial in trials.items():
            study.tell(trial, [float(tuning["value"][name, metric]) for metric in METRICS])
        designs |= proposed
    front = {f"genie-{trial.number}": trial.params for trial in study.best_trials}
    return front, measure({name: designs[name] for name in front}, HELD_OUT, folder / "held-out")


def main(folder: Path) -> None:
    """Prints the front, and what each of its designs is worth on the held-out seeds."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    front, held_out = search(folder)
    print(pd.DataFrame(front).T, end="\n\n")
    print(held_out[["value", "low", "high"]].unstack().round(4).to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tuned"))
