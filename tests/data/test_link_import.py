"""Measurements of links in the formats of others become recordings, or are refused in one line."""

from __future__ import annotations

import pytest

from genie_sim.base.import_report import ImportReport
from genie_sim.data.link_import import IMPORTERS
from genie_sim.links import recording
from genie_sim.links.recording import StepFunction

S, MS = 1_000_000_000, 1_000_000


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
    assert ran.returncode == 1 and "30 of 31 messages would be left out" in ran.stderr
    options = ("--format", "cicv5g", "--out", "a.parquet", "--accept")
    ran = run_cli("import", "link", "rounded.txt", *options)
    assert ran.returncode == 0 and "warning: 30 of 31 messages" in ran.stdout
    told = recording.read(str(tmp_path / "a.parquet")).about["import"]
    assert [*told["left_out"].values()] == [30]


@pytest.mark.parametrize(
    ("format", "text", "place"),
    [
        ("csv", "time_s\n0\n", "needs a column of up_mbps, down_mbps, rtt_ms"),
        ("csv", "time_s,up [MB/s]\n0,5\n", "rates are in bits"),
        ("csv", "time_s,up_mbps\n0,15000000\n", "up: "),
        ("csv", "time_s,rtt_ms\n0,0.02\n1,0.03\n", "rtt: "),
        ("csv", "time_s,up_mbps\n0,0\n1,0\n", "column up_bps"),
        (
            "csv",
            "time_s,up_mbps\n1660000001.5,5\n1660000001.2,7\n",
            "line 3: time_s: must be more than 1660000001.5, not 1660000001.2",
        ),
        ("csv", "time_s,up_mbps\n", "has no rows"),
        ("csv", "time_s,up_mbps\n1700000000000,30\n", "milliseconds since 1970"),
        ("csv", "time_s,up_mbps\n1700000000000000000,30\n", "nanoseconds since 1970"),
        ("csv", "time_s,up_mbps\n0,1\n500,2\n1000,3\n", "times: a row every 500 s"),
        ("csv", "time_ms,up_mbps\n0.1,1\n0.2,2\n0.3,3\n", "times: a row every 0.0001 s"),
        ("csv", "time_s,up_mbps\n0,1\n1,2\n2,3\n1700000000,4\n", "times: a gap"),
        ("csv", "time_s,up_mbps\n1,40\n2,1e18\n", "line 3: up_mbps"),
        ("csv", "time_s,rtt_ms\n1,1e300\n", "line 2: rtt_ms"),
        ("mahimahi", "0.5\n", "packet 1: 0.5 ms must be a whole number"),
        (
            "mahimahi",
            "1234567\n1234566\n",
            "packet 2: 1234566 ms must be a whole number from 1234567",
        ),
        ("mahimahi", "1\nnan\n", "packet 2"),
        ("mahimahi", "1\n999999999999\n", "packet 2"),
        ("mahimahi", "0\n0\n", "the last packet"),
        ("mahimahi", "\n", "has no packets"),
        ("mahimahi", "x\n", "must be a number, not 'x'"),
        ("mahimahi", "1 2\n", "must be a number, not '1 2'"),
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
