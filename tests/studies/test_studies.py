"""The studies can be run: their files are scenarios, and what their programs compute is right."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from genie_sim.api import load_scenario
from genie_sim.data import v2v4real
from genie_sim.data.v2v4real import recordings
from genie_sim.paper.facts import Fact, placed
from genie_sim.scenario import reading as scenarios
from genie_sim.study.design import load_design
from studies import baselines, real_pairs, where_it_pays
from studies.real_pairs import HELD_OUT, TUNING
from tests.checkout import REPOSITORY
from tests.data import made_up_pair as street

STUDIES = REPOSITORY / "studies"
# those beside a program of the same name are read by it
SWEEPS = sorted(p for p in STUDIES.glob("*.yaml") if not p.with_suffix(".py").is_file())


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPOSITORY)


@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_every_point_of_a_sweep_is_a_scenario(path: Path):
    for point in load_design(path).points():
        scenarios.load_scenario(point.scenario, point.overrides)


@pytest.mark.parametrize("name", [*where_it_pays.WITHOUT_GENIE, where_it_pays.GENIE])
def test_a_method_gets_the_settings_of_its_tracks(name: str):
    methods = [where_it_pays.tuned(name, 0.6, 100, "tuned")]
    scenario = load_scenario("street_3car_hetero", {"methods": methods})
    (setting,) = scenario.method_settings.values()
    if name == where_it_pays.GENIE:
        tracks = setting.genie.object_map.freshness.parameters
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


def test_scores_are_chosen_on_the_tuning_set_without_sharing():
    """On the tuning set 0.3 is best; 0.4 would be on the held-out set, or with sharing."""
    rows = []
    for sequence in (*TUNING, *HELD_OUT):
        for score, tuning, held_out in ((0.2, 0.5, 0.5), (0.3, 0.8, 0.6), (0.4, 0.7, 0.9)):
            for sharing in ("without", "with"):
                f1 = held_out if sequence in HELD_OUT or sharing == "with" else tuning
                rows.append((sequence, score, "paper", "genie", sharing, f1))
    keys = ["sequence", "score", "hardware", "method", "sharing"]
    rows = real_pairs.chosen(pd.DataFrame(rows, columns=[*keys, "streaming_f1"]))
    assert set(rows["score"]) == {0.3} and len(rows) == 2 * 9


def test_what_both_cars_detect_is_counted_once(tmp_path: Path):
    """On the made-up street each car detects all others: together they know nothing twice."""
    street.write(tmp_path, "train/0012", frames=30)
    pair = recordings(tmp_path, "train/0012", partner=street.PARTNER)
    for car in pair:
        own, both = (real_pairs.counted(pair, car, 0.2, together) for together in (False, True))
        assert own[2] == both[2] > 0 and own[0] <= both[0] <= both[2]
        assert both[1] <= 1.02 * own[1], "but at the end of the range"
    few = [real_pairs.counted(pair, "ego", 0.6, together) for together in (False, True)]
    assert few[1][0] > 1.2 * few[0][0], "what one misses the other sees"


@pytest.mark.slow
def test_sharing_is_a_sweep_over_the_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """On a made-up pair, with one score, one seed and the fast methods."""
    data = tmp_path / "data"
    street.write(data, "train/0012", frames=30)
    monkeypatch.setenv("GENIE_SIM_V2V4REAL", str(data))
    monkeypatch.setitem(v2v4real.PARTNERS, "train/0012", street.PARTNER)
    monkeypatch.setattr(real_pairs, "OUT", tmp_path / "out")
    monkeypatch.setattr(real_pairs, "SEQUENCES", ("train/0012",))
    monkeypatch.setattr(real_pairs, "HELD_OUT", ("train/0012",))
    monkeypatch.setattr(real_pairs, "SCORES", (0.2,))
    monkeypatch.setattr(real_pairs, "SEEDS", (1,))
    monkeypatch.setattr(real_pairs, "METHODS", ["local", "genie"])
    real_pairs.traces()
    real_pairs.sharing()
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines if "adds" in line] == [
        "paper, local",
        "paper, genie",
        "modern, local",
        "modern, genie",
    ]


def test_claims_compare_two_cars_with_one():
    one, two = (
        {
            placed("object_reuse", "car"): reuse,
            placed("object_reuse", "edge"): reuse,
            placed("image_reuse", "car"): 0.1,
            placed("image_reuse", "edge"): 0.15,
            placed("image_reuse_high", "car"): high,
            placed("image_peak_at", "car"): 0.2,
            placed("confidence_boost", "edge"): boost,
        }
        for reuse, high, boost in ((0.5, 0.2, 0.04), (0.4, 0.26, 0.03))
    )
    facts: dict[int, dict[Fact, float]] = {1: one, 2: two}
    expected = {"C14": 0.1, "C18": 0.05, "C20": 0.06, "C23": -0.01}
    assert real_pairs.effects(facts) == pytest.approx(expected)
