"""Measured latencies become a device profile that a scenario can use."""

from __future__ import annotations

import math
import re
from itertools import cycle
from statistics import NormalDist

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.base.units import NS_PER_MS
from genie_sim.cli.main import main
from genie_sim.runs.build import detector_time
from genie_sim.scenario import device_fit
from genie_sim.scenario.profiles import load_profile
from genie_sim.sim.device import ServiceTime
from tests.kitti_folder import make_network


def drawn(median_ms, loc, sigma, count=5000, seed=1):
    law = ServiceTime(round(median_ms * NS_PER_MS), loc, sigma)
    rng = np.random.default_rng(seed)
    return np.array([law.at(z) for z in rng.standard_normal(count)], dtype=float)


@pytest.mark.parametrize(("loc", "sigma"), [(0.85, 0.6), (0.6, 0.5), (0.8, 0.85)])
def test_the_law_that_made_the_times_is_found_again(loc, sigma):
    """The device profiles' own laws, 5000 draws: quantiles within 2 %, median within 1 %."""
    fitted = device_fit.fit(drawn(65, loc, sigma))
    print(fitted)
    assert fitted.median_ns == pytest.approx(65e6, rel=0.01)
    for z in (-2.0, -1.0, 1.0, 2.0):
        wanted = loc + (1 - loc) * math.exp(sigma * z)
        assert fitted.loc + (1 - fitted.loc) * math.exp(fitted.sigma * z) == pytest.approx(
            wanted, rel=0.02
        )
    assert fitted.gap < 0.03


@pytest.mark.parametrize(("loc", "sigma"), [(0.2, 0.5), (0.5, 1.2), (0.9, 0.85)])
def test_location_and_sigma_of_the_law_are_found(loc, sigma):
    """20,000 draws: location within 0.05, sigma within 10 %."""
    fitted = device_fit.fit(drawn(65, loc, sigma, count=20_000))
    print(fitted)
    assert fitted.loc == pytest.approx(loc, abs=0.05)
    assert fitted.sigma == pytest.approx(sigma, rel=0.1)


@pytest.mark.slow
def test_no_other_law_is_closer_in_the_logarithm():
    """Where no law fits, a tail of 5 % that is ten times as slow: against a grid of laws."""
    latencies_ns = np.concatenate([drawn(10, 0.6, 0.3, count=950), drawn(100, 0.6, 0.3, count=50)])
    shares = np.arange(0.01, 1.0, 0.01)
    measured = np.quantile(latencies_ns / np.median(latencies_ns), shares)
    z = np.array([NormalDist().inv_cdf(share) for share in shares])

    def misfit(loc, sigma):
        return np.square(np.log((loc + (1 - loc) * np.exp(sigma * z)) / measured)).sum()

    fitted = device_fit.fit(latencies_ns)
    grid = [(loc, sigma) for loc in np.arange(0, 1, 0.02) for sigma in np.arange(0.02, 3, 0.02)]
    assert misfit(fitted.loc, fitted.sigma) <= min(misfit(*law) for law in grid) + 1e-3


@pytest.mark.slow
def test_the_ratios_are_the_laws_quantiles_by_the_measured_ones():
    """A tail of 5 % that is ten times as slow, which no law of one hump reaches."""
    latencies_ns = np.concatenate([drawn(10, 0.6, 0.3, count=950), drawn(100, 0.6, 0.3, count=50)])
    fitted = device_fit.fit(latencies_ns)
    for ratio, share in ((fitted.p95, 0.95), (fitted.p99, 0.99)):
        law = fitted.loc + (1 - fitted.loc) * math.exp(fitted.sigma * NormalDist().inv_cdf(share))
        measured = np.quantile(latencies_ns, share) / np.median(latencies_ns)
        assert ratio == pytest.approx(law / measured, rel=0.01)
    assert max(abs(fitted.p95 - 1), abs(fitted.p99 - 1)) > 0.1  # else either way round would do


class SlowAtFirst:
    """A detector whose first calls take a second, all others a millisecond, by its own clock."""

    name, size, sha256 = "slow_at_first", (1, 1), "0" * 64

    def __init__(self):
        self.calls, self.now_ns = 0, 0

    def detect(self, image_bgr):
        self.now_ns += 10**9 if self.calls < device_fit.WARM_UP else 10**6
        self.calls += 1
        return []


def test_the_first_runs_do_not_count(monkeypatch):
    detector, progress = SlowAtFirst(), []
    monkeypatch.setattr(device_fit.time, "perf_counter_ns", lambda: detector.now_ns)
    monkeypatch.setattr(
        "genie_sim.data.detectors.detector.DetectorSettings.opened", lambda _: detector
    )
    measured = device_fit.measure("slow", None, 25, None, lambda *counts: progress.append(counts))
    assert measured.latencies_ns.tolist() == [10**6] * 25
    assert measured.model == "slow_at_first"
    assert progress[-1][:2] == (25, 25)


def test_times_of_another_shape_show_a_large_gap():
    """Half the runs take 10 ms and half 30 ms: no law of one hump fits, and the fit says so."""
    assert device_fit.fit(np.repeat([10e6, 30e6], 100)).gap > 0.2


def test_times_that_are_all_equal_are_fitted():
    fitted = device_fit.fit(np.full(50, 7e6))
    assert fitted.median_ns == 7_000_000
    assert fitted.loc + (1 - fitted.loc) * math.exp(2 * fitted.sigma) == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_a_detector_is_measured_into_a_profile(run_cli, tmp_path):
    weights = make_network(tmp_path / "yolox_nano.onnx")
    arguments = ("profile", "--detector", "yolox_nano", "--weights", str(weights), "--runs", "20")
    done = run_cli(*arguments, "--out", "device_profiles/here.yaml")
    assert done.returncode == 0, done.stderr
    device = load_profile(tmp_path / "device_profiles" / "here.yaml")
    time = detector_time(device, "yolox_nano")
    assert 100_000 < time.median_ns < 10**10
    assert device.models["yolox_nano"].tag == "M"
    assert "20 runs of yolox_nano at 640x192" in device.models["yolox_nano"].source
    assert {device.spreads.isolated.tag, device.spreads.loaded.tag} == {"A"}
    assert run_cli("list", "devices").stdout.splitlines()[0].startswith("agx_orin")
    assert "here " in run_cli("list", "devices").stdout


def test_latencies_measured_elsewhere_become_a_profile(run_cli, tmp_path):
    times_ms = drawn(81.7, 0.85, 0.6, count=200) / 1e6
    rows = "\n".join(f"orin,{value:.4f}" for value in times_ms)
    (tmp_path / "orin.csv").write_text("device,latency_ms\n" + rows)
    done = run_cli("profile", "--csv", "orin.csv", "--model", "yolov8s", "--out", "my_orin.yaml")
    assert done.returncode == 0, done.stderr
    time = detector_time(load_profile(tmp_path / "my_orin.yaml"), "yolov8s")
    assert time.median_ns == pytest.approx(81.7e6, rel=0.03)


@pytest.mark.parametrize(("processors", "cores"), [(6, 6), (None, 1)])
def test_a_profile_has_the_machines_processors(tmp_path, monkeypatch, processors, cores):
    monkeypatch.setattr(device_fit.os, "cpu_count", lambda: processors)
    measured = device_fit.Measurement("yolo", np.repeat([10e6, 30e6], 100), "made up")
    device = device_fit.write(tmp_path / "a.yaml", measured, device_fit.fit(measured.latencies_ns))
    assert device.cores.value == cores


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("12.5\n" * 19, "19 latencies, expected at least 20"),
        (
            "latency\n" + "12.5\n" * 30 + "soon\n",
            "line 32: no latency in 'soon' of column 'latency'",
        ),
        ("12.5\n" * 30 + "-3\n", "line 31"),
        ("12.5\n" * 30 + "nan\n", "line 31"),
        ("latency\nunit\n12.5\n", "line 2"),
        ("duration\n" + "12.5\n" * 30 + "1700000000100\n", "line 32: .* is above an hour"),
    ],
)
def test_what_is_no_latency_is_named(tmp_path, text, message):
    path = tmp_path / "times.csv"
    path.write_text(text)
    with pytest.raises(UserError, match=rf"times.csv: {message}"):
        device_fit.from_table(path, "yolo", ImportReport(path), unit="ms")


def table(path, titles: str, *columns) -> ImportReport:
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([titles, *(";".join(map(str, row)) for row in rows)]))
    return ImportReport(path)


def spread(median: float, count: int = 40) -> list[float]:
    times = [round(median * (0.9 + 0.2 * k / (count - 1)), 6) for k in range(count)]
    return times[::2] + times[1::2]


@pytest.mark.parametrize(
    ("titles", "column", "unit", "median"),
    [
        ("iteration;latency_ms", None, None, 50.0),
        ("iteration;Latency [us]", None, None, 50_000.0),
        ("frame;inference (s)", None, None, 0.05),
        ("frame;latency", None, "ms", 50.0),
        ("stamp_ms;GPU latency (ms)", None, None, 50.0),
        ("fps [1/s];end_to_end_ms", "end_to_end_ms", None, 50.0),
    ],
)
def test_the_named_column_is_read_in_its_unit(tmp_path, titles, column, unit, median):
    path = tmp_path / "times.csv"
    report = table(path, titles, range(1, 41), spread(median))
    measured = device_fit.from_table(path, "m", report, column, unit)
    assert np.median(measured.latencies_ns) == pytest.approx(50e6)
    assert not measured.here
    assert report.counts[f"latencies of column {titles.partition(';')[2]!r}"] == 40


@pytest.mark.parametrize(
    ("titles", "message"),
    [
        ("pre latency_ms;post latency_ms", "which column holds latencies, 'pre latency_ms', "),
        ("a;b", "no title says that it holds latencies, .*the file has 'a', 'b'"),
        ("name;run", "no title says that it holds latencies"),
        ("frame;latency", "column 'latency' has no unit: say --unit"),
        ("frame;latency_min", "column 'latency_min' has no unit: say --unit"),
        ("frame;timestamp_ms", "no title says .*has 'frame', 'timestamp_ms'"),
    ],
)
def test_what_may_be_another_column_is_asked(tmp_path, titles, message):
    path = tmp_path / "times.csv"
    report = table(path, titles, range(1, 41), spread(50))
    with pytest.raises(UserError, match=message):
        device_fit.from_table(path, "m", report)


OF_OTHERS = (
    *("fps", "images/s", "queries_per_second", "samples/sec", "1/s", "rate [Hz]", "it/s", "fps_ms"),
    *("temperature_C", "T [°C]", "GPU power [W]", "mem_MB", "util_%", "cpu_pct", "std_ms"),
    *("age_s", "staleness_ms", "uptime_s", "clock offset [ms]", "rtt_ms", "deadline_ms"),
    *("tokens_per_ms", "batch_size"),
    *("timestamp_ms", "start_ms", "stampMs", "unix time [s]"),
)


@pytest.mark.parametrize(("title", "unit"), [*zip(OF_OTHERS, cycle([None, "ms"]))])
def test_a_lone_column_of_another_quantity_is_refused(tmp_path, title, unit):
    path = tmp_path / "times.csv"
    report = table(path, title, spread(25))
    with pytest.raises(UserError, match=r"holds rates, no latencies|does not say latency"):
        device_fit.from_table(path, "m", report, None, unit)


@pytest.mark.parametrize("title", ["fps", "images/s", "fps_ms", "it/s", "temperature_C", "util_%"])
def test_a_named_column_of_another_quantity_is_refused(tmp_path, title):
    path = tmp_path / "times.csv"
    report = table(path, title, spread(25))
    with pytest.raises(UserError, match=r"holds rates, no latencies|does not say latency"):
        device_fit.from_table(path, "m", report, title, "ms")


def test_numbers_of_runs_are_no_latencies(tmp_path):
    path = tmp_path / "times.csv"
    path.write_text("\n".join(map(str, range(1, 41))))
    with pytest.raises(UserError, match="counts from 1 to 40"):
        device_fit.from_table(path, "m", ImportReport(path), unit="ms")


@pytest.mark.parametrize("step_ms", [1000, 5])
def test_times_of_runs_are_no_latencies_and_sorted_latencies_are(tmp_path, step_ms):
    path = tmp_path / "times.csv"
    times = [f"{step_ms * k + (k % 3)}" for k in range(1, 41)]
    path.write_text("\n".join(["t_ms", *times]))
    with pytest.raises(UserError, match=r"'t_ms' counts from .* stamps"):
        device_fit.from_table(path, "m", ImportReport(path), "t_ms")
    path.write_text("\n".join(["latency_ms", *(f"{50 * 1.08**k}" for k in range(40))]))
    assert len(device_fit.from_table(path, "m", ImportReport(path)).latencies_ns) == 40


def test_a_law_that_does_not_fit_is_told_in_words():
    latencies = np.repeat([10e6, 30e6], 100)
    measured, report = device_fit.Measurement("m", latencies, "made up"), ImportReport("x")
    device_fit.check_fit(measured, device_fit.fit(latencies), report)
    assert "the law does not fit: its mean is" in report.lines()[0]


@pytest.mark.parametrize(
    ("titles", "row", "message"),
    [
        ("latency_ms", "0.02{k}", "latency: a median of 0.025 ms, unusual of a detection"),
        ("latency_ms", "2{k}000", "latency: a median of 25,000 ms, unusual of a detection"),
    ],
)
def test_what_is_unusual_of_a_detector_is_told(tmp_path, titles, row, message):
    path = tmp_path / "times.csv"
    path.write_text("\n".join([titles, *(row.format(k=k % 10) for k in range(40))]))
    report = ImportReport(path)
    device_fit.from_table(path, "m", report)
    assert any(message in line for line in report.lines()), report.lines()


def test_latencies_of_others_claim_no_machine(run_cli, tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(map(str, spread(20))))
    assert run_cli("profile", "--csv", "a.csv", "--unit", "ms", "--out", "a.yaml").returncode == 0
    device = load_profile(tmp_path / "a.yaml")
    assert device.cores.tag == "A" and device.spreads.default.tag == "S"
    assert device.models["a"].tag == "S"


def test_one_source_of_latencies_is_asked_for(run_cli):
    assert run_cli("profile", "--out", "x.yaml").stderr.startswith(
        "genie-sim: profile: give either --detector"
    )


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--out", "my laptop.yaml"], "my laptop.yaml: name: "),
        (["--model", "my net", "--out", "a.yaml"], "a.yaml: models"),
        (["--cores", "5000", "--out", "a.yaml"], "a.yaml: cores.value: "),
    ],
)
def test_what_no_profile_can_hold_is_told_before_it_is_measured(given, told, monkeypatch, capsys):
    monkeypatch.setattr(device_fit, "measure", None)
    assert main(["profile", "--detector", "yolox_nano", *given]) == 1
    assert capsys.readouterr().err.startswith(f"genie-sim: {told}")


def test_the_table_s_name_is_a_model_s_before_it_is_read(capsys):
    assert main(["profile", "--csv", "run 1.csv", "--out", "a.yaml"]) == 1
    assert capsys.readouterr().err.startswith("genie-sim: a.yaml: models")


@pytest.mark.parametrize("name", ["my net", "net\n"])
def test_a_detector_that_no_profile_can_name_is_not_measured(name, monkeypatch):
    detector = SlowAtFirst()
    detector.name = name
    opened = "genie_sim.data.detectors.detector.DetectorSettings.opened"
    monkeypatch.setattr(opened, lambda _: detector)
    with pytest.raises(UserError, match=re.escape(f"'slow': name is {name!r}")):
        device_fit.measure("slow", None, 25, None, print)
    assert detector.calls == 0
