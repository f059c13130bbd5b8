"""What NVIDIA's tools write becomes a device profile."""

from __future__ import annotations

import json

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.runs.build import detector_time
from genie_sim.scenario import benchmark_logs, device_fit
from genie_sim.scenario.profiles import load_profile

TIMES = [round(20 + 0.1 * (k % 11), 3) for k in range(44)]
LOG = """&&&& RUNNING TensorRT.trtexec [TensorRT v8602] # trtexec --onnx=yolov8s.onnx
[05/01/2024-10:00:00] [I] Average on 10 runs - GPU latency: 6.1 ms - Host latency: 6.4 ms
[05/01/2024-10:00:03] [I] === Performance summary ===
[05/01/2024-10:00:03] [I] Throughput: 150.1 qps
[05/01/2024-10:00:03] [I] Latency: min = 6.2 ms, max = 12.3 ms, mean = 6.6 ms, median = 6.5 ms, \
percentile(90%) = 6.8 ms, percentile(95%) = 7 ms, percentile(99%) = 8.125 ms
[05/01/2024-10:00:03] [I] GPU Compute Time: min = 6 ms, max = 12 ms, mean = 6.3 ms, \
median = 6.2 ms, percentile(90%) = 6.5 ms, percentile(95%) = 6.7 ms, percentile(99%) = 7.9 ms
&&&& PASSED TensorRT.trtexec
"""


def test_exported_times_of_trtexec_are_its_latencies(tmp_path):
    path, report = tmp_path / "times.json", ImportReport("times")
    entries = [{"startInMs": k, "latencyMs": t, "computeMs": t / 2} for k, t in enumerate(TIMES)]
    path.write_text(json.dumps(entries))
    measured = device_fit.from_table(path, "yolo", report)
    assert np.median(measured.latencies_ns) == pytest.approx(20.5e6)
    assert report.chosen == ["times: latencyMs, not computeMs (--column)"]
    half = device_fit.from_table(path, "yolo", report, "computeMs")
    assert np.median(half.latencies_ns) == pytest.approx(10.25e6)
    spans = [
        {"startComputeMs": 30.0 * k, "endComputeMs": 30.0 * k + t} for k, t in enumerate(TIMES)
    ]
    path.write_text(json.dumps(spans))
    measured = device_fit.from_table(path, "yolo", report)
    assert np.median(measured.latencies_ns) == pytest.approx(20.5e6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[", "not JSON"),
        ("{}", "is no list of times, as 'trtexec --exportTimes' writes it"),
        ('[{"a": 1}]', "has no latencyMs, computeMs, endComputeMs: it is no list of times"),
        ('[{"latencyMs": "x"}]', "entry 1: latencyMs: must be a number"),
        ("[" * 100_000, "not JSON"),
    ],
)
def test_json_that_is_none_of_trtexec_is_one_line(tmp_path, text, message):
    path = tmp_path / "times.json"
    path.write_text(text)
    with pytest.raises(UserError, match=message):
        device_fit.from_table(path, "yolo", ImportReport(path))


def test_a_log_of_trtexec_gives_its_median_and_percentile(run_cli, tmp_path):
    (tmp_path / "build.log").write_text(LOG)
    done = run_cli("profile", "--csv", "build.log", "--model", "yolov8s", "--out", "orin.yaml")
    assert done.returncode == 0, done.stderr
    assert "times: Latency, not GPU Compute Time" in done.stdout
    law = detector_time(load_profile(tmp_path / "orin.yaml"), "yolov8s")
    draws = [law.at(z) for z in np.random.default_rng(1).standard_normal(20_000)]
    assert np.quantile(draws, [0.5, 0.99]) == pytest.approx([6.5e6, 8.125e6], rel=0.01)
    (tmp_path / "build.log").write_text(LOG.partition("===")[0])
    done = run_cli("profile", "--csv", "build.log", "--out", "orin.yaml")
    assert done.returncode == 1 and "has no summary of latencies" in done.stderr


ORIN = (
    "05-01-2024 10:00:{k:02d} RAM 2345/7772MB (lfb 4x4MB) SWAP 0/3886MB (cached 0MB) "
    "CPU [{a}%@1190,{b}%@1190,off,off,0%@729,0%@729] EMC_FREQ 3%@2133 GR3D_FREQ {gpu}%@[624] "
    "CPU@45.1C tj@47C VDD_IN {mw}mW/{mw}mW VDD_CPU_GPU_CV 1000mW/900mW VDD_SOC 900mW/900mW"
)
XAVIER = (
    "RAM 2345/15692MB (lfb 4x4MB) SWAP 0/7846MB (cached 0MB) CPU [{a}%@1190,{b}%@1190,off,off] "
    "EMC_FREQ 0% GR3D_FREQ {gpu}% AO@30C GPU@31C GPU {mw}/155 CPU 0/311 SOC 0/933 SYS5V 0/1500"
)


def board_log(form: str, count: int = 60) -> str:
    """4 W idle, 6 W more for the GPU, 1.5 W more a core."""
    lines = []
    for k in range(count):
        gpu, a, b = (37 * k) % 101, (53 * k) % 101, (29 * k) % 101
        mw = round(4000 + 60 * gpu + 15 * (a + b))
        lines.append(form.format(k=k % 60, a=a, b=b, gpu=gpu, mw=mw))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(("form", "cores"), [(ORIN, 6), (XAVIER, 4)])
def test_tegrastats_tells_the_cores_and_the_power(run_cli, tmp_path, form, cores):
    (tmp_path / "tegrastats.log").write_text(board_log(form))
    figures = ("--mean", "45 ms", "--sd", "5 ms", "--model", "yolo")
    done = run_cli("profile", *figures, "--tegrastats", "tegrastats.log", "--out", "board.yaml")
    assert done.returncode == 0, done.stderr
    assert "read: 60 lines of tegrastats" in done.stdout
    assert f"2 of {cores} cores are off: --cores {cores - 2} if they stay so" in done.stdout
    board = load_profile(tmp_path / "board.yaml")
    assert board.cores.value == cores and board.power is not None
    watts = [board.power.idle, board.power.accelerator, board.power.core]
    assert [one.value_w for one in watts] == pytest.approx([4.0, 6.0, 1.5], abs=0.01)
    assert {one.tag for one in watts} == {"D"}


def test_a_board_that_never_works_has_no_power(tmp_path):
    path, report = tmp_path / "t.log", ImportReport("t")
    path.write_text((ORIN.format(k=1, a=1, b=1, gpu=0, mw=4000) + "\n") * 30)
    assert benchmark_logs.tegrastats(path, report).power is None
    assert "the load hardly changes" in report.warnings[1]
    path.write_text("hello\n" * 30)
    with pytest.raises(UserError, match="30 of 30 lines would be left out: without CPU and GR3D"):
        benchmark_logs.tegrastats(path, report)
