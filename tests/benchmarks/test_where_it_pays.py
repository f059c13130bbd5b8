"""Where a Genie pays: choices follow from the tuning set, and the page says what the files say."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from benchmarks import look_rules
from benchmarks import where_it_pays as study
from benchmarks import where_it_pays_page as page
from benchmarks.speed_page import filled
from genie_sim.core.rules import RECOMMENDED
from genie_sim.study.design import load_design
from genie_sim.units import duration_ns

ROOT = Path(__file__).resolve().parents[2]
NAME = "remote_tracker"  # default: .8, 0


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def tuning(**f1: float) -> pd.DataFrame:
    """Means of streaming F1: ``p80_0`` is that with a p_min of .8 and a tau of 0."""
    rows = []
    for name, value in f1.items():
        p_min, tau_ms = name.removeprefix("p").split("_")
        row = {"method": NAME, "p_min": int(p_min) / 100, "tau_ms": int(tau_ms)}
        rows.append({**row, "streaming_f1": value})
    other = {"method": "local_tracker", "p_min": 0.5, "tau_ms": 100, "streaming_f1": 0.99}
    return pd.DataFrame([*rows, other])


def added(**f1: float) -> pd.DataFrame:
    """Streaming F1 in a condition that the second stage adds, and in one of the first."""
    rows = tuning(**f1)
    first = rows.assign(condition=study.TUNING_LINKS[0], streaming_f1=0.0)
    return pd.concat([rows.assign(condition="LTE, raw"), first])


def test_a_tracker_has_the_best_of_the_first_stage_or_a_default_that_is_nearly_as_good():
    other = added(p80_0=0.9, p90_100=0.1)
    better = tuning(p80_0=0.70, p90_100=0.706, p50_0=0.69)
    assert study.chosen(better, other, NAME) == (0.9, 100)
    nearly = tuning(p80_0=0.70, p90_100=0.7049, p50_0=0.69)
    assert study.chosen(nearly, other, NAME) == (0.8, 0)


def test_the_genie_has_the_best_of_both_stages():
    """Seventeen conditions of the first stage and one of the second."""
    first, even, worse = (
        table[table["method"] == NAME].assign(method=study.GENIE)
        for table in (
            tuning(p70_100=0.700, p90_100=0.710, p50_0=0.99),
            added(p70_100=0.5, p90_100=0.5),
            added(p70_100=0.5, p90_100=0.41),
        )
    )
    assert study.chosen(first, even, study.GENIE) == (0.9, 100)
    assert study.chosen(first, worse, study.GENIE) == (0.7, 100)
    f1 = study.both_stages(first, worse, study.GENIE)
    assert f1[(0.7, 100)] == pytest.approx((17 * 0.7 + 0.5) / 18)


def runs(**values: list[float]) -> pd.DataFrame:
    """Streaming F1 under seeds 1, 2, ... by method, in one condition."""
    rows = [
        {"condition": "here", "seed": seed, "method": method, "streaming_f1": value}
        for method, column in values.items()
        for seed, value in enumerate(column, start=1)
    ]
    return pd.DataFrame(rows)


def test_a_gain_is_over_the_best_method_and_paired_by_seed():
    """Differences .05 and .07 from the remote tracker, whose mean is best: .06, and t(1) = 12.706
    times .01 to each side.
    """
    table = runs(
        local_tracker=[0.70, 0.90],
        remote_tracker=[0.80, 0.84],
        paced_tracker=[0.81, 0.60],
        genie_recommended=[0.85, 0.91],
    )
    gain = page.gain(table, "here")
    assert gain.best == "remote_tracker"
    assert gain.value == pytest.approx(0.06)
    assert (gain.low, gain.high) == pytest.approx((0.06 - 0.12706, 0.06 + 0.12706), abs=1e-4)


def gains(condition: str, *differences: float) -> pd.DataFrame:
    """A condition in which the Genie is so much better under seeds 1, 2, ..."""
    without = {name: [0.5] * len(differences) for name in page.WITHOUT_GENIE}
    genie = [0.5 + difference for difference in differences]
    return runs(**without, genie_recommended=genie).assign(condition=condition)


def test_an_interval_over_drives_takes_the_conditions_of_one_drive_together():
    """Drives .10 and .16, the means of two links each: .13, and t(1) = 12.706 times .03."""
    drives = {"0002, slow": (0.0, 0.16), "0002, fast": (0.12,), "0004, slow": (0.16,)}
    table = pd.concat([gains(name, *values) for name, values in drives.items()])
    assert page.gains_by_drive(table, list(drives)) == {"drives": pytest.approx([0.10, 0.16])}
    text = page.over_drives(table, {"Drives": list(drives)})
    assert text == (
        "- Drives: +0.130 (-0.251 to +0.511 over 2 drives), the worst of 3 conditions +0.080."
    )


def test_every_seed_is_a_town_of_its_own():
    """Towns .02, .03 and .07, the means of two conditions each: .04, t(2) = 4.303 times .0153."""
    table = pd.concat([gains("town, 5G", 0.0, 0.02, 0.06), gains("town, LTE", 0.04, 0.04, 0.08)])
    names = ["town, 5G", "town, LTE"]
    assert page.gains_by_drive(table, names) == {"towns": pytest.approx([0.02, 0.03, 0.07])}
    text = page.over_drives(table, {"Town": names})
    assert text.startswith("- Town: +0.040 (-0.026 to +0.106 over 3 towns), the worst of 2 ")


def test_a_mean_over_drives_and_towns_has_both_spreads():
    """Weights 3/4 and 1/4: .75 * .13 + .25 * .04 = .1075. Variances .75^2 * .03^2 of one degree of
    freedom and .25^2 * .01528^2 of two: hardly more than one together.
    """
    value, half = page.stratified([(0.75, [0.10, 0.16]), (0.25, [0.02, 0.03, 0.07])])
    spread = (0.0225**2 + (0.25 * 0.0152753) ** 2) ** 0.5
    assert (value, half) == pytest.approx((0.1075, 12.7062 * spread), rel=1e-4)
    even, half = page.stratified([(0.5, [0.1, 0.3]), (0.5, [0.1, 0.3])])
    assert (even, half) == pytest.approx((0.2, 4.3027 * 0.5 * (2 * 0.01) ** 0.5), rel=1e-4)


def test_the_sweep_and_the_preset_have_the_chosen_settings():
    stages = [pd.read_csv(study.OUT / f"{name}.csv") for name in ("choose", "second")]
    entries = {entry["name"]: entry for entry in load_design("where_it_pays").settings["methods"]}
    for name in study.WITHOUT_GENIE:
        consumer = entries[name]["consumer"]
        if consumer == "tracker":
            consumer = {"p_min": 0.8, "tau": "0 ms"}
        own = consumer["p_min"], duration_ns(consumer["tau"]) // 1_000_000
        assert own == study.chosen(*stages, name), name
    freshness = RECOMMENDED["object_map"]["freshness"]
    own = freshness["p_min"], duration_ns(freshness["tau"]) // 1_000_000
    assert own == study.chosen(*stages, study.GENIE)


def test_the_page_says_what_the_files_say():
    text = page.PAGE.read_text(encoding="utf-8")
    for name, block in page.blocks(*page.read()).items():
        assert filled(text, name, block, str(page.PAGE)) == text, name


def test_the_page_of_policies_says_what_their_files_say():
    text = page.FRESHNESS_PAGE.read_text(encoding="utf-8")
    for name, block in page.freshness_blocks().items():
        assert filled(text, name, block, str(page.FRESHNESS_PAGE)) == text, name


def test_rules_are_compared_by_their_means_and_their_worst_condition():
    rows = [
        {"condition": name, "rule": rule, "parameter": parameter, "f1_less_usual": lost}
        for rule, parameter, losses in (("fixed", 150.0, (0.01, -0.03)), ("new", None, (0.0, 0.2)))
        for name, lost in zip(("here", "there"), losses, strict=True)
    ]
    table = pd.DataFrame(rows).assign(bytes_of_usual=[0.4, 0.6, 0.7, 0.8])
    lines = look_rules.table(table).splitlines()
    assert lines[2] == "| `fixed` | 150 ms | 50 | -0.010 | -0.030 |"
    assert lines[3] == "| `new` |  | 75 | +0.100 | +0.000 |"
