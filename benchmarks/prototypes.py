"""What shared uplinks, recorded links and batches change, beside what prototypes had measured
outside the package before these parts were written.

    python -m benchmarks.prototypes [--rate RECORDING --rtt RECORDING] [--markdown]

The prototypes' numbers were set as targets: within 2 points on links of their own and where edges
serve in batches, the same order of methods in a cell and on a recorded link, for all methods but
the recommended Genie, which has changed since. *Fresh* is meant as the prototypes had it: any
answer that is not out of an object map, a cache's included. One seed.

The recorded link has the rates of a drive of MTU-Insectt/Measurements5G and the round trips of one
of CICV5G, which `genie-sim links import` reads; without ``--rate`` and ``--rtt`` its columns are
left out. ``--markdown`` writes the tables into docs/explanation/validation.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import genie_sim as gs
from benchmarks.speed_page import DOCS, filled, table

PAGE = DOCS / "explanation/validation.md"
RECOMMENDED = {"name": "recommended", "method": "genie", "genie": "recommended"}
UNTARGETED = "recommended"
TARGET_POINTS = 2.0


class Case(NamedTuple):
    """A column of a table: scenario and settings, and the prototypes' percentages by method: fresh
    and recall.

    ``target`` says what was to be reproduced: the numbers, or only the order of the methods by
    each of them.
    """

    title: str
    settings: Mapping[str, Any]
    expected: Mapping[str, tuple[int, int]]
    target: str


def street_cases(rate: str | None, rtt: str | None) -> list[Case]:
    """Three cars on one street: Ethernet, 5G with a constant rate, and a recorded drive."""
    methods = ("local", "remote", "genie", "recommended", "deadline", "oracle")
    links: list[tuple[str, Any, str, Sequence[tuple[int, int]]]] = [
        ("Ethernet, raw", "ethernet_1g", "raw", [(59, 88), (83, 78), (83, 86), (60, 87), (91, 89)]),
        ("nr5g, PNG", "nr5g", "png", [(11, 38), (37, 34), (37, 74), (6, 35), (54, 65)]),
        ("nr5g, JPEG 80", "nr5g", "jpeg80", [(43, 67), (87, 64), (87, 86), (44, 65), (87, 76)]),
    ]
    if rate and rtt:
        trace = {"model": "trace", "rate": rate, "rtt": rtt, "down": "100 Mbit/s"}
        links += [
            ("recorded, raw", trace, "raw", [(15, 47), (41, 36), (41, 77), (25, 50), (62, 66)]),
            ("recorded, PNG", trace, "png", [(25, 54), (59, 42), (59, 80), (27, 50), (67, 68)]),
            (
                "recorded, JPEG 80",
                trace,
                "jpeg80",
                [(52, 85), (84, 74), (84, 87), (53, 83), (90, 85)],
            ),
        ]
    return [
        Case(
            title,
            {f"cars[{car}].link": link for car in range(3)} | {"image_encoding": encoding},
            dict(zip(methods, [(8, 42), *expected], strict=True)),
            "order" if isinstance(link, dict) else "numbers",
        )
        for title, link, encoding, expected in links
    ]


def town_cases() -> list[Case]:
    """A town with four edges: links of their own, and a cell of 25 MHz at each edge."""
    methods = ("local", "remote", "genie", "recommended", "sim_lru", "deadline")
    local = (66, 58)
    rows: list[tuple[int, Any, list[tuple[int, int]]]] = [
        (30, "nr5g", [(88, 71), (98, 62), (98, 72), (98, 65), (95, 68)]),
        (30, {"model": "cell"}, [(56, 55), (91, 58), (91, 69), (91, 64), (86, 67)]),
        (80, "nr5g", [(48, 63), (93, 61), (93, 72), (92, 63), (68, 64)]),
        (80, {"model": "cell"}, [(25, 34), (81, 54), (81, 62), (80, 58), (71, 60)]),
    ]
    return [
        Case(
            f"{cars} cars, {'cell' if isinstance(link, dict) else link}",
            {"perception.duration": "10 s", "fleet.cars": cars, "fleet.link": link},
            dict(zip(methods, [local, *expected], strict=True)),
            "order" if isinstance(link, dict) else "numbers",
        )
        for cars, link, expected in rows
    ]


def batch_cases() -> list[Case]:
    """80 cars on four edges that serve in other ways."""
    rows: list[tuple[str, dict[str, Any], list[tuple[int, int]]]] = [
        ("one by one", {}, [(48, 62), (91, 71)]),
        ("a queue a camera", {"queue": "per_camera"}, [(53, 59), (94, 71)]),
        ("in fours", {"queue": "per_camera", "batch": 4}, [(84, 66), (95, 72)]),
        ("in eights", {"queue": "per_camera", "batch": 8}, [(88, 66), (95, 72)]),
    ]
    return [
        Case(
            title,
            {"perception.duration": "10 s", "fleet.cars": 80, "serving": serving},
            dict(zip(("remote", "recommended"), expected, strict=True)),
            "numbers",
        )
        for title, serving, expected in rows
    ]


class Outcome(NamedTuple):
    """Percentages of one method: fresh and recall, of the worst-served car the former, and Jain's
    index of it over cars.
    """

    fresh: float
    recall: float
    worst_car: float
    jain: float


def outcomes(scenario: str, case: Case) -> dict[str, Outcome]:
    """Simulates a case under its methods."""
    methods = [RECOMMENDED if name == UNTARGETED else name for name in case.expected]
    settings = {**case.settings, "methods": methods, "record": ["held"]}
    run = gs.run(scenario, settings, seed=1)
    metrics = run.metrics
    recalls = metrics[(metrics["metric"] == "object_recall") & (metrics["component"] == "")]
    recall = recalls.set_index("method")["value"]
    results = {}
    for name in case.expected:
        frames = run.frames[run.frames["method"] == name]
        fresh = frames["result_answer_ns"].notna()
        cars = 100 * fresh.groupby(frames["car"].astype(str)).mean().to_numpy()
        jain = cars.sum() ** 2 / (len(cars) * np.square(cars).sum()) if cars.any() else 0.0
        results[name] = Outcome(
            float(100 * fresh.mean()), float(100 * recall[name]), float(cars.min()), float(jain)
        )
    return results


def swaps(ours: Sequence[float], theirs: Sequence[float]) -> int:
    """The pairs that one of two lists has clearly in one order, and the other in the opposite one:
    by more than ``TARGET_POINTS`` in both.
    """
    count = 0
    for first in range(len(ours)):
        for second in range(first):
            of_ours, of_theirs = ours[first] - ours[second], theirs[first] - theirs[second]
            opposite = of_ours * of_theirs < 0
            count += opposite and min(abs(of_ours), abs(of_theirs)) > TARGET_POINTS
    return count


def verdict(case: Case, results: Mapping[str, Outcome]) -> str:
    """Whether the target of a case is reached, and by how much it is missed."""
    names = [name for name in case.expected if name != UNTARGETED]
    pairs = [(results[name][:2], case.expected[name]) for name in names]
    if case.target == "order":
        count = sum(
            swaps([ours[index] for ours, _ in pairs], [theirs[index] for _, theirs in pairs])
            for index in range(2)
        )
        pairs_text = "1 pair" if count == 1 else f"{count} pairs"
        return "same order" if count == 0 else f"{pairs_text} in another order"
    furthest = max(abs(ours[index] - theirs[index]) for ours, theirs in pairs for index in range(2))
    met = round(furthest, 1) <= TARGET_POINTS
    return f"{'within' if met else 'missed:'} {furthest:.1f} points"


def comparison(scenario: str, cases: Sequence[Case], fairness: bool = False) -> str:
    """The Markdown table of some cases: fresh / recall, and in brackets the prototypes'."""
    columns = [(case, outcomes(scenario, case)) for case in cases]
    rows = []
    for name in cases[0].expected:
        cells = []
        for case, results in columns:
            result, (fresh, recall) = results[name], case.expected[name]
            cell = f"{result.fresh:.0f} / {result.recall:.0f} ({fresh} / {recall})"
            if fairness:
                cell += f"; worst car {result.worst_car:.0f}, Jain {result.jain:.2f}"
            cells.append(cell)
        rows.append([name, *cells])
    rows.append(["target", *(verdict(case, results) for case, results in columns)])
    return table(["fresh / recall [%]", *(case.title for case in cases)], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", help="a recording of rates")
    parser.add_argument("--rtt", help="a recording of round trips")
    parser.add_argument("--markdown", action="store_true", help="write the page")
    options = parser.parse_args()
    blocks = {
        "street": comparison("3car_hetero", street_cases(options.rate, options.rtt)),
        "town": comparison("fleet_30", town_cases()),
        "batches": comparison("fleet_30", batch_cases(), fairness=True),
    }
    for name, block in blocks.items():
        print(f"{name}\n{block}\n")
    if options.markdown:
        text = PAGE.read_text(encoding="utf-8")
        for name, block in blocks.items():
            text = filled(text, name, block, str(PAGE))
        Path(PAGE).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
