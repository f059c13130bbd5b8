"""A radio cell against theory: processor sharing, the path loss of TR 38.901, and fields over the
ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from genie_sim.base.seeds import Draws, stream
from genie_sim.links.cell import Band, RadioCell
from genie_sim.links.path_loss import NormalField, StreetCanyon, los_db, los_probability, nlos_db
from genie_sim.links.wire import Wire
from genie_sim.sim.clock import Clock
from genie_sim.sim.link_model import LinkEnds
from tests.sim.processes import send, transmitter
from tests.theory.replications import equivalent

SEED, S = 6, 1_000_000_000
FREE = RadioCell(path_loss="none")  # 25 MHz x 2 layers x 2 bit/s/Hz up


@dataclass
class Street:
    """The air of these tests: one edge at the origin, and cars that stand where a test says."""

    clock: Clock = field(default_factory=Clock)
    seed: int = SEED
    edges: tuple[str, ...] = ("edge1",)
    resources: list = field(default_factory=list)
    place: Callable[[str], tuple[float, float]] = lambda car: (50.0, 0.0)

    def draws(self, *names):
        return Draws(self.seed, *names)

    def site(self, edge):
        return 0.0, 0.0

    def add_resource(self, resource):
        self.resources.append(resource)


def transmitters(cell: RadioCell, air: Street, count: int, up: bool = True):
    ends = [LinkEnds(f"car{i}->edge1", f"car{i}", "edge1", up) for i in range(count)]
    fresh = replace(cell)  # of a run of its own
    return [fresh.transmitter(air, of_car) for of_car in ends]


def ends_ns(
    cell: RadioCell, messages: list[tuple[int, int]], air: Street | None = None
) -> list[int]:
    """When messages end: (begin [ns], bytes), each from a car of its own."""
    air = air or Street()
    ended = [0] * len(messages)
    cars = transmitters(cell, air, len(messages))
    for number, (begin_ns, size_bytes) in enumerate(messages):

        def end(number: int = number) -> None:
            ended[number] = air.clock.now

        air.clock.after(begin_ns, send, (air.clock, cars[number], size_bytes, end))
    air.clock.run()
    return ended


SIZE = 500_000  # bytes: 40 ms alone


def constant(rng: np.random.Generator) -> int:
    return SIZE


def exponential(rng: np.random.Generator) -> int:
    return max(1, round(rng.exponential(SIZE)))


def hyperexponential(rng: np.random.Generator) -> int:
    """A tenth of the messages carries half of the bytes; squared coefficient of variation 4.6."""
    mean = 5 * SIZE if rng.random() < 0.1 else SIZE * 5 / 9
    return max(1, round(rng.exponential(mean)))


@pytest.mark.no_cover
@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("rho", [0.3, 0.6, 0.8])
@pytest.mark.parametrize("size", [exponential, constant, hyperexponential])
def test_mean_time_in_the_cell_is_that_of_processor_sharing(rho: float, size):
    """M/G/1-PS: S / (1 - rho), whatever the law of the sizes, within 4 %: the 99 % interval of 10
    replications of 20,000 messages. The mean wait of the same messages in an M/G/1 queue, first
    come, first served, is the control variate: its mean is known (Pollaczek-Khinchine).
    """
    alone_s = SIZE * 8 / FREE.rate_bps(True)
    squares = {"exponential": 2, "constant": 1, "hyperexponential": 2 * (0.1 * 25 + 0.9 * 25 / 81)}
    expected_wait_s = rho * squares[size.__name__] / 2 / (1 - rho) * alone_s
    pairs = []
    for number in range(10):
        rng = stream(8, "processor sharing", size.__name__, str(rho), number)
        gaps_ns = np.rint(rng.exponential(alone_s / rho, 20_000) * S).astype(int)
        sizes = [size(rng) for _ in gaps_ns]
        steps = np.array(sizes[:-1]) / SIZE * alone_s - gaps_ns[1:] / S
        walk = np.concatenate([[0.0], np.cumsum(steps)])
        wait_s = float(np.mean(walk - np.minimum.accumulate(walk)))
        spent_s = float(np.mean(times_in_cell_ns(gaps_ns.cumsum().tolist(), sizes))) / S
        pairs.append((spent_s / (alone_s / (1 - rho)), wait_s / expected_wait_s))
    spent, wait = np.array(pairs).T
    slope = float(np.cov(spent, wait)[0, 1] / np.var(wait, ddof=1))
    assert equivalent(spent - slope * (wait - 1), expected=1.0, margin=0.04)


def times_in_cell_ns(begins_ns: list[int], sizes: list[int]) -> list[int]:
    """How long each message takes that comes to a cell."""
    air, idle, spent_ns, cell = Street(), [], [], replace(FREE)

    def arrive(size_bytes: int) -> None:
        name = f"car{len(spent_ns)}"
        car = idle.pop() if idle else cell.transmitter(air, LinkEnds(name, name, "edge1", True))
        begin_ns = air.clock.now

        def end() -> None:
            spent_ns.append(air.clock.now - begin_ns)
            idle.append(car)

        send(air.clock, car, size_bytes, end)

    for begin_ns, size_bytes in zip(begins_ns, sizes, strict=True):
        air.clock.after(begin_ns, arrive, (size_bytes,))
    air.clock.run()
    assert len(spent_ns) == len(sizes)
    return spent_ns


@pytest.mark.parametrize("size_bytes", [1, 81, 90_000, 1_397_297])
def test_a_car_alone_takes_as_long_as_on_a_wire(size_bytes: int):
    """To the nanosecond, at an odd rate and across several updates of the places."""
    cell = RadioCell(up=Band(7_333_333, layers=1))
    loss_db = StreetCanyon(Street(), "edge1", (0, 0), carrier_hz=cell.carrier_hz, shadowing=True)
    rate_bps = cell.rate_bps(True, loss_db.db(50.0, 0.0))
    wire = transmitter(Wire(rate_bps, None, 0, overhead_bytes=0))
    assert 10**6 < rate_bps < cell.rate_bps(True) + 1
    (end_ns,) = ends_ns(cell, [(17, size_bytes)])
    assert end_ns - 17 == wire.occupied_ns(size_bytes, 17)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_equal_cars_that_begin_together_end_together(count: int):
    alone_ns = SIZE * 8 * S // FREE.rate_bps(True)
    assert ends_ns(FREE, [(0, SIZE)] * count) == [count * alone_ns] * count


def test_two_cars_by_hand():
    """The second comes when half of the first is sent: both then have half of the cell. The first
    ends after 40/2 + 2 * 40/2 ms, and the second has sent half of its own by then.
    """
    ms = S // 1000
    assert ends_ns(FREE, [(0, SIZE), (20 * ms, SIZE)]) == [60 * ms, 80 * ms]


def test_up_and_down_are_apart_and_so_are_edges():
    air = Street(edges=("edge1", "edge2"))
    cell, ended = replace(FREE), {}
    for ends in (("a", "edge1", True), ("b", "edge1", False), ("c", "edge2", True)):
        car = cell.transmitter(air, LinkEnds(ends[0], *ends))
        send(air.clock, car, SIZE, lambda name=ends[0]: ended.update({name: air.clock.now}))
    air.clock.run()
    up_ns, down_ns = (SIZE * 8 * S // FREE.rate_bps(up) for up in (True, False))
    assert ended == {"a": up_ns, "b": -(-SIZE * 8 * S // FREE.rate_bps(False)), "c": up_ns}
    assert down_ns < up_ns / 5, "75 MHz of 4.4 bit/s/Hz down, 25 MHz of 2 up"
    names = {resource.name: resource for resource in air.resources}
    assert set(names) == {f"edge{i}.cell_{way}" for i in (1, 2) for way in ("up", "down")}
    assert names["edge1.cell_up"].busy_ns == up_ns and names["edge2.cell_down"].busy_ns == 0
    assert names["edge1.cell_up"].sent_bytes == SIZE and names["edge1.cell_up"].completed == 1


def test_a_car_that_drives_away_becomes_slower():
    air = Street()
    air.place = lambda car: (20.0 if air.clock.now < 50_000_000 else 180.0, 0.0)
    (end_ns,) = ends_ns(RadioCell(shadowing=False), [(0, 5_000_000)], air)
    near_bps, far_bps = (
        RadioCell(shadowing=False).rate_bps(True, _loss(at_m).db(at_m, 0.0))
        for at_m in (20.0, 180.0)
    )
    assert 0 < far_bps < near_bps
    bits_left = 5_000_000 * 8 - near_bps * 0.1  # places are looked at every 100 ms
    assert end_ns / S == pytest.approx(0.1 + bits_left / far_bps, rel=1e-6)


def _loss(at_m: float) -> StreetCanyon:
    return StreetCanyon(Street(), "edge1", (0, 0), carrier_hz=3_500_000_000, shadowing=False)


def test_without_coverage_a_message_waits_a_second_and_is_lost():
    air = Street(place=lambda car: (5000.0, 0.0))
    assert RadioCell().rate_bps(True, 160.0) == 0
    (far,) = transmitters(RadioCell(), air, 1)
    ended = []
    send(
        air.clock,
        far,
        SIZE,
        lambda: ended.append((air.clock.now, far.delay_ns(SIZE, air.clock.now))),
    )
    air.clock.run()
    assert ended == [(S, None)]
    assert air.resources[0].drops == 1 and air.resources[0].busy_ns == 0


def test_coverage_that_comes_back_in_time_keeps_the_bits():
    """And who has no coverage takes nothing from the others."""
    air = Street()
    air.place = lambda car: (5000.0 if car == "car0" and air.clock.now < S // 2 else 10.0, 0.0)
    cell = RadioCell(shadowing=False)
    alone_ns = -(-SIZE * 8 * S // cell.rate_bps(True, _loss(10).db(10.0, 0.0)))
    assert ends_ns(cell, [(0, SIZE), (0, SIZE)], air) == [S // 2 + alone_ns, alone_ns]


def test_a_link_that_goes_down_gives_its_share_to_the_others():
    air, ended = Street(), {}
    first, second = transmitters(FREE, air, 2)
    for name, car in (("first", first), ("second", second)):
        send(air.clock, car, SIZE, lambda name=name: ended.update({name: air.clock.now}))
    alone_ns = SIZE * 8 * S // FREE.rate_bps(True)
    air.clock.after(alone_ns // 2, first.set_available, (False,))
    air.clock.run()
    assert ended == {"first": alone_ns // 2, "second": alone_ns // 2 + alone_ns * 3 // 4}
    send(air.clock, first, SIZE, lambda: ended.update(later=air.clock.now))
    now_ns = air.clock.now
    air.clock.run()
    assert ended["later"] == now_ns, "a link that is down takes no time"


@pytest.mark.parametrize(
    ("distance_m", "los", "nlos", "probability"),
    [
        # by hand, at 3.5 GHz: 20 lg f = 10.881, 21.3 lg f = 11.589
        (10.0, 64.281, 69.289, 1.0),
        (100.0, 85.281, 104.589, 0.18 + 0.82 * math.exp(-100 / 36)),
        (200.0, 91.603, 115.216, 0.09 + 0.91 * math.exp(-200 / 36)),
    ],
)
def test_path_loss_of_the_street_canyon(distance_m, los, nlos, probability):
    assert los_db(distance_m, 3.5) == pytest.approx(los, abs=2e-3)
    assert nlos_db(distance_m, 3.5) == pytest.approx(nlos, abs=2e-3)
    assert los_probability(distance_m) == pytest.approx(probability)


def test_the_link_budget_by_hand():
    """23 dBm - 110 dB - (-174 + 74 + 5) dBm - 3 dB over 25 MHz up; 44 dBm and 9 dB over 75 MHz."""
    cell = RadioCell()
    assert cell.sinr_db(True, 110.0) == pytest.approx(23 - 110 + 174 - 73.979 - 5 - 3, abs=1e-3)
    assert cell.sinr_db(False, 110.0) == pytest.approx(44 - 110 + 174 - 78.751 - 9 - 3, abs=1e-3)
    sinr = 10 ** (cell.sinr_db(True, 110.0) / 10)
    assert cell.rate_bps(True, 110.0) == int(25e6 * 2 * 0.4 * math.log2(1 + sinr))
    assert cell.rate_bps(True, 60.0) == cell.rate_bps(True) == 100_000_000
    assert cell.rate_bps(False, 60.0) == 660_000_000
    assert replace(cell, interference_margin_db=6.0).rate_bps(True, 110.0) < cell.rate_bps(
        True, 110.0
    )


def test_a_field_is_standard_normal_and_correlated_over_its_spacing():
    """Over 300 fields: mean and variance within 4 standard errors at a corner and within a square;
    far places are independent.
    """
    places = {
        "corner": (20.0, -30.0),
        "inside": (23.0, -35.0),
        "near": (21.0, -31.0),
        "far": (900, 0),
    }
    values: dict[str, list[float]] = {name: [] for name in places}
    for number in range(300):
        draws = Draws(number, "field")
        ground = NormalField(lambda x, y, draws=draws: draws.normal(f"{x} {y}"), 10.0)
        for name, place in places.items():
            values[name].append(ground.at(*place))
            assert ground.at(*place) == values[name][-1]
    for column in values.values():
        assert np.mean(column) == pytest.approx(0, abs=4 / math.sqrt(300))
        assert np.var(column) == pytest.approx(1, abs=4 * math.sqrt(2 / 300))
    correlation = np.corrcoef([values[name] for name in ("corner", "near", "far")])
    assert correlation[0, 1] > 0.9 and abs(correlation[0, 2]) < 4 / math.sqrt(300)


def test_line_of_sight_is_as_frequent_as_it_should_be():
    """At 60 m from 400 sites, within 4 standard errors: where the loss is lower."""
    expected = los_probability(60.0)
    sights = []
    for number in range(400):
        air = Street(seed=number)
        loss = StreetCanyon(air, "edge1", (0, 0), carrier_hz=3_500_000_000, shadowing=False)
        sights.append(loss.db(0.0, 60.0) < nlos_db(math.hypot(60.0, 8.5), 3.5) - 1)
    assert np.mean(sights) == pytest.approx(
        expected, abs=4 * math.sqrt(expected * (1 - expected) / 400)
    )


BANDS_HZ = st.integers(100_000, 3 * 10**9)
LOSSES_DB = st.floats(30.0, 190.0)


@given(BANDS_HZ, BANDS_HZ, LOSSES_DB, LOSSES_DB, st.booleans())
def test_a_rate_never_falls_with_bandwidth_nor_rises_with_path_loss(
    one_hz: int, other_hz: int, one_db: float, other_db: float, up: bool
):
    narrow, wide = (
        replace(FREE, path_loss="umi", up=Band(hz), down=Band(hz))
        for hz in sorted((one_hz, other_hz))
    )
    near_db, far_db = sorted((one_db, other_db))
    assert 0 <= narrow.rate_bps(up, near_db) <= wide.rate_bps(up, near_db) + 1
    assert 0 <= wide.rate_bps(up, far_db) <= wide.rate_bps(up, near_db) + 1
    assert wide.rate_bps(up, near_db) <= wide.rate_bps(up)


@given(st.floats(1.0, 5_000.0), st.floats(1.0, 5_000.0))
def test_path_loss_never_falls_with_distance(one_m: float, other_m: float):
    near_m, far_m = sorted((one_m, other_m))
    for loss_db in (los_db, nlos_db):
        assert loss_db(near_m, 3.5) <= loss_db(far_m, 3.5) + 1e-9


@given(st.integers(1, 9), st.floats(10.0, 400.0), st.integers(10**6, 10**9))
def test_a_message_is_no_sooner_there_with_more_cars_or_less_bandwidth(
    cars: int, distance_m: float, bandwidth_hz: int
):
    def end_ns(count: int, hz: int) -> int:
        air = Street(place=lambda car: (distance_m, 0.0))
        return ends_ns(RadioCell(up=Band(hz)), [(0, 50_000)] * count, air)[0]

    loss_db = _loss(0.0).db(distance_m, 0.0)
    assume(RadioCell().rate_bps(True, loss_db))
    usual_ns = end_ns(cars, bandwidth_hz)
    assert usual_ns < end_ns(cars + 1, bandwidth_hz)
    assert usual_ns >= end_ns(cars, 2 * bandwidth_hz) - 1
