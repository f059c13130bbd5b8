"""The studies can be run: their files are scenarios, and what their programs compute is right."""

from __future__ import annotations

import pandas as pd
import pytest

from genie_sim.api import load_scenario
from genie_sim.study.design import load_design
from studies import baselines, where_it_pays
from tests.checkout import REPOSITORY


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPOSITORY)


@pytest.mark.parametrize("name", [*where_it_pays.WITHOUT_GENIE, where_it_pays.GENIE])
def test_a_method_gets_the_settings_of_its_tracks(name: str):
    methods = [where_it_pays.tuned(name, 0.6, 100, "tuned")]
    scenario = load_scenario("street_3car_hetero", {"methods": methods})
    (setting,) = scenario.method_settings.values()
    if name == where_it_pays.GENIE:
        tracks = scenario.methods[0].method.parameters
        settings = tracks["p_min"], tracks["tau_ns"]
    else:
        settings = setting.consumer.p_min, setting.consumer.tau_ns
    assert settings == (0.6, 100_000_000)


def gains_of(**differences: list[float]) -> dict[str, pd.Series]:
    """What the Genie gains by condition, under seeds 1, 2, ..."""
    return {
        name: pd.Series(values, index=range(1, len(values) + 1), dtype=float)
        for name, values in differences.items()
    }


def test_a_gain_is_over_the_best_method_and_paired_by_seed():
    """Differences .05 and .07 from the remote tracker, whose mean is best; half of its bytes."""
    f1 = {
        "local_tracker": [0.70, 0.90],
        "remote_tracker": [0.80, 0.84],
        "paced_tracker": [0.81, 0.60],
        where_it_pays.GENIE: [0.85, 0.91],
    }
    index = pd.MultiIndex.from_product(
        [["here"], [1, 2], f1], names=["condition", "seed", "method"]
    )
    runs = pd.DataFrame(dict.fromkeys(where_it_pays.SHOWN, 2.0), index)
    for name, values in f1.items():
        runs.loc[pd.IndexSlice[:, :, name], "streaming_f1"] = values
    runs.loc[pd.IndexSlice[:, :, where_it_pays.GENIE], "bytes_up_per_frame"] = 1.0
    (row,), of_condition = where_it_pays.gains(runs, "")
    assert of_condition["here"].tolist() == pytest.approx([0.05, 0.07])
    assert (row["best"], row["bytes_of_remote"], row["energy_of_remote"]) == (
        "remote_tracker",
        0.5,
        1,
    )
    assert (row["gain"], row["best_f1"]) == pytest.approx((0.06, 0.82))


def test_a_mean_over_drives_and_towns_has_both_spreads():
    """Drives .10 (of two conditions) and .16, towns .02, .03 and .07 (of two conditions): weights
    3/5 and 2/5. Variances .6^2 * .03^2 of one degree of freedom and .4^2 * .01528^2 of two: hardly
    more than one together, so t(1) = 12.706.
    """
    drives = gains_of(
        **{"0002, slow": [0.0, 0.16], "0002, fast": [0.12, 0.12], "0004, slow": [0.16, 0.16]}
    )
    towns = gains_of(**{"town, 5G": [0.0, 0.02, 0.06], "town, LTE": [0.04, 0.04, 0.08]})
    mean, half = where_it_pays.over_all(drives, towns)
    spread = ((0.6 * 0.03) ** 2 + (0.4 * 0.0152753) ** 2) ** 0.5
    assert (mean, half) == pytest.approx((0.6 * 0.13 + 0.4 * 0.04, 12.7062 * spread), rel=1e-4)


def test_genie_pays_for_its_key_and_for_its_map():
    scenario = load_scenario("baselines", {"methods": baselines.methods(94_800)})
    entries = {entry.name: entry for entry in scenario.methods}
    paying, free = (scenario.method_settings[name].genie for name in ("genie", "genie_free"))
    assert (paying.capacity.bytes, free.capacity.bytes) == (905_200, 1_000_000)
    assert entries["genie"].method.name == "studies.baselines:PayingGenie"
    assert len(entries) == len(load_design("baselines").settings["methods"]) + 1
