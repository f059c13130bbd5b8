"""Table I as printed: its speed-ups over the slowest device, and which of them are misprinted."""

from __future__ import annotations

import pytest

from genie_sim.paper import table1
from genie_sim.paper.table1 import TableCell, devices

MODELS = (
    *("YOLOv8s", "YOLOv8m", "YOLOv8l"),
    *("DETR-ResNet-50", "DETR-ResNet-101", "DETR-ResNet-101-DC5"),
)


def test_every_model_on_every_device_with_the_right_speed_up():
    cells = table1.cells()
    assert [(cell.model, cell.device) for cell in cells] == [
        (model, device) for model in MODELS for device in devices()
    ]
    for cell in cells:
        times = [other.printed_ms for other in cells if other.model == cell.model]
        known = [time for time in times if time is not None]
        if cell.printed_ms is None:
            assert cell.speedup is None and str(cell) == "out of memory"
            continue
        assert cell.speedup == pytest.approx(max(known) / cell.printed_ms)
        assert cell.ours_ms is None or cell.ours_ms == pytest.approx(cell.printed_ms, rel=0.05)
        assert cell.misprinted == (f"{cell.speedup:.2f}" not in str(cell).split("x")[0]), cell


def test_what_is_misprinted():
    """Six printed speed-ups are not over the slowest device; nothing else differs by more than the
    two decimals.
    """
    wrong = {(cell.model, cell.device) for cell in table1.cells() if cell.misprinted}
    right = TableCell("m", "d", 10.0, None, 2.005, 2.0)
    assert not right.misprinted and str(right) == "10.00 / 2.00x"
    bad = TableCell("m", "d", 10.0, None, 2.02, 2.0)
    assert bad.misprinted and str(bad) == "10.00 / 2.02x **2.00x**"
    assert TableCell("m", "d", 10.0, None, None, 2.0).misprinted
    assert not TableCell("m", "d", None, None, None, None).misprinted
    text = table1.markdown()
    assert text.count("**") == 2 * len(wrong)
    lines = text.splitlines()
    assert lines[0] == "| model | Nano | AGX | Orin | A4500 |"
    assert [line.split(" | ")[0] for line in lines[2:8]] == [f"| {model}" for model in MODELS]
    assert lines[-1].startswith("Milliseconds / speed-up over the slowest device. Bold:")
