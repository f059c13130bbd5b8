"""Recorded links: rates and round trips over time, against results by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.importers.link_import import IMPORTERS
from genie_sim.links import recording
from genie_sim.links.recorded import RecordedLink
from genie_sim.links.recording import StepFunction
from genie_sim.links.wire import Wire
from genie_sim.runs.prepare import prepare
from genie_sim.sim.link_model import LinkEnds
from tests.conformance import small
from tests.sim.processes import DOWN, UP, sender
from tools.make import urban_n78

S, MBIT, MS = 1_000_000_000, 1_000_000, 1_000_000


def write(path: Path, **columns) -> str:
    recording.write(path, columns, {"source": "tests"})
    return str(path)


@pytest.mark.parametrize("size_bytes", [0, 1, 426, 90_000, 1_397_297, 10**9])
@pytest.mark.parametrize("rows", [1, 4])
def test_a_constant_recording_is_a_wire_to_the_nanosecond(tmp_path, size_bytes: int, rows: int):
    """At an odd rate, anywhere in the recording and over its end."""
    rate_bps, rtt_ns = 7_654_321, 31_000_001
    columns = {"t_ns": [0, 7, 333_333_333, S][:rows], "up_bps": [rate_bps] * rows}
    path = write(tmp_path / "constant.parquet", **columns, rtt_ns=[rtt_ns] * rows)
    wire = sender(Wire(rate_bps, None, rtt_ns // 2, overhead_bytes=0))
    replayed = sender(RecordedLink(rate=path, rtt=path))
    for now_ns in (0, 1, 5 * S // 7, 123_456_789_012):
        assert replayed.occupied_ns(size_bytes, now_ns) == wire.occupied_ns(size_bytes, now_ns)
        assert replayed.delay_ns(size_bytes, now_ns) == wire.delay_ns(size_bytes, now_ns)


@pytest.mark.parametrize(
    ("begin_s", "megabits", "seconds"),
    [
        (0.0, 4, 0.4),  # within the first row, of 10 Mbit/s
        (0.5, 5, 0.5),  # exactly until its end
        (0.5, 7, 2.5 - 0.5 + 0.1),  # over the outage until 2.5 s, and 2 Mbit of 20 Mbit/s
        (1.2, 2, 2.5 - 1.2 + 0.1),  # begun in the outage: the rest of it, then the message
        (2.5, 30, 1.5),  # the last row lasts as long as the one before
        (2.5, 31, 1.6),  # and the recording begins again: its period is 4 s
        (3.9, 2 + 10 + 3, 0.1 + 1 + 1.5 + 0.15),
        (0.0, 2 * 40 + 5, 8.5),  # two whole periods of 40 Mbit
    ],
)
def test_bits_carry_over_rows_and_the_end_by_hand(begin_s, megabits, seconds):
    steps = StepFunction([0, S, 5 * S // 2], [10 * MBIT, 0, 20 * MBIT], loops=True)
    assert steps.period_ns == 4 * S
    took_ns = steps.time_ns(round(begin_s * S), megabits * MBIT * S)
    assert took_ns == pytest.approx(seconds * S, abs=1)


def test_without_a_loop_the_last_row_stays():
    steps = StepFunction([0, S], [10 * MBIT, 40 * MBIT], loops=False)
    assert steps.time_ns(0, 50 * MBIT * S) == 2 * S
    assert steps.time_ns(99 * S, 20 * MBIT * S) == S // 2
    assert (steps.at(0), steps.at(S), steps.at(99 * S)) == (10 * MBIT, 40 * MBIT, 40 * MBIT)
    assert StepFunction([0, S], [1, 2], loops=True).at(3 * S) == 2


def test_the_time_is_that_of_the_integral():
    """On random recordings: just enough is sent by then, and not a nanosecond before."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        t_ns = [0, *np.cumsum(rng.integers(1, 1000, 5)).tolist()]
        steps = StepFunction(
            t_ns, [*rng.integers(0, 4, 5).tolist(), 2], loops=bool(rng.integers(2))
        )
        begin_ns, amount = int(rng.integers(0, 5000)), int(rng.integers(1, 20_000))
        took_ns = steps.time_ns(begin_ns, amount)
        sent = np.cumsum([steps.at(begin_ns + t) for t in range(took_ns)])
        assert sent[-1] >= amount and (took_ns == 1 or sent[-2] < amount)


def test_the_round_trip_is_that_of_the_time():
    path = "urban_n78_generated"
    rtts = recording.read(path).columns["rtt_ns"]
    at_begin = sender(RecordedLink(offset="begin", begin_ns=150 * MS))
    delays = [at_begin.delay_ns(1, row * 50 * MS) for row in range(20)]
    assert delays == [rtt // 2 for rtt in rtts[3:23]]


def test_a_car_begins_at_a_place_of_its_own_in_step_for_all_of_its_links():
    of_car1, down, at_edge2, of_car2, other_seed = (
        [
            sender(RecordedLink(rtt="urban_n78_generated"), ends, seed=seed).delay_ns(1, t * S)
            for t in range(20)
        ]
        for ends, seed in (
            (UP, 1),
            (DOWN, 1),
            (LinkEnds("car1->edge2", "car1", "edge2", up=True), 1),
            (LinkEnds("car2->edge1", "car2", "edge1", up=True), 1),
            (UP, 2),
        )
    )
    assert of_car1 == down == at_edge2
    assert of_car1 != of_car2 and of_car1 != other_seed


def test_a_car_has_the_link_of_the_row_that_is_nearest(tmp_path):
    path = write(
        tmp_path / "places.parquet",
        t_ns=[0, S, 2 * S],
        up_bps=[MBIT, 2 * MBIT, 4 * MBIT],
        rtt_ns=[10 * MS, 20 * MS, 40 * MS],
        east_m=[0.0, 50.0, 50.0],
        north_m=[0.0, 0.0, 90.0],
    )
    trace = RecordedLink(rate=path, rtt=path, offset="position")
    for place, rate_bps, delay_ms in (
        ((3.0, -9.0), 1, 5),
        ((40.0, 20.0), 2, 10),
        ((40.0, 70.0), 4, 20),
    ):
        there = sender(trace, place=place)
        assert there.occupied_ns(12_500, 77 * S) == S // 10 // rate_bps
        assert there.delay_ns(1, 77 * S) == delay_ms * MS


def test_constant_rates_stand_in_for_what_was_not_recorded(tmp_path):
    path = write(tmp_path / "up.parquet", t_ns=[0], up_bps=[8 * MBIT])
    trace = RecordedLink(rate=path, rtt=None, down_bps=80 * MBIT, delay_ns=3)
    assert sender(trace).occupied_ns(10**6, 5) == S and sender(trace).delay_ns(1, 5) == 3
    assert sender(trace, DOWN).occupied_ns(10**6, 5) == S // 10
    assert sender(RecordedLink(rtt=None, up_bps=4 * MBIT)).occupied_ns(10**6, 5) == 2 * S


def test_the_shipped_recording_is_the_generated_one():
    shipped = recording.read("urban_n78_generated")
    assert shipped.columns == urban_n78.columns()
    assert "not a measurement" in shipped.about["source"]
    quantiles_ms = np.quantile(np.array(shipped.columns["rtt_ns"]) / MS, [0.5, 0.95, 0.99])
    assert quantiles_ms == pytest.approx([16, 24, 29], rel=0.05)


def test_a_recording_decides_the_id_of_a_run(tmp_path):
    def digests(rate_bps: int) -> dict[str, str]:
        path = write(tmp_path / f"rate{rate_bps}.parquet", t_ns=[0], up_bps=[rate_bps])
        link = {"model": "trace", "rate": path}
        setting = small.scenario(["remote"], cars=[small.car(1, link=link), small.car(2)])
        found = prepare(setting).facts["traces"]
        return {name: text for name, text in found.items() if name.startswith("link ")}

    first, second = digests(1000), digests(2000)
    assert set(first) == {"link rate1000", "link urban_n78_generated"}
    assert first["link rate1000"] != second["link rate2000"]
    assert small.scenario(["local"]).link_digests() == {}


CSV = "time_s,up_mbps,down_mbps,rtt_ms\n10,1.5,50,20\n11,0,50,30.5\n12.5,20,40,25\n"
MTU_TIME = "Thu Aug 11 13:42:01 UTC 2022"
CICV5G_TITLES = "pub_time(ms),delay(ms),utmX(m),utmY(m)"
CICV5G = (
    "pub_time(ms)\tsub_time(ms)\tdelay(ms)\tutmX(m)\tutmY(m)\n"
    "1000 \t1017 \t17\t500.25\t70.5\n1000 \t1018 \t18\t500.25\t70.5\n1054 \t1077\t23\t501.5\t70\n"
)
MTU = (
    "Time,rsrp(dBm),RATE(MBit/s)\nThu Aug 11 13:42:06 UTC 2022,-96,99.0\n"
    "Thu Aug 11 13:42:09 UTC 2022,-95,15.2\nThu Aug 11 13:42:13 UTC 2022,-95,13.4\n"
)


@pytest.mark.parametrize(
    ("format", "text", "columns"),
    [
        (
            "csv",
            CSV,
            {
                "t_ns": [10 * S, 11 * S, 12_500_000_000],
                "up_bps": [1_500_000, 0, 20_000_000],
                "down_bps": [50_000_000, 50_000_000, 40_000_000],
                "rtt_ns": [20 * MS, 30_500_000, 25 * MS],
            },
        ),
        (
            "cicv5g",
            CICV5G,
            {
                "t_ns": [0, 54 * MS],
                "rtt_ns": [17 * MS, 23 * MS],
                "east_m": [0.0, 1.25],
                "north_m": [0.0, -0.5],
            },
        ),
        ("mtu", MTU, {"t_ns": [0, 3 * S], "up_bps": [15_200_000, 13_400_000]}),
        (
            "mahimahi",  # until 400 ms
            "5\n100\n101\n350\n400\n",
            {
                "t_ns": [0, 100 * MS, 200 * MS, 300 * MS],
                "up_bps": [240_000, 120_000, 0, 240_000],
            },
        ),
        ("mahimahi", "1\n", {"t_ns": [0], "up_bps": [12_000_000]}),
        (
            "mahimahi",  # three parts of 250/3 ms, of 2, 1 and 2 packets
            "0\n83\n84\n250\n250\n",
            {
                "t_ns": [0, 83_333_333, 166_666_667],
                "up_bps": [288_000, 144_000, 288_000],
            },
        ),
    ],
)
def test_formats(tmp_path, format: str, text: str, columns: dict):
    path = tmp_path / "file.txt"
    path.write_text(text)
    report = ImportReport(path)
    assert IMPORTERS[format](path, "up", report) == columns


def test_a_trace_of_mahimahi_begins_again_after_its_last_time(tmp_path):
    """What is sent in ten seconds of replay is what Mahimahi would send: 4 packets in 350 ms."""
    path = tmp_path / "file.trace"
    path.write_text("5\n100\n101\n350\n")
    columns = IMPORTERS["mahimahi"](path, "up", ImportReport(path))
    steps = StepFunction(columns["t_ns"], columns["up_bps"], loops=True)
    assert steps.period_ns == pytest.approx(350 * MS, abs=2)
    bits = steps._sums[-1] / S
    assert bits == pytest.approx(4 * 12_000, rel=1e-5)


def test_rounded_times_are_refused_unless_they_are_accepted(run_cli, tmp_path):
    header, _, rows = CICV5G.partition("\n")
    (tmp_path / "rounded.txt").write_text(header + f"\n{rows.splitlines()[0]}" * 31)
    ran = run_cli("import", "link", "rounded.txt", "--format", "cicv5g", "--out", "a.parquet")
    assert ran.returncode == 1 and "31 messages have only 1 times: rounded" in ran.stderr
    options = ("--format", "cicv5g", "--out", "a.parquet", "--accept")
    ran = run_cli("import", "link", "rounded.txt", *options)
    assert ran.returncode == 0 and "warning: pub_time(ms): 31 messages" in ran.stdout
    told = recording.read(str(tmp_path / "a.parquet")).about["import"]
    assert told["left_out"] == {"messages sent in the millisecond of another": 30}


@pytest.mark.parametrize(
    ("format", "text", "place"),
    [
        ("csv", "time_s\n0\n", "needs a column of up_mbps, down_mbps, rtt_ms"),
        ("csv", "time_s,up [MB/s]\n0,5\n", "rates are in bits"),
        ("csv", "time_s,up_mbps\n0,15000000\n", "up: "),
        ("csv", "time_s,rtt_ms\n0,0.02\n1,0.03\n", "rtt: "),
        ("csv", "time_s,up_mbps\n0,0\n1,0\n", "column up_bps"),
        ("csv", "time_s,up_mbps\n1,5\n0.5,7\n", "line 3: time_s"),
        ("csv", "time_s,up_mbps\n", "has no rows"),
        ("csv", "time_s,up_mbps\n1700000000000,30\n", "milliseconds since 1970"),
        ("csv", "time_s,up_mbps\n1700000000000000000,30\n", "nanoseconds since 1970"),
        ("csv", "time_s,up_mbps\n0,1\n500,2\n1000,3\n", "times: a row every 500 s"),
        ("csv", "time_ms,up_mbps\n0.1,1\n0.2,2\n0.3,3\n", "times: a row every 0.0001 s"),
        ("csv", "time_s,up_mbps\n0,1\n1,2\n2,3\n1700000000,4\n", "times: a gap"),
        ("csv", "time_s,up_mbps\n1,40\n2,1e18\n", "line 3: up_mbps"),
        ("csv", "time_s,rtt_ms\n1,1e300\n", "line 2: rtt_ms"),
        ("csv", "time_s,rtt_ms,east_m\n1,1,1e300\n", "line 2: east_m"),
        ("mahimahi", "0.5\n", "line 1"),
        ("mahimahi", "7\n3\n", "line 2"),
        ("mahimahi", "1\n999999999999\n", "line 2"),
        ("mahimahi", "0\n0\n", "the last packet"),
        ("mahimahi", "x\n", "line 1"),
        ("mtu", "Time,RATE(MBit/s)\nnoon,1\n", "line 2: Time"),
        ("mtu", f"Time,RATE(MBit/s)\n{MTU_TIME},1e308\n", "line 2: rate_mbps"),
        (
            "mtu",
            f"Time,RATE(MBit/s)\n{MTU_TIME},1\n{MTU_TIME.replace('2022', '9999')},1\n"
            f"{MTU_TIME.replace('2022', '9999').replace('01', '02')},1\n",
            "t_ns: row 1",
        ),
        ("cicv5g", "pub_time(ms)\n0\n", "column 'delay_ms'"),
        ("cicv5g", f"{CICV5G_TITLES}\n100,-1e308,1,2\n", "line 2: delay_ms"),
        ("cicv5g", f"{CICV5G_TITLES}\n1e300,1,1,2\n", "line 2: pub_time_ms"),
        ("cicv5g", f"{CICV5G_TITLES}\n1,1,1e300,2\n", "line 2: utmX_m"),
    ],
)
def test_what_cannot_be_imported_is_one_line(run_cli, tmp_path, format, text, place):
    (tmp_path / "drive.txt").write_text(text)
    ran = run_cli("import", "link", "drive.txt", "--format", format, "--out", "drive.parquet")
    assert ran.returncode == 1 and place in ran.stderr and "drive.txt" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1 and not (tmp_path / "drive.parquet").exists()


@pytest.mark.parametrize(
    ("titles", "row", "message"),
    [
        ("up_mbps", "40000", "up: at most 40,000 Mbit/s, unusual of a radio link"),
        ("up_mbps", "0.12", "up: at most 0.12 Mbit/s, unusual"),
        ("rtt_ms", "0.06", "rtt: a median of 0.06 ms, unusual of a radio link"),
        ("rtt_ms", "20000", "rtt: a median of 20,000 ms, unusual"),
        ("down_mbps", "50", "down: always 50 Mbit/s: does that stand for unknown?"),
    ],
)
def test_what_is_unusual_of_a_link_is_told(run_cli, tmp_path, titles, row, message):
    """A factor of a thousand in the unit, and numbers that stand for none."""
    rows = "".join(f"{second},{row}\n" for second in range(20))
    (tmp_path / "drive.csv").write_text(f"time_s,{titles}\n{rows}")
    ran = run_cli("import", "link", "drive.csv", "--out", "drive.parquet")
    assert ran.returncode == 0 and f"warning: {message}" in ran.stdout, ran


def test_a_number_far_beyond_the_others_is_told(run_cli, tmp_path):
    rows = "".join(f"{second},{9999 if second % 5 == 0 else 20 + second}\n" for second in range(20))
    (tmp_path / "drive.csv").write_text(f"time_s,rtt_ms\n{rows}")
    ran = run_cli("import", "link", "drive.csv", "--out", "drive.parquet")
    assert "4 of 20 values are more than 100 times the median, up to 9,999 ms" in ran.stdout


def test_an_imported_drive_is_replayed(run_cli, tmp_path):
    (tmp_path / "drive.csv").write_text(CSV)
    ran = run_cli("import", "link", "drive.csv", "--out", "drive.parquet", "--licence", "CC0")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines() == [
        "drive.parquet: 3 rows, 2.5 s: up_bps, down_bps, rtt_ns",
        "  read: 3 rows",
        "  ranges: up 0 to 20 Mbit/s, down 40 to 50 Mbit/s, rtt 20 to 30.5 ms",
    ]
    drive = recording.read(str(tmp_path / "drive.parquet"))
    assert drive.about["licence"] == "CC0" and len(drive.about["sha256"]) == 64
    assert drive.columns["t_ns"][0] == 0
    replayed = "{model: trace, rate: drive.parquet, rtt: drive.parquet}"
    run = ("run", "street_1car_homo", "--set", "methods=[remote]", "--no-report")
    ran = run_cli(*run, "--set", f"cars[0].link={replayed}")
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize(
    ("columns", "settings", "message"),
    [
        ({"up_bps": [5, 0]}, {"loop": False}, "up_bps: ends with a rate of 0"),
        ({"rtt_ns": [5, 5]}, {}, "column up_bps: missing; it has t_ns, rtt_ns"),
        ({"up_bps": [5, 5]}, {"offset": "position"}, "column east_m: missing"),
        ({"up_bps": [5, 5]}, {"rtt": "nowhere"}, "unknown recorded link 'nowhere'"),
    ],
)
def test_a_recording_that_does_not_fit_is_one_line(tmp_path, columns, settings, message):
    path = write(tmp_path / "drive.parquet", t_ns=[0, S], **columns)
    link = {"model": "trace", "rate": path, **settings}
    with pytest.raises(UserError) as error:
        small.scenario(["remote"], cars=[small.car(1, link=link), small.car(2)])
    text = str(error.value)
    assert message in text and "cars[0].link: " in text and "\n" not in text
