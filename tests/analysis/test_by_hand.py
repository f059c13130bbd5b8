"""Every metric that tables show, computed anew from the Parquet tables of a short run with pandas
alone, as its meaning says: no function of the package takes part.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from genie_sim.analysis.metric import MAIN
from genie_sim.analysis.registry import METRICS
from genie_sim.report.output import Output
from genie_sim.runs.folder import run_to_folder
from genie_sim.scenario.reading import load_scenario

Tables = dict[str, pd.DataFrame]
CACHES = ("own_cache", "edge_cache", "peer_cache")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cars and two edges for three seconds."""
    windows = [f"cars[{car}].route.window=[0 s, 3 s]" for car in range(2)]
    scenario = load_scenario("street_2car_hetero", windows)
    return run_to_folder(scenario, tmp_path_factory.mktemp("run"), output=Output(False)).folder


def taken_ms(frames: pd.DataFrame, answer: str) -> pd.Series:
    return (frames[f"{answer}_answer_ns"] - frames["stamp_ns"]).dropna() / 1e6


def age_ms(frames: pd.DataFrame) -> pd.Series:
    return ((frames["stamp_ns"] - frames["first_looked_ns"]).dropna() / 1e6).clip(lower=0)


def reuse(rows: pd.DataFrame) -> float:
    """hits / requests of each Genie, mean over Genies."""
    sums = rows.groupby("genie", observed=True)[["hits", "requests"]].sum()
    return float((sums["hits"] / sums["requests"])[sums["requests"] > 0].mean())


def maps(lookups: pd.DataFrame) -> pd.DataFrame:
    return lookups[lookups["kind"] != "image"]


def stored(lookups: pd.DataFrame) -> int:
    return int(maps(lookups).groupby("genie", observed=True)["entries"].last().sum())


def wrong(answers: pd.DataFrame) -> float:
    hits = answers[(answers["which"] == "result") & answers["source"].isin(CACHES)]
    return float((2 * hits["matched"] < 0.8 * (hits["served"] + hits["detected"])).mean())


def f1(held: pd.DataFrame) -> float:
    visible = held["visible_static"].sum() + held["visible_moving"].sum()
    return float(2 * held["right"].sum() / (held["held"].sum() + visible))


def proxy_f1(answers: pd.DataFrame) -> float:
    first = answers[answers["which"] == "first"]
    return float(2 * first["matched"].sum() / (first["served"].sum() + first["detected"].sum()))


def joules(hosts: pd.DataFrame, frames: pd.DataFrame, power: pd.DataFrame) -> float:
    """Of each host its powers times how long it is there, works and sends."""
    watts = power.set_index(["kind", "name", "part"])["value"]
    instants = ["stamp_ns", "first_answer_ns", "fresh_answer_ns", "result_answer_ns"]
    ends_ns = frames.groupby("car", observed=True)[instants].max().max(axis=1)
    total = 0.0
    for host in hosts.itertuples():
        on_car = host.placement == "car"
        there_s = ((ends_ns[host.host] if on_car else ends_ns.max()) - host.begin_ns) / 1e9
        device = watts["device"][host.device]
        total += device["idle"] * there_s + device["accelerator"] * host.accelerator_ns / 1e9
        total += device["core"] * host.cpu_ns / 1e9
        if isinstance(host.interface, str):
            part = watts["interface"][host.interface]
            total += part["port"] * there_s + part["transfer"] * host.transfer_ns / 1e9
            total += part["tail"] * host.tail_ns / 1e9
            total += (part["up"] * host.bytes_up + part["down"] * host.bytes_down) * 8e-6
    return total


BY_HAND: dict[str, Callable[[Tables], float]] = {
    "first_answer_mean": lambda t: taken_ms(t["frames"], "first").mean(),
    "first_answer_p95": lambda t: taken_ms(t["frames"], "first").quantile(0.95),
    "under_deadline_share": lambda t: (
        (taken_ms(t["frames"], "first") < 33).sum() / len(t["frames"])
    ),
    "fresh_answer_mean": lambda t: taken_ms(t["frames"], "fresh").mean(),
    "fresh_answered_share": lambda t: t["frames"]["fresh_answer_ns"].notna().mean(),
    "look_age_mean": lambda t: age_ms(t["frames"]).mean(),
    "recent_share": lambda t: (
        (t["frames"]["stamp_ns"] - t["frames"]["looked_ns"]) <= 100_000_000
    ).mean(),
    "dropped_share": lambda t: (
        t["frames"]["first_answer_ns"].isna() & t["frames"]["drop"].notna()
    ).mean(),
    "image_reuse": lambda t: reuse(t["lookups"][t["lookups"]["kind"] == "image"]),
    "image_reuse_own": lambda t: reuse(
        t["lookups"][(t["lookups"]["kind"] == "image") & (t["lookups"]["requester"] == "client")]
    ),
    "object_reuse": lambda t: reuse(maps(t["lookups"])),
    "confidence_boost": lambda t: maps(t["lookups"])["boost_sum"].sum() / stored(t["lookups"]),
    "boost_per_sighting": lambda t: (
        maps(t["lookups"])["boost_sum"].sum() / maps(t["lookups"])["updates"].sum()
    ),
    "streaming_f1": lambda t: f1(t["held"]),
    "ghost_share": lambda t: 1 - t["held"]["right"].sum() / t["held"]["held"].sum(),
    "first_proxy_f1": lambda t: proxy_f1(t["answers"]),
    "wrong_hit_share": lambda t: wrong(t["answers"]),
    "bytes_up_per_frame": lambda t: t["hosts"]["bytes_up"].sum() / len(t["frames"]),
    "accelerator_time": lambda t: t["hosts"]["accelerator_ns"].sum() / 1e9,
    "energy_per_frame": lambda t: joules(t["hosts"], t["frames"], t["power"]) / len(t["frames"]),
}


@functools.cache
def of_method(folder: Path, method: str, placement: str) -> Tables:
    """The rows of one method; look-ups of one placement, and what consumers hold."""
    tables = {}
    for path in folder.glob("*.parquet"):
        table = pd.read_parquet(path)
        if "method" in table:
            tables[path.stem] = table[table["method"] == method]
    tables["held"] = tables["held"][tables["held"]["what"] == "consumer"]
    if placement != "all":
        tables["lookups"] = tables["lookups"][tables["lookups"]["placement"] == placement]
    return tables


@pytest.mark.slow
def test_every_shown_metric_is_what_its_meaning_says(folder: Path):
    shown = {name for name, metric in METRICS.items() if metric.tier <= MAIN}
    assert shown == {*BY_HAND, "utilization"}, "that is tested by hand in test_metrics"
    measured = pd.read_json(folder / "metrics.json")
    compared = set()
    for row in measured[measured["component"] == ""].itertuples():
        whole_only = row.placement != "all" and METRICS[row.metric].section != "Genies"
        if row.metric in BY_HAND and not whole_only and pd.notna(row.value):
            expected = BY_HAND[row.metric](of_method(folder, row.method, row.placement))
            assert row.value == pytest.approx(expected, rel=1e-9), row
            compared.add(row.metric)
    assert compared == set(BY_HAND), "each has a number in this run"
