"""What NVIDIA's tools write of a detector and of a board, for ``genie-sim profile``:

python benchmark_logs.py times times.json > latencies.csv   # of trtexec --exportTimes
python benchmark_logs.py board tegrastats.log               # cores and power, as in a profile
"""

import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

CORES = re.compile(r"CPU \[([^\]]*)\]")
GPU = re.compile(r"GR3D_FREQ (\d+)%")
RAIL = re.compile(r"\b([A-Z][A-Z0-9_]*) (\d+)(?:mW)?/\d+(?:mW)?(?![\dMk])")
INPUTS = ("VDD_IN", "POM_5V_IN")  # the rails that all others hang on
MIN_LINES = 20
MIN_SPREAD = 0.05  # of the load of the GPU, of 1, or of the cores; with less nothing can be told


def latencies_csv(path: Path) -> str:
    """The latencies in a file of ``trtexec --exportTimes``, those with the copies to the GPU and
    back, as a table. Raises ``ValueError`` for another file.
    """
    entries = json.loads(path.read_text(encoding="utf-8"))
    try:
        latencies = [float(entry["latencyMs"]) for entry in entries]
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"{path}: is no list of entries with latencyMs") from error
    return "\n".join(["latency_ms", *map(str, latencies)]) + "\n"


class Board(NamedTuple):
    """What tegrastats tells of a board: its cores, and its power [W] idle, and how much more with
    the GPU and with one core at work, each with its standard error; none where the load hardly
    changes.
    """

    cores: int
    power_w: dict[str, tuple[float, float]]

    def __str__(self) -> str:
        """As a profile has it."""
        source = 'tag: D, source: "least squares over a log of tegrastats; range: two errors"'
        lines = [f"cores: {{value: {self.cores}, tag: S, source: tegrastats}}"]
        lines += ["power:"] if self.power_w else []
        for name, (value, error) in self.power_w.items():
            low, high = max(value - 2 * error, 0.0), value + 2 * error
            watts = f"value: {value:.3f} W, low: {low:.3f} W, high: {high:.3f} W"
            lines.append(f"  {name}: {{{watts}, {source}}}")
        return "\n".join(lines)


def board(path: Path) -> Board:
    """What a log of tegrastats tells. Raises ``ValueError`` for another file."""
    rows, cores = [], 0
    for line in path.read_text(encoding="utf-8").splitlines():
        gpu, load = GPU.search(line), CORES.search(line)
        rails = {name: int(milliwatts) for name, milliwatts in RAIL.findall(line)}
        if gpu is None or load is None or not rails:
            continue
        loads = [re.match(r"\s*(\d+)%", core) for core in load[1].split(",")]
        cores = max(cores, len(loads))
        busy = sum(float(percent[1]) for percent in loads if percent)
        inputs = [rails[name] for name in INPUTS if name in rails]
        milliwatts = inputs[0] if inputs else sum(rails.values())
        rows.append((1.0, float(gpu[1]) / 100, busy / 100, milliwatts / 1000))
    if len(rows) < MIN_LINES:
        raise ValueError(f"{path}: {len(rows)} lines of tegrastats, expected at least {MIN_LINES}")
    factors, power_w = np.split(np.array(rows), [3], axis=1)
    if min(factors[:, 1].std(), factors[:, 2].std()) < MIN_SPREAD:
        return Board(cores, {})
    watts, squares, *_ = np.linalg.lstsq(factors, power_w[:, 0], rcond=None)
    variance = float(squares[0]) / max(len(rows) - 3, 1)
    errors = np.sqrt(np.diag(np.linalg.inv(factors.T @ factors)) * variance)
    pairs = zip(watts.tolist(), errors.tolist(), strict=True)
    return Board(cores, dict(zip(("idle", "accelerator", "core"), pairs, strict=True)))


if __name__ == "__main__":
    what, log = sys.argv[1:]
    sys.stdout.write(str({"times": latencies_csv, "board": board}[what](Path(log))))
