"""What a million cars would cost is arithmetic on what was measured. How much that is decides no
test.
"""

from __future__ import annotations

import sys

import pytest

from benchmarks import cell_costs
from benchmarks.cell_costs import Costs, million
from benchmarks.cells import Setting

TINY = (Setting(2, 1, 4, 2.0), Setting(1, 1, 2, 1.0), Setting(1, 1, 2, 2.0), Setting(1, 1, 2, 4.0))


def test_the_arithmetic_of_a_million_cars():
    """36,000 million frames: at 100 µs each 3.6 million seconds, or 1,000 hours. A car has 1 MB
    after 600 s, and with 100 bytes for each of 30,000 more frames 4 MB.
    """
    costs = Costs(
        setting=Setting(),
        least_s=100e-6,
        usual_s=200e-6,
        jointly_s=300e-6,
        prepare_s=1e-3,
        disk={"frames": 10.0, "lookups": 90.0},
        filled_s=600.0,
        process=100e6,
        car=1e6,
        frame=100.0,
        block_s=1e-3,
        block=10e3,
    )
    rows = [line.strip("| ").split(" | ") for line in million(costs).splitlines()]
    reached = {row[0]: row[2] for row in rows}
    assert reached["frames"] == "3.6e+10" and reached["cells"] == "50,000"
    assert (
        reached["core hours, apart, frames only"]
        == reached["cores that keep up with the clock"]
        == "1,000"
    )
    assert (
        reached["core hours, apart, all tables"],
        reached["hours in one process, at least"],
    ) == ("2,000", "3,000")
    assert reached["one cell on a core"] == "72 s", "20 cars, 720,000 frames"
    assert (
        reached["memory of a car"] == "4.0 MB"
        and reached["memory in one process, at least"] == "4.0 TB"
    )
    assert reached["memory of a cell's process"] == "180 MB"
    assert (reached["disk, frames only"], reached["disk, all tables"]) == ("0.4 TB", "3.6 TB")
    assert reached["the town in one piece"] == "8 min, 4 GB", "450,000 blocks"


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux tells the most memory that a process had"
)
def test_everything_is_measured():
    costs = cell_costs.measure(TINY)
    assert min(costs.least_s, costs.usual_s, costs.jointly_s, costs.prepare_s, costs.process) > 0
    assert min(costs.block_s, costs.block) > 0
    assert {"frames", "lookups", "held"} <= set(costs.disk) and min(costs.disk.values()) > 0
    assert "µs" in cell_costs.constants(costs) and costs.filled_s == 2.0
