"""The table of the study of shared uplinks shows the numbers beside it."""

from __future__ import annotations

import csv

from tests.checkout import REPOSITORY

METRICS = {
    "frames with a fresh result [%]": ("fresh_answered_share", 100),
    "recall [%]": ("object_recall", 100),
    "streaming F1 [%]": ("streaming_f1", 100),
    "energy per frame [J]": ("energy_per_frame", 1),
}
METHODS = {
    "local": "local",
    "remote": "remote",
    "Genie": "genie",
    "recommended Genie": "recommended",
}
POINTS = [(cars, link) for cars in ("30", "80") for link in ("nr5g, not shared", "cell of 25 MHz")]


def test_the_page_shows_the_numbers_of_the_study():
    with (REPOSITORY / "results/shared_uplink/points.csv").open(encoding="utf-8") as file:
        values = {
            (row["metric"], row["method"], row["cars"], row["link"]): float(row["value"])
            for row in csv.DictReader(file)
            if not row["along"]
        }
    lines = (REPOSITORY / "docs/shared-uplink.md").read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line[:1] == "|"]
    _, _, *numbers = rows
    assert len(numbers) == len(METRICS) * len(METHODS)
    for label, *cells in numbers:
        title, _, method = label.rpartition(", ")
        metric, factor = METRICS[title]
        for (cars, link), cell in zip(POINTS, cells, strict=True):
            value = values[metric, METHODS[method], cars, link]
            assert cell == f"{factor * value:.3g}", label
