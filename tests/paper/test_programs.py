"""The programs in ``studies/``: what they compute, by hand, and that the documents show what they
say of the committed runs.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pandas as pd
import pytest

from genie_sim.core.messages import CameraPose
from genie_sim.paper.numbers import Number
from studies import drives
from tests.make import trace, trace_frame

REPOSITORY = Path(__file__).resolve().parents[2]
RESULTS = REPOSITORY / "results"
PAGE = (REPOSITORY / "docs" / "paper.md").read_text(encoding="utf-8")


def shown(part: str) -> str:
    """A part of the paper's page."""
    return PAGE.split(f"<!-- {part}:begin -->")[1].split(f"<!-- {part}:end -->")[0].strip()


def rows_of(name: str) -> list[dict[str, str]]:
    with (RESULTS / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Other drives


def drive(sequence, *gaps, same_cell=0.5):
    """The runs of one drive: of each seed, how much more images are reused on edges."""
    facts = dict.fromkeys(map(str, drives.NUMBERS), 0.5)
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
    runs = cube(
        drive("0001", 0.2, 0.21, 0.22),
        drive("0002", -0.1, -0.11, -0.12),
        drive("0003", 0.3, -0.1, 0.0),
    )
    assert drives.row_of(drives.C18, runs)[-3:] == ["1 of 3", "1", "1"]
    half = 4.30265 * 0.01 / 3**0.5
    assert drives.intervals(drives.C18, runs)["0001"] == pytest.approx(
        (0.21, 0.21 - half, 0.21 + half), abs=1e-5
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
        trace_frame(index=i, pose=CameraPose(east_m, 0.0, 0.0, heading))
        for i, (east_m, heading) in enumerate(zip(steps_m, headings_rad, strict=True))
    )
    assert drives.same_cell_share(trace(**{"02": frames})) == pytest.approx(share)


def test_the_page_shows_what_the_committed_runs_say():
    """If not, ``python studies/drives.py --table`` prints the table."""
    runs = pd.read_csv(RESULTS / "drives" / "runs.csv", dtype={"sequence": str})
    assert drives.tables(runs) == shown("drives")


def test_a_real_sequence_gives_the_committed_numbers(kitti_root, tmp_path):
    """The shortest one, with one seed. The committed rows were drawn by order of service, today's
    runs draw by frame: one is another seed of the other, within what their seeds differ by. Numbers
    whose meaning changed since are not compared.
    """
    from scipy.stats import t

    trace, path = drives.trace_of(kitti_root, "0014", tmp_path)
    settings = drives.settings_of(path, len(trace.frames["02"]) / 10)
    committed = pd.read_csv(RESULTS / "drives" / "runs.csv", dtype={"sequence": str})
    rows = committed.query("sequence == '0014' and scenario == 'street_3car_hetero'")
    assert len(rows) == 5
    numbers = drives.numbers_of(("street_3car_hetero", 3, settings))
    for of in (Number("ghost_share", "remote"), Number("object_precision", "local")):
        known = rows[str(of)]
        reach = t.ppf(0.9995, len(rows) - 1) * known.std() * math.sqrt(1 + 1 / len(rows))
        assert abs(numbers[of] - known.mean()) <= reach + 1e-3, of
    assert drives.same_cell_share(trace) == pytest.approx(rows[drives.SAME_CELL].iloc[0], rel=1e-5)
