"""What NVIDIA's tools write becomes a table of latencies and the power of a profile."""

from __future__ import annotations

import json
from pathlib import Path

import benchmark_logs
import numpy as np
import pytest
import yaml

from genie_sim.base.import_report import ImportReport
from genie_sim.base.settings import read
from genie_sim.scenario import device_fit
from genie_sim.scenario.power import DevicePower

ORIN = (
    "05-01-2024 10:00:{k:02d} RAM 2345/7772MB (lfb 4x4MB) SWAP 0/3886MB (cached 0MB) "
    "CPU [{a}%@1190,{b}%@1190,off,off,0%@729,0%@729] EMC_FREQ 3%@2133 GR3D_FREQ {gpu}%@[624] "
    "CPU@45.1C tj@47C VDD_IN {mw}mW/{mw}mW VDD_CPU_GPU_CV 1000mW/900mW VDD_SOC 900mW/900mW"
)
XAVIER = (
    "RAM 2345/15692MB (lfb 4x4MB) SWAP 0/7846MB (cached 0MB) CPU [{a}%@1190,{b}%@1190,off,off] "
    "EMC_FREQ 0% GR3D_FREQ {gpu}% AO@30C GPU@31C GPU {mw}/155 CPU 0/311 SOC 0/933 SYS5V 0/1500"
)


def test_exported_times_of_trtexec_are_a_table_of_latencies(tmp_path: Path):
    times = [round(20 + 0.1 * (k % 11), 3) for k in range(44)]
    entries = [{"startInMs": k, "latencyMs": t, "computeMs": t / 2} for k, t in enumerate(times)]
    path, table = tmp_path / "times.json", tmp_path / "latencies.csv"
    path.write_text(json.dumps(entries))
    table.write_text(benchmark_logs.latencies_csv(path))
    measured = device_fit.from_table(table, "yolo", ImportReport(table))
    assert np.median(measured.latencies_ns) == pytest.approx(20.5e6)
    path.write_text('[{"a": 1}]')
    with pytest.raises(ValueError, match="is no list of entries with latencyMs"):
        benchmark_logs.latencies_csv(path)


@pytest.mark.parametrize(("form", "cores"), [(ORIN, 6), (XAVIER, 4)])
def test_tegrastats_tells_the_cores_and_the_power(tmp_path: Path, form: str, cores: int):
    """4 W idle, 6 W more for the GPU, 1.5 W more a core."""
    loads = [((37 * k) % 101, (53 * k) % 101, (29 * k) % 101) for k in range(60)]
    log = tmp_path / "tegrastats.log"
    log.write_text(
        "\n".join(
            form.format(k=k, a=a, b=b, gpu=gpu, mw=round(4000 + 60 * gpu + 15 * (a + b)))
            for k, (gpu, a, b) in enumerate(loads)
        )
    )
    board = yaml.safe_load(str(benchmark_logs.board(log)))
    assert board["cores"]["value"] == cores
    power = read(DevicePower, board["power"], lambda _: "profile")
    watts = [part.value_w for part in (power.idle, power.accelerator, power.core)]
    assert watts == pytest.approx([4.0, 6.0, 1.5], abs=0.01)


def test_a_board_that_never_works_has_no_power(tmp_path: Path):
    path = tmp_path / "t.log"
    path.write_text((ORIN.format(k=1, a=1, b=1, gpu=0, mw=4000) + "\n") * 30)
    assert benchmark_logs.board(path) == (6, {})
    path.write_text("hello\n" * 30)
    with pytest.raises(ValueError, match="0 lines of tegrastats"):
        benchmark_logs.board(path)
