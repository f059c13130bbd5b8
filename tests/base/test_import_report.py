"""What an importer tells, in at most ten lines."""

from __future__ import annotations

import json

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport, class_map


def test_however_much_there_is_to_tell_it_is_ten_lines():
    report = ImportReport("a.csv")
    for number in range(100):
        report.read(f"things {number}", 5)
        report.leave_out(f"things\n{number}")
        report.leave_label(f"label {number}")
        report.choose("topic", f"/a{number}", [f"/a{number}", "/b"], "--topic")
        report.span(f"size {number}", [number], "px")
        report.check_way(f"car{number}", [0.0, 3.0], [(0.0, 0.0), (30.0, 40.0)])
    lines = report.lines()
    assert len(lines) == 10 and not any("\n" in line for line in lines)
    assert (
        lines[-1]
        == "warning: 97 more, such as car3: a row every 3 s; in between it drives straight"
    )
    assert "and 94 more" in lines[0] and "car0: 3 s at 0.333 Hz, path 50 m" in lines[5]
    assert json.loads(json.dumps(report.facts()))["left_out"]["things\n7"] == 1


def test_what_cannot_be_is_an_error_or_a_warning():
    with pytest.raises(UserError, match=r"^a\.csv: no; --accept reads it all the same$"):
        ImportReport("a.csv").refuse("no")
    report = ImportReport("a.csv", accept=True)
    report.refuse("no")
    assert report.lines() == ["warning: no"]


@pytest.mark.parametrize(("kept", "refused"), [(60, False), (49, True)])
def test_most_rows_must_stay(kept, refused):
    report = ImportReport("a.csv")
    if refused:
        with pytest.raises(UserError, match="51 of 100 fixes would be left out: no position"):
            report.check_dropped("fixes", kept, 100, "no position")
    else:
        report.check_dropped("fixes", kept, 100, "no position")
        assert report.left_out == {"fixes: no position": 40}


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ("a", "--map: must be LABEL=CLASS"),
        ("=car", "--map: must be"),
        ("a=cr", "--map a: unknown"),
    ],
)
def test_a_map_that_is_none_is_one_line(pair, message):
    assert class_map("--map", ["a b=car"], ["car"]) == {"a b": "car"}
    with pytest.raises(UserError, match=message):
        class_map("--map", [pair], ["car"])
