"""Floating-car data is read as a stream; what is wrong in a file is told with its line."""

from __future__ import annotations

import gzip

import pytest

from genie_sim.base.errors import UserError
from genie_sim.worlds.traffic.fcd import read_fcd
from tests.worlds.traffic.fcd_files import fcd_text, write_fcd

PERSON = '<person id="p" x="0" y="2" angle="0"/></timestep>'  # at the end of a step

# Vehicle a is there at all steps, b leaves, c appears.
STEPS = [
    (10.0, {"a": (0.0, 1.0, 90.0), "b": (7.0, 8.0, 0.0)}),
    (10.5, {"a": (5.0, 1.0, 90.0), "b": (7.0, 9.0, 359.0)}),
    (11.0, {"b": (7.0, 9.0, 1.0), "a": (10.0, 1.0, 90.0)}),
    (11.5, {"a": (15.0, 1.0, 90.0)}),
    (12.0, {"a": (20.0, 1.0, 90.0), "c": (3.0, 4.0, 180.0)}),
]


@pytest.mark.parametrize("name", ["a.xml", "a.xml.gz"])
def test_all_rows_are_read_plain_or_compressed(tmp_path, name):
    path = write_fcd(tmp_path / name, STEPS, types={"c": "bus"})
    rows = read_fcd(path, None, 100.0)
    assert rows.times_s.tolist() == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert (rows.ids, rows.types) == (["a", "b", "c"], ["passenger", "passenger", "bus"])
    assert rows.step.tolist() == [0, 0, 1, 1, 2, 2, 3, 4, 4]
    assert rows.vehicle.tolist() == [0, 1, 0, 1, 1, 0, 0, 0, 2]
    assert rows.x_m.tolist() == [0, 7, 5, 7, 7, 10, 15, 20, 3]
    assert rows.y_m.tolist() == [1, 8, 1, 9, 9, 1, 1, 1, 4]
    assert rows.angle_deg.tolist() == [90, 0, 90, 359, 1, 90, 90, 90, 180]


def test_a_part_of_the_time_has_a_step_before_and_one_after(tmp_path):
    path = write_fcd(tmp_path / "a.xml", STEPS)
    rows = read_fcd(path, 10.7, 0.5)
    assert rows.times_s.tolist() == [10.5, 11.0, 11.5]
    assert rows.x_m.tolist() == [5, 7, 7, 10, 15]
    assert read_fcd(path, 11.0, 0.5).times_s.tolist() == [11.0, 11.5]
    assert read_fcd(path, 11.8, 9.0).ids == ["a", "c"], "b is gone by then"
    assert read_fcd(path, 5.0, 5.2).times_s.tolist() == [10.0, 10.5]


def test_nothing_is_read_beyond_what_is_wanted(tmp_path):
    text = fcd_text(STEPS).replace('<timestep time="12.00">', "<broken")
    (tmp_path / "a.xml").write_text(text)
    assert len(read_fcd(tmp_path / "a.xml", None, 1.0).times_s) == 3
    assert len(read_fcd(tmp_path / "a.xml", None, 1.5).times_s) == 4, "up to the step before"
    with pytest.raises(UserError, match=r"not XML: .* line 18"):
        read_fcd(tmp_path / "a.xml", None, 1.6)


def test_persons_on_foot_are_read_and_riders_are_not(tmp_path):
    person = '<person id="a" x="0" y="2" angle="0" speed="1"/><person id="r" vehicle="a"/>'
    text = fcd_text(STEPS).replace('<vehicle id="b"', f'{person}<vehicle id="b"')
    (tmp_path / "a.xml").write_text(text)
    rows = read_fcd(tmp_path / "a.xml", None, 100.0)
    assert rows.ids == ["a", "a", "b", "c"] and rows.is_person == [False, True, False, False]
    assert (rows.vehicle == 1).sum() == 3 and rows.report.counts["persons"] == 1


def test_a_table_of_sumo_is_one_line(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("timestep_time;vehicle_id\n0;a\n")
    with pytest.raises(UserError, match=r"a.csv: not XML: .*--fcd-output NAME.xml"):
        read_fcd(path, None, 1.0)


def driven(
    factor: float = 1.0,
    speed: str = "",
    begin_s: float = 0.0,
    count: int = 40,
    *,
    angle: float = 90.0,
    step_s: float = 0.1,
) -> str:
    """The text of a vehicle that drives at 10 m/s."""
    steps = [
        (begin_s + k * step_s, {"a": (100 + k * step_s * 10 * factor, 50.0, angle)})
        for k in range(count)
    ]
    return fcd_text(steps).replace("/>", f" {speed}/>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (driven(1e-5), "vehicles: nothing moves faster than 0.0001 m/s: are places in degrees"),
        (driven(1e-3, 'speed="10"'), "go 0.001 times as far as their speeds say"),
        (driven(30).replace("</timestep>", PERSON), "39 of 39 steps are faster than 100 m/s"),
        (driven(step_s=20.0), "steps: a row every 20 s; in between vehicles drive straight"),
        (driven(angle=1.5708), "vehicles: angle fits the way driven as radians"),
        (
            fcd_text([(k, {"a": (k, 1.0, 90.0)} if k % 3 == 0 else {}) for k in range(30)]),
            "a vehicle is there only at one of 3 steps",
        ),
    ],
)
def test_places_that_are_no_metres_are_refused(tmp_path, text, message):
    path = tmp_path / "a.xml"
    path.write_text(text)
    with pytest.raises(UserError, match=f"{message}.*perception.accept: true") as error:
        read_fcd(path, None, 100.0)
    assert str(error.value).startswith(f"{path}: ")
    assert any(message in text for text in read_fcd(path, None, 100.0, True).report.warnings)


def test_feet_are_warned_of_and_metres_are_not(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(driven(3.28, 'speed="10"'))
    assert "go 3.28 times as far" in read_fcd(path, None, 3.0).report.warnings[0]
    path.write_text(driven(1.0, 'speed="10"'))
    assert not read_fcd(path, None, 3.0).report.warnings


def test_an_angle_that_counts_from_east_is_warned_of(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(driven(angle=0.0))
    (warning,) = read_fcd(path, None, 3.0).report.warnings
    assert "vehicles: angle is 90 degrees beside the way driven" in warning


def test_a_file_that_ends_before_the_duration_says_so(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(driven())
    (warning,) = read_fcd(path, None, 86400.0).report.warnings
    assert warning == "ends 3.9 s after the beginning, before 'duration' of 86400 s is over"


def test_the_mark_of_no_place_is_counted_and_passed_over(tmp_path):
    path = tmp_path / "a.xml"
    invalid = '<vehicle id="c" x="-1073741824.00" y="-1073741824.00" angle="0"/>'
    path.write_text(driven().replace("</timestep>", invalid + "</timestep>", 10))
    rows = read_fcd(path, None, 100.0)
    assert rows.ids == ["a"] and len(rows.step) == 40 and sum(rows.report.left_out.values()) == 10
    path.write_text(driven().replace("</timestep>", invalid * 2 + "</timestep>"))
    with pytest.raises(UserError, match="80 of 120 rows would be left out: a place of -1073741824"):
        read_fcd(path, None, 100.0)


def test_it_begins_with_the_first_vehicle_or_says_when_that_comes(tmp_path):
    """Persons, who are there before, are none."""
    empty = [(36000.02 + k, {}) for k in range(20)]
    there = [(36020.04, {"a": (0, 0, 0)}), (36021.04, {"a": (1, 0, 0)})]
    path = tmp_path / "a.xml"
    path.write_text(fcd_text([*empty, *there]).replace("</timestep>", PERSON))
    rows = read_fcd(path, None, 5.0)
    assert rows.times_s.tolist() == [36020.04, 36021.04]
    assert rows.report.chosen == ["begin: 36020.04 s, not 36000.02 s (perception.begin)"]
    first = "the first one comes at 36020.04 s"
    with pytest.raises(UserError, match=f"no vehicles from 36003.1 s to 36008.3 s; {first}"):
        read_fcd(path, 36003.1, 5.2)
    late = write_fcd(tmp_path / "b.xml", there)  # its first step lies behind the window
    with pytest.raises(UserError, match=f"no vehicles from 0 s to 500 ms; {first}"):
        read_fcd(late, 0.0, 0.5)
    with pytest.raises(UserError, match=r"36021.05 s is after the last time step, 36021.04 s"):
        read_fcd(late, 36021.05, 1.0)


@pytest.mark.parametrize(
    ("before", "after", "place"),
    [
        ("<fcd-export>", "<netstate>", "line 1: "),
        ("</fcd-export>", "", "not XML: "),
        ("<fcd-export>", '<!DOCTYPE a [<!ENTITY b "c">]><fcd-export>', "line 1: "),
        (' time="10.50"', "", "line 6: timestep: attribute 'time'"),
        ('time="10.50"', 'time="10.00"', "line 6: timestep: time "),
        ('time="10.50"', 'time="inf"', "line 6: timestep: time: "),
        ("</timestep>", "", "line 6: timestep: "),
        (' x="5.0"', "", "line 7: vehicle 'a': attribute 'x'"),
        (' angle="359.0"', "", "line 8: vehicle 'b': attribute 'angle'"),
        ('id="a" x="5.0"', 'x="5.0"', "line 7: vehicle: attribute 'id'"),
        ('x="5.0" y="1.0"', 'x="5.0" y="north"', "line 7: vehicle 'a': y: "),
        ('x="5.0"', 'x="1e9"', "line 7: vehicle 'a': x: must be a number up to 40,000,000"),
        ('id="b" x="7.0" y="9.0"', 'id="a" x="1" y="1"', "line 8: "),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, before, after, place):
    text = fcd_text(STEPS)
    assert before in text
    path = tmp_path / "a.xml"
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(UserError) as error:
        read_fcd(path, None, 100.0)
    assert str(error.value).startswith(f"{path}: {place}") and "\n" not in str(error.value)


def test_files_without_the_times_or_vehicles_are_refused(tmp_path):
    path = tmp_path / "a.xml"
    with pytest.raises(UserError, match="no such file"):
        read_fcd(path, None, 1.0)
    path.write_text("<fcd-export/>")
    with pytest.raises(UserError, match="has no time steps"):
        read_fcd(path, None, 1.0)
    write_fcd(path, [(0.0, {}), (1.0, {})])
    with pytest.raises(UserError, match="has no vehicles from 0 s on"):
        read_fcd(path, None, 1.0)
    write_fcd(path, STEPS)
    with pytest.raises(UserError, match="begin: 13 s is after the last time step, 12 s"):
        read_fcd(path, 13.0, 1.0)
    broken = gzip.compress(fcd_text(STEPS).encode())[:-20]
    (tmp_path / "b.xml.gz").write_bytes(broken)
    with pytest.raises(UserError, match=r"b.xml.gz: cannot be read"):
        read_fcd(tmp_path / "b.xml.gz", None, 100.0)
