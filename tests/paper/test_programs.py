"""The programs in ``studies/``: what they compute, by hand, and that the documents show what they
say of the committed runs.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t

from genie_sim.core.messages import CameraPose
from genie_sim.data.trace import Trace, TraceFrame, read_trace
from genie_sim.paper.facts import Fact
from genie_sim.paper.reproduce import calibrated_settings
from genie_sim.paper.runs import EvaluationRun
from studies import calibration, contradictions, drives, other_readings

REPOSITORY = Path(__file__).resolve().parents[2]
RESULTS = REPOSITORY / "results"
PAGE = (REPOSITORY / "docs" / "paper.md").read_text(encoding="utf-8")


def shown(part: str) -> str:
    """A part of the paper's page."""
    return PAGE.split(f"<!-- {part}:begin -->")[1].split(f"<!-- {part}:end -->")[0].strip()


def rows_of(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Calibration


@pytest.mark.parametrize(
    ("objects_of_gate", "images_of_overlap", "best"),
    [(1 / 2, 1 / 4, (0.31, 0.62)), (1 / 20, 1 / 40, (0.8, 2.1))],
    ids=["inside the ranges", "at their ends"],
)
def test_the_search_finds_the_point_that_fits_within_the_ranges(
    objects_of_gate, images_of_overlap, best
):
    def world(points):
        return [(gate * objects_of_gate, overlap * images_of_overlap) for overlap, gate in points]

    tried = calibration.search(world)
    assert next(iter(tried)) == pytest.approx(best, abs=0.1)
    for values, (low, high) in zip(zip(*tried, strict=True), calibration.RANGES, strict=True):
        assert low <= min(values) and max(values) <= high
        finest = (high - low) / (calibration.GRID - 1) / 2**calibration.REFINEMENTS
        assert np.diff(sorted(set(values))).min() == pytest.approx(finest, abs=1e-4)


def test_the_committed_points_are_those_of_the_search_and_give_the_fitted_parameters():
    committed = {
        (float(row["overlap"]), float(row["gate_m"])): (
            float(row["object_reuse"]),
            float(row["image_reuse"]),
        )
        for row in rows_of("calibration/points.csv")
    }
    tried = calibration.search(lambda points: [committed[point] for point in points])
    assert tried == committed
    overlap, gate_m = next(iter(tried))
    assert calibrated_settings() == (f"overlap={overlap:g}", f"gate_m={gate_m:g}")


# Other readings


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    return list(other_readings.arms(tmp_path_factory.mktemp("traces")))


def test_every_other_reading_or_value_is_another_run(arms):
    """But the values that the evaluation uses anyway, which are points of a curve."""
    loaded = {
        name: EvaluationRun("3car_hetero", 1, (*other_readings.street_settings(), *settings))
        .load()
        .to_yaml()
        for name, _, settings in arms
    }
    same = {name for name, scenario in loaded.items() if scenario == loaded["as it is"]} - {
        "as it is"
    }
    assert same == {
        "gate_m=0.25",
        "rate=0.1",
        "threshold=0.6",
        "image_cell_m=1",
        "view_range_m=50",
    }


def test_a_value_is_as_plausible_as_was_said_before(arms):
    plausible = {name: word for name, word, _ in arms}
    assert (plausible["rule_ema"], plausible["one_camera"]) == ("yes", "arguable")
    assert [plausible[f"gate_m={value}"] for value in (0.1, 0.25, 2.1, 4)] == [
        "no",
        "yes",
        "yes",
        "no",
    ]


def test_traces_have_fewer_frames_or_no_weak_detections(arms):
    paths = {
        name: settings[-1].split("=")[1] for name, _, settings in arms if "trace" in str(settings)
    }
    whole, seldom, sure = (
        read_trace(Path(paths[name]))
        for name in ("min_score=0.3", "frame_rate_hz=2", "min_score=0.7")
    )
    assert seldom.frames["02"] == whole.frames["02"][::5]
    scores = [one.score for frame in sure.frames["02"] for one in frame.detections]
    assert scores and min(scores) >= 0.7


def test_the_table_says_where_a_claim_holds_and_where_nobody_tried():
    rows = [
        {"name": name, "plausible": "yes", **dict.fromkeys(other_readings.COLUMNS[3:], "0.5")}
        | dict.fromkeys((claim.id for claim in other_readings.CLAIMS), "0")
        | {"C11": holds, "C30": ""}
        for name, holds in (("as it is", "0"), ("one", "1"), ("two", "0"), ("three", "1"))
    ]
    table = other_readings.tables(rows)
    assert "| one | yes | 1 | 0.5 | 0.5 | 0.5 | 0.5 |" in table
    assert "| C11 | 2 of 3 | one, three |" in table
    assert "| C12 | 0 of 3 |  |" in table and "| C30 | 0 of 0 |  |" in table


# Contradictions


def row(number, holds):
    """A point; ``holds``: of some claims whether they do, the others never hold."""
    point = contradictions.points(64)[number]
    return {**point, **dict.fromkeys(contradictions.NAMES, "0"), **holds}


def test_levels_are_drawn_evenly_and_more_points_begin_with_the_same():
    points = contradictions.points(64)
    assert contradictions.points(10) == points[:10]
    for name, levels in contradictions.LEVELS.items():
        counts = [[point[name] for point in points].count(level) for level in levels]
        assert max(counts) - min(counts) <= 2, name


def test_the_first_levels_are_the_street_but_for_what_was_fitted():
    usual = {name: levels[0] for name, levels in contradictions.LEVELS.items()}
    settings = contradictions.settings_of(usual)
    assert calibrated_settings()[0] in settings
    mine, street = (
        EvaluationRun("3car_hetero", 1, of).load().to_yaml()
        for of in (settings, other_readings.street_settings())
    )
    assert mine == street


def test_the_share_of_variance_is_that_beyond_chance():
    """Omega squared by hand: of 2 in all, 1.5 is within the levels, and a degree of freedom is
    worth 0.25.
    """
    holds, drawn = np.array([0.0, 0, 0, 1, 1, 1, 1, 0]), np.array([*"aaaabbbb"])
    assert contradictions.explained(holds, drawn) == pytest.approx((2 - 1.5 - 0.25) / (2 + 0.25))


def test_pairs_that_hardly_ever_hold_together_are_found():
    holds = [
        {"C1": n % 2, "C2": 1 - n % 2, "C3": n % 2 if n >= 8 else 1 - n % 2, "C5": n // 2 % 2}
        for n in range(64)
    ]
    table = np.array([[of.get(name, 0.0) for of in holds] for name in contradictions.NAMES])
    assert contradictions.contradictions(table) == [
        ("C1 and C2", 0, 16.0),
        ("C2 and C3", 4, 16.0),
    ]


def test_a_half_that_predicts_the_other_is_told_from_one_that_does_not():
    first, second = contradictions.DESIGN["halves"].values()

    def best_by_first(other):
        table = np.zeros((len(contradictions.NAMES), 64))
        for claims, holds in ((first, lambda n: n % 2), (second, other)):
            for claim in claims:
                table[contradictions.NAMES.index(claim)] = [holds(n) for n in range(64)]
        return contradictions.halves(table)[0][1:4]

    assert best_by_first(lambda n: n % 2) == ["100% (all points 50%)", "100.0%", "50.0%"]
    assert best_by_first(lambda n: n // 2 % 2) == ["100% (all points 50%)", "50.0%", "50.0%"]


def test_the_page_shows_what_the_committed_points_say():
    """If not, ``python studies/contradictions.py`` prints the tables."""
    rows = rows_of("contradictions/points.csv")
    drawn = [{name: row[name] for name in contradictions.LEVELS} for row in rows]
    assert drawn == contradictions.points(contradictions.DESIGN["points"])
    assert contradictions.tables(rows).split("\n\n", 1)[1] == shown("contradictions")


# Other drives


def drive(sequence, *gaps, same_cell=0.5):
    """The runs of one drive: of each seed, how much more images are reused on edges."""
    facts = dict.fromkeys(map(str, drives.FACTS), 0.5)
    return [
        {"sequence": sequence, "scenario": scenario, "seed": seed, drives.SAME_CELL: same_cell}
        | facts
        | {"image_reuse:edge": 0.5 + gap}
        for scenario in drives.SCENARIOS
        for seed, gap in enumerate(gaps)
    ]


def cube(*driven):
    return drives.Cube(pd.DataFrame([run for runs in driven for run in runs]))


def test_a_claim_holds_is_contrary_or_open_on_a_drive():
    runs = cube(drive("0001", 0.2, 0.21), drive("0002", -0.1, -0.11), drive("0003", 0.3, -0.1))
    assert drives.row_of(drives.C18, runs)[-3:] == ["1 of 3", "1", "1"]
    half = 12.7062 * 0.005
    assert drives.intervals(drives.C18, runs)["0001"] == pytest.approx(
        (0.205, 0.205 - half, 0.205 + half), abs=1e-5
    )


def test_both_scenarios_must_hold():
    driven = drive("0001", 0.2, 0.2)
    driven[-1]["image_reuse:edge"] = driven[-2]["image_reuse:edge"] = 0.4
    assert drives.row_of(drives.C18, cube(driven))[-3:] == ["0 of 1", "1", "0"]
    faster = next(one for one in drives.DIRECTIONS if one.claim == "C21")
    assert drives.intervals(faster, cube(driven))["0001"][0] == pytest.approx(-0.15)


def test_a_drive_without_images_to_reuse_has_no_ratio():
    driven = drive("0001", -0.5, -0.5)
    for run in driven:
        run["image_reuse:car"] = 0.0
    ratio = next(one for one in drives.DIRECTIONS if one.claim == "C13")
    assert drives.intervals(ratio, cube(driven)) == {}


@pytest.mark.parametrize(
    ("numbers", "verdict"),
    [((0.5, -0.1, -0.5, -0.7), "supported"), ((0.0, -0.4, 0.2, -0.3), "not supported")],
)
def test_the_hypothesis_is_tested_by_least_squares_over_drives(numbers, verdict):
    """The first four points by hand: slope -4 / 5 with residuals 0.1, -0.1, -0.1, 0.1 around it."""
    driven = [drive(f"000{n}", number, number, same_cell=n / 2) for n, number in enumerate(numbers)]
    told = drives.hypothesis(cube(*driven))
    assert told.endswith(f"The hypothesis that it falls is {verdict}.")
    if verdict == "supported":
        half = 4.302653 * math.sqrt(0.04 / 2 / 1.25)
        assert f"slope -0.8 ({-0.8 - half:.3g} to {-0.8 + half:.3g}), r = -0.98, n = 4" in told
        assert "zero at 0.50" in told


@pytest.mark.parametrize(
    ("steps_m", "headings_rad", "share"),
    [
        ((0.1, 0.5, 0.9, 1.3), (0, 0, 0, 0), 2 / 3),
        ((0.1, 0.1, 0.1), (0.0, 0.0, 1.0), 1 / 2),
        ((0.5, 1.5, 2.5), (0, 0, 0), 0.0),
    ],
)
def test_frames_share_a_cell_where_neither_place_nor_heading_leaves_it(
    steps_m, headings_rad, share
):
    """Cells of 1 m and sectors of 15 degrees, the default."""
    frames = tuple(
        TraceFrame(
            "02",
            i,
            i * 10**8,
            1242,
            375,
            1,
            f"{i}",
            i,
            CameraPose(east_m, 0.0, 0.0, heading),
            1.4,
            (),
        )
        for i, (east_m, heading) in enumerate(zip(steps_m, headings_rad, strict=True))
    )
    trace = Trace("made up", (49.0, 8.4, 100.0), {"02": frames}, {})
    assert drives.same_cell_share(trace) == pytest.approx(share)


def test_the_page_shows_what_the_committed_runs_say():
    """If not, ``python studies/drives.py --table`` prints the table."""
    runs = pd.read_csv(RESULTS / "drives" / "runs.csv", dtype={"sequence": str})
    assert drives.tables(runs) == shown("drives")


def test_a_real_sequence_gives_the_committed_numbers(kitti_root, tmp_path):
    """The shortest one, with one seed. The committed rows were drawn by order of service, today's
    runs draw by frame: one is another seed of the other, within what their seeds differ by.
    """
    trace, path = drives.trace_of(kitti_root, "0014", tmp_path)
    settings = drives.settings_of(path, len(trace.frames["02"]) / 10)
    run = EvaluationRun("street_3car_hetero", 3, settings, shown=True)
    committed = pd.read_csv(RESULTS / "drives" / "runs.csv", dtype={"sequence": str})
    rows = committed.query("sequence == '0014' and scenario == 'street_3car_hetero'")
    assert len(rows) == 5
    facts: dict[Fact, float] = run.simulate().facts
    for fact in drives.FACTS:
        known = rows[str(fact)]
        reach = t.ppf(0.9995, len(rows) - 1) * known.std() * math.sqrt(1 + 1 / len(rows))
        assert abs(facts[fact] - known.mean()) <= reach + 1e-3, fact
    assert drives.same_cell_share(trace) == pytest.approx(rows[drives.SAME_CELL].iloc[0], rel=1e-5)
