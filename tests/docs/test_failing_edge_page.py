"""The table of the study of failing edges shows the numbers beside it."""

from __future__ import annotations

import csv

from tests.checkout import REPOSITORY

METRICS = {
    "frames with a fresh result [%]": ("fault_fresh_share", 100),
    "recall [%]": ("fault_recall", 100),
    "false objects [%]": ("fault_ghosts", 100),
}
METHODS = {
    "local": "local",
    "remote": "remote",
    "Genie": "genie",
    "recommended Genie": "recommended",
    "SimLRU": "sim_lru",
}


def test_the_page_shows_the_numbers_of_the_study():
    with (REPOSITORY / "results/failing_edge/points.csv").open(encoding="utf-8") as file:
        values = {
            (row["metric"], row["component"], row["method"], row["fault"]): float(row["value"])
            for row in csv.DictReader(file)
            if not row["along"]
        }
    lines = (REPOSITORY / "docs/failing-edge.md").read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line[:1] == "|"]
    headings, _, *numbers = rows
    assert len(numbers) == len(METRICS) * len(METHODS)
    for label, *cells in numbers:
        title, _, method = label.rpartition(", ")
        metric, factor = METRICS[title]
        for heading, cell in zip(headings[1:], cells, strict=True):
            before = heading == "before"
            fault = "crash, cold" if before else heading
            phase = "before" if before else "during"
            value = factor * values[metric, phase, METHODS[method], fault]
            assert float(cell) == float(f"{value:.3g}"), label
