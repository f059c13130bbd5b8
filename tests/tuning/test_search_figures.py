"""Figures of a search of made-up numbers look as they did."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from genie_sim.tuning import figures
from genie_sim.tuning.design import SearchDesign, load
from tests import outline
from tests.tuning.test_search_of_scenarios import SHORT, SPACE

TITLES = {"remote": "remote (R)", "genie": "Genie (DG)"}
METRICS = ("streaming_f1", "first_answer_p95", "ghost_share")


def design(minimize: list[str]) -> SearchDesign:
    genie = {
        "method": "genie",
        "space": {"rate": {"set": "genie.object_map.rate", "range": {"from": 0.1, "to": 0.9}}},
    }
    objectives = {"maximize": "streaming_f1", "minimize": minimize}
    methods = {"remote": SPACE, "genie": genie}
    return load({**SHORT, "name": "made_up", "methods": methods, "objectives": objectives})


def designs() -> pd.DataFrame:
    """Four tuned designs and one as it is for each method; intervals are not symmetric."""
    rows = []
    for place, method in enumerate(TITLES):
        for number in range(5):
            row: dict[str, Any] = {"method": method, "tuned": number < 4}
            for column, metric in enumerate(METRICS):
                value = (0.2 + 0.1 * number + 0.05 * place) * (100 if column == 1 else 1)
                row |= {metric: value, f"{metric} low": 0.9 * value, f"{metric} high": 1.2 * value}
            remote = method == "remote"
            row["queue"] = float(1 + number) if remote else np.nan
            row["consumer"] = ("newest", "tracker")[number % 2] if remote else None
            row["same"] = 7.0
            row["rate"] = np.nan if remote else 0.1 * (1 + number)
            rows.append(row)
    return pd.DataFrame(rows)


def importance() -> pd.DataFrame:
    shares = {"queue": 0.7, "consumer": 0.2}
    return pd.DataFrame(
        [
            {
                "method": "remote",
                "metric": metric,
                "parameter": parameter,
                "value": share + 0.02 * number,
                "low": share - 0.1,
                "high": share + 0.05 + 0.02 * number,
            }
            for number, metric in enumerate(METRICS)
            for parameter, share in shares.items()
        ]
    )


def test_the_front_the_designs_and_what_mattered():
    three = design(["first_answer_p95", "ghost_share"])
    drawn = dict(figures.of_search(three, designs(), importance(), TITLES))
    assert list(drawn) == ["front", "parallel-remote", "importance-remote", "parallel-genie"]
    outline.check("search", drawn)


def test_one_objective_has_no_front():
    drawn = dict(figures.of_search(design([]), designs(), importance(), TITLES))
    assert "front" not in drawn and "parallel-genie" in drawn
