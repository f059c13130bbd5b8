"""The speed benchmark compares what it says it compares. How fast anything is decides no test."""

import sys
from dataclasses import replace
from itertools import count

import pytest

from benchmarks import peers, plain_simpy, speed
from benchmarks.plain_simpy import Fleet, Frame
from benchmarks.speed import QUICK, Spent, answers_of, fleet, plain_fleet
from genie_sim.base.errors import UserError
from genie_sim.runs.prepare import prepare
from tools.page_tables import filled

MS = 1_000_000
NO_PYTHON = "/no/such/python"


def one_car(*stamps_ms: int, detection_ms: int) -> Fleet:
    """A car whose every hop takes 1 ms, every message 8 ms on a link, and every flight 2 ms."""
    frames = [
        Frame("car1", "front", stamp_ms * MS, 910, 910, detection_ms * MS) for stamp_ms in stamps_ms
    ]
    hop = (MS, 0)
    return Fleet({"car1": "edge1"}, [frames], hop, hop, MS, 2 * MS)


def test_a_frame_takes_what_its_way_takes():
    answers = plain_simpy.simulate(one_car(5, detection_ms=40))
    assert answers == [("car1", "front", 5 * MS, (5 + 1 + 8 + 2 + 40 + 1 + 8 + 2) * MS)]


def test_a_newer_frame_takes_the_place_of_one_that_waits():
    """The accelerator takes the first at 11 and is free at 111; of those that wait the last."""
    answers = plain_simpy.simulate(one_car(0, 20, 40, 60, detection_ms=100))
    assert [(stamp // MS, answer // MS) for _, _, stamp, answer in answers] == [(0, 122), (60, 222)]


@pytest.mark.parametrize(("cars", "laps", "cameras"), [(3, 2, 1), (3, 1, 4), (25, 1, 4)])
def test_plain_simpy_gives_the_very_same_answers_as_remote(cars: int, laps: int, cameras: int):
    """Three cars and one edge are not busy; four cameras each are too much for the edges."""
    prepared = prepare(fleet(cars, "remote", laps, cameras=cameras))
    plain = plain_fleet(prepared)
    answers = plain_simpy.simulate(plain)
    assert sorted(answers) == sorted(answers_of(prepared))
    assert plain.frames == pytest.approx(20 * laps * cars * cameras, rel=0.1)
    assert len(answers) == plain.frames if cameras == 1 else len(answers) < 0.6 * plain.frames


@pytest.mark.parametrize("name", peers.PEERS)
def test_other_simulators_give_the_same_answers_where_nothing_is_dropped(name: str):
    plain = plain_fleet(prepare(fleet(3, "remote", cameras=1)))
    answer = peers.run_peer(sys.executable, name, plain)
    if "skipped" in answer:
        pytest.skip(f"{name}: {answer['skipped']}")
    assert sorted(map(tuple, answer["answers"])) == sorted(plain_simpy.simulate(plain))


@pytest.mark.process
def test_a_peer_that_cannot_run_is_left_out_with_the_reason():
    plain = one_car(0, detection_ms=1)
    assert "No such file" in peers.run_peer(NO_PYTHON, "ciw", plain)["skipped"]
    many = replace(plain, cameras=[plain.cameras[0] * (peers.MOST_FRAMES["ciw"] + 1)])
    assert "minutes" in peers.run_peer(NO_PYTHON, "ciw", many)["skipped"]


def test_cases_take_turns_round_by_round():
    times = iter((2.0, 1.0, 6.0, 3.0, 4.0, 5.0))
    cases = {"theirs": lambda: next(times), "ours": lambda: next(times)}
    assert speed.in_turn(3, cases) == {"theirs": 4.0, "ours": 3.0}


def test_a_command_that_fails_is_said_in_its_row(monkeypatch: pytest.MonkeyPatch):
    asked = count()

    def run(*arguments: str) -> Spent:
        next(asked)
        if arguments[0] == "reproduce":
            raise UserError("genie-sim reproduce: no room | here")
        return Spent(cpu_s=2, wall_s=3, memory_mb=100)

    monkeypatch.setattr(speed, "genie_sim", run)
    rows = speed.waits(2, ["reproduce"]).splitlines()
    assert rows[3] == "| `genie-sim run scenarios/street_3car_hetero.yaml` | 3.00 | 2.00 | 100 |"
    assert rows[5] == "| `genie-sim reproduce` | genie-sim reproduce: no room / here |  |  |"
    assert "not measured" in rows[6] and next(asked) == 6


@pytest.mark.process
def test_a_command_is_measured_as_a_whole():
    """And apart from this process, however much memory it has."""
    ballast = bytearray(b"x") * 300_000_000
    spent = speed.genie_sim("--version")
    assert spent.cpu_s > 0 and 0 < spent.wall_s < 60
    assert 5 < spent.memory_mb < len(ballast) / 1e6
    with pytest.raises(UserError, match="bogus"):
        speed.genie_sim("bogus")


@pytest.mark.slow
@pytest.mark.nightly
def test_the_whole_benchmark_fills_the_page(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(speed, "genie_sim", lambda *_: Spent(1, 1, 1))
    sizes = replace(QUICK, laps=1, least_frames=1, fleets={3: 1}, growth=(2, 3))
    blocks = dict(speed.measure(sizes, "python benchmarks/speed.py", NO_PYTHON, ()))
    text = filled(speed.PAGE.read_text(encoding="utf-8"), blocks)
    assert text.count(":begin -->") == len(blocks), "no place stays empty"
    assert all(block in text for block in blocks.values())
    assert "| 3 | genie-sim |" in blocks["peers"] and "No such file" in blocks["peers"]
