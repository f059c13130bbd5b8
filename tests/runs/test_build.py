"""What the simulator is given of a scenario and its devices."""

from __future__ import annotations

from genie_sim.runs import build
from genie_sim.scenario.profiles import load_profile


def test_a_key_takes_time_of_the_cpu_or_a_share_of_a_detection():
    tx2 = build.device(load_profile("jetson_tx2"), "autoware_vision_detector")
    assert tx2.keys["hsv"] == ("cpu", 1_000_000)
    assert tx2.keys["yolox_gap"] == ("accelerator", round(0.455 * 310_000_000))
