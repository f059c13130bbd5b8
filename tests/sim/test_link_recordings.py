"""Recorded links: rates and round trips over time, against results by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.links import recording
from genie_sim.links.recorded import RecordedLink
from genie_sim.links.recording import StepFunction
from genie_sim.links.wire import Wire
from genie_sim.runs.prepare import prepare
from genie_sim.sim.link_model import LinkEnds
from tests.conformance import small
from tests.sim.processes import DOWN, UP, transmitter
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
    wire = transmitter(Wire(rate_bps, None, rtt_ns // 2, overhead_bytes=0))
    replayed = transmitter(RecordedLink(rate=path, rtt=path))
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
    at_begin = transmitter(RecordedLink(offset="begin", begin_ns=150 * MS))
    delays = [at_begin.delay_ns(1, row * 50 * MS) for row in range(20)]
    assert delays == [rtt // 2 for rtt in rtts[3:23]]


def test_a_car_begins_at_a_place_of_its_own_in_step_for_all_of_its_links():
    of_car1, down, at_edge2, of_car2, other_seed = (
        [
            transmitter(RecordedLink(rtt="urban_n78_generated"), ends, seed=seed).delay_ns(1, t * S)
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


def test_constant_rates_stand_in_for_what_was_not_recorded(tmp_path):
    path = write(tmp_path / "up.parquet", t_ns=[0], up_bps=[8 * MBIT])
    trace = RecordedLink(rate=path, rtt=None, down_bps=80 * MBIT, delay_ns=3)
    assert transmitter(trace).occupied_ns(10**6, 5) == S and transmitter(trace).delay_ns(1, 5) == 3
    assert transmitter(trace, DOWN).occupied_ns(10**6, 5) == S // 10
    assert transmitter(RecordedLink(rtt=None, up_bps=4 * MBIT)).occupied_ns(10**6, 5) == 2 * S


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
    assert set(first) == {"link rate rate1000", "link rtt urban_n78_generated"}
    assert first["link rate rate1000"] != second["link rate rate2000"]
    (tmp_path / "other").mkdir()
    rtt = write(tmp_path / "other/rate1000.parquet", t_ns=[0], rtt_ns=[7])
    both = {"model": "trace", "rate": str(tmp_path / "rate1000.parquet"), "rtt": rtt}
    cars = [small.car(1, link=both), small.car(2, link=both)]
    assert len(set(small.scenario(["remote"], cars=cars).link_digests().values())) == 2
    assert small.scenario(["local"]).link_digests() == {}


@pytest.mark.parametrize(
    ("columns", "settings", "message"),
    [
        ({"up_bps": [5, 0]}, {"loop": False}, "up_bps: ends with a rate of 0"),
        ({"rtt_ns": [5, 5]}, {}, "column up_bps: missing; it has t_ns, rtt_ns"),
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
