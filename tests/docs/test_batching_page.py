"""The table of the study of batching shows the numbers beside it."""

from __future__ import annotations

import csv

from tests.checkout import REPOSITORY

METRICS = {
    "frames with a fresh result [%]": ("fresh_answered_share", 100),
    "streaming F1 [%]": ("streaming_f1", 100),
    "recall [%]": ("object_recall", 100),
    "first answer, p95 [ms]": ("first_answer_p95", 1),
    "energy per frame [J]": ("energy_per_frame", 1),
}
METHODS = {"remote": "remote", "Genie": "genie", "recommended Genie": "recommended"}


def test_the_page_shows_the_numbers_of_the_study():
    with (REPOSITORY / "results/batching/points.csv").open(encoding="utf-8") as file:
        values = {
            (row["metric"], row["method"], row["serving"]): float(row["value"])
            for row in csv.DictReader(file)
            if not row["along"]
        }
    lines = (REPOSITORY / "docs/batching.md").read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line[:1] == "|"]
    headings, _, *numbers = rows
    assert len(numbers) == len(METRICS) * len(METHODS)
    for label, *cells in numbers:
        title, _, method = label.rpartition(", ")
        metric, factor = METRICS[title]
        for serving, cell in zip(headings[1:], cells, strict=True):
            assert cell == f"{factor * values[metric, METHODS[method], serving]:.3g}", label
