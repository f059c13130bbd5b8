"""Bytes, computing time and energy of a run: closed forms, ranges, and what is not known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from genie_sim.analysis import compare, metrics, prices, summary
from genie_sim.data.sources import RecordedDrives
from genie_sim.links.presets import LINKS
from genie_sim.record.columns import Columns
from genie_sim.record.records import HOSTS, POWER, HostRow, PowerRow
from genie_sim.record.results import Run
from genie_sim.record.tables import Table
from genie_sim.runs import build
from genie_sim.runs.folder import finished, run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.power import INTERFACES, OF_LINKS, DevicePower, Watts
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.interface import InterfaceUse
from tests.make import fixed_device, scenario, street

MS = 1_000_000
S = 1_000 * MS


def watts(value: float, low: float, high: float) -> Watts:
    return Watts(value_w=value, low_w=low, high_w=high, tag="A", source="test")


# car and edge, and the ends of every range, differ in all numbers
CAR_POWER = DevicePower(idle=watts(3, 2, 5), accelerator=watts(9, 7, 12), core=watts(0.8, 0.4, 1.1))
EDGE_POWER = DevicePower(
    idle=watts(70, 50, 95), accelerator=watts(110, 80, 150), core=watts(8, 4, 13)
)


def devices(**powers: DevicePower | None) -> dict[str, DeviceProfile]:
    car = fixed_device("exact_car", detector="31 ms", hop="0 ms", per_megabyte="0 ms")
    edge = fixed_device(
        "exact_edge", detector="11 ms", genie="3 ms", hop="0 ms", per_megabyte="0 ms"
    )
    return {
        "jetson_tx2": replace(car, power=powers.get("car", CAR_POWER)),
        "agx_xavier": replace(edge, power=powers.get("edge", EDGE_POWER)),
    }


def run(methods: list[Any], cars: int = 1, of: Any = None, **settings: Any) -> Run:
    """A run on a street, with devices on which everything takes the same time."""
    setting = scenario(
        cars,
        methods=methods,
        cameras=[{"name": "camera", "recording": "02", "size": "100 kB"}],
        start_jitter="0 s",
        **settings,
    )
    prepared = prepare(
        replace(setting, profiles=of or devices()), frames=RecordedDrives(street(seconds=2.0))
    )
    return finished(prepared, "test", simulate(prepared))


def value(of: Run, name: str, method: str, placement: str = "all", end: str = "value") -> Any:
    (metric,) = (
        metric
        for metric in of.measured
        if (metric.metric, metric.method, metric.placement) == (name, method, placement)
    )
    return getattr(metric, end if end == "value" else f"range_{end}")


@pytest.mark.parametrize("end", ["value", "low", "high"])
def test_energy_of_local_detection_is_a_closed_form(end: str):
    """n frames of 31 ms: E = P_idle T + n P_accelerator 31 ms, and the port; to 1e-9."""
    made = run(["local"])
    car, edge = (
        {part: getattr(getattr(power, part), f"{end}_w") for part in ("idle", "accelerator")}
        for power in (CAR_POWER, EDGE_POWER)
    )
    frames, last_s = 20, 1.9 + 0.031
    port = getattr(INTERFACES["ethernet"].port, end)
    of_car = (car["idle"] + port) * last_s + frames * car["accelerator"] * 0.031
    of_edge = edge["idle"] * last_s
    assert value(made, "energy_per_frame", "local", "car", end) == pytest.approx(
        of_car / frames, rel=1e-9
    )
    assert value(made, "energy_per_frame", "local", "edge", end) == pytest.approx(
        of_edge / frames, rel=1e-9
    )
    assert value(made, "energy_per_frame", "local", "all", end) == pytest.approx(
        (of_car + of_edge) / frames, rel=1e-9
    )
    assert value(made, "accelerator_time", "local", "car") == pytest.approx(0.62, rel=1e-12)
    assert value(made, "accelerator_time", "local", "edge") == 0


def test_every_host_is_idle_for_as_long():
    """Two cars and two edges take twice the idle power of one of each."""
    made = run(["local"], cars=2)
    last_s = 1.9 + 0.031
    port = INTERFACES["ethernet"].port.value
    idle = 2 * (CAR_POWER.idle.value_w + EDGE_POWER.idle.value_w + port) * last_s
    active = 40 * CAR_POWER.accelerator.value_w * 0.031
    assert value(made, "energy_per_frame", "local") * 40 == pytest.approx(idle + active, rel=1e-9)


def test_energy_of_a_radio_is_a_closed_form():
    """Remote over LTE: transfers, what they carry, and the tail between them; to 1e-9."""
    made = run(
        ["remote"],
        interface="lte",
        cars=[
            {
                "name": "car1",
                "device": "jetson_tx2",
                "edge": "edge1",
                "link": {
                    "rate_up": "20 Mbit/s",
                    "rate_down": "80 Mbit/s",
                    "delay": "1 ms",
                    "overhead": 0,
                },
            }
        ],
    )
    (row,) = made.tables["hosts"].where(host="car1").to_frame().to_dict("records")
    frames, lte = 20, INTERFACES["lte"]
    assert row["bytes_up"] == frames * 100_000 and row["interface"] == "lte"
    up_s = frames * 0.8e6 / 20e6
    down_s = row["bytes_down"] * 8 / 80e6
    assert row["transfer_ns"] / S == pytest.approx(up_s + down_s, rel=1e-9)
    first_s = 0.0  # a frame is sent when it is taken; in between the interface is always awake
    answer = made.tables["frames"].to_frame()["fresh_answer_ns"].max() / S - 0.001
    assert row["tail_ns"] / S == pytest.approx(answer - first_s - up_s - down_s, abs=1e-6)
    last_s = made.tables["frames"].to_frame()["fresh_answer_ns"].max() / S
    joules = (
        CAR_POWER.idle.value_w * last_s
        + lte.transfer.value * (up_s + down_s)
        + lte.up.value * frames * 0.8
        + lte.down.value * row["bytes_down"] * 8 / 1e6
        + lte.tail.value * row["tail_ns"] / S
    )
    assert value(made, "energy_per_frame", "remote", "car") == pytest.approx(joules / 20, rel=1e-9)
    assert value(made, "bytes_up_per_frame", "remote") == 100_000
    assert value(made, "bytes_down_per_frame", "remote") == row["bytes_down"] / frames


def test_an_interface_awake_between_transfers_is_counted_once():
    use = InterfaceUse(tail_time_ns=10)
    use.begin(100)
    use.begin(103)  # the other direction
    use.end(105)
    use.end(107)
    assert (use.transfer_ns(107), use.tail_ns) == (7, 0), "awake before the first transfer: no"
    use.begin(111)
    use.end(112)
    use.begin(140)
    assert (use.transfer_ns(145), use.tail_ns) == (7 + 1 + 5, 4 + 10)


def test_bytes_of_hosts_are_those_of_frames():
    made = run_in_memory(
        load_scenario(
            "street_3car_hetero",
            [
                "methods=[remote,genie]",
                *(f"cars[{i}].route.window=[{i} s, {i + 1} s]" for i in range(3)),
            ],
        )
    )
    frames = made.tables["frames"].to_frame().groupby("method", observed=True)
    hosts = made.tables["hosts"].to_frame().groupby("method", observed=True)
    for name in ("bytes_up", "bytes_down"):
        assert (frames[name].sum() == hosts[name].sum()).all() and frames[name].sum().min() > 0
    samples = made.tables["resources"].to_frame()
    last = samples.groupby(["method", "resource"], observed=True)["busy_ns"].last()
    for row in made.tables["hosts"].to_frame().itertuples():
        assert last[row.method, f"{row.host}.accelerator"] == row.accelerator_ns
        assert last[row.method, f"{row.host}.cpu"] == row.cpu_ns
    assert hosts["cpu_ns"].sum()["genie"] > 0


def test_a_device_without_power_is_named_and_its_energy_is_not_known():
    made = run(["local", "remote"], of=devices(edge=None))
    for method in ("local", "remote"):
        assert value(made, "energy_per_frame", method, "all") is None
        assert value(made, "energy_per_frame", method, "edge") is None
        assert value(made, "energy_per_frame", method, "car") > 0
    assert "Not known: the power of exact_edge." in summary.markdown(made).replace("\n", " ")


OWN_RATE = {"rate_up": "50 Mbit/s"}  # of no named link


def test_a_link_without_known_power_is_told_where_it_carries_anything():
    made = run(
        ["local", "remote"],
        cars=[{"name": "car1", "device": "jetson_tx2", "edge": "edge1", "link": OWN_RATE}],
    )
    assert value(made, "energy_per_frame", "remote", "car") is None
    assert value(made, "energy_per_frame", "remote", "edge") > 0
    assert value(made, "energy_per_frame", "local", "all") > 0, "its car sends nothing"
    text = summary.markdown(made).replace("\n", " ")
    assert "Not known: the power of the cars' network interfaces." in text
    counted = run(
        ["remote"],
        interface="none",
        cars=[{"name": "car1", "device": "jetson_tx2", "edge": "edge1", "link": OWN_RATE}],
    )
    assert value(counted, "energy_per_frame", "remote", "car") > 0


@pytest.mark.parametrize(
    ("link", "name"),
    [
        ("ethernet_1g", "ethernet"),
        ("wifi", "wifi"),
        ("lte", "lte"),
        ({"like": "lte", "loss": 0.01}, "lte"),
        ("ideal", "none"),
        ("nr5g", "nr5g"),
        ({"model": "cell", "path_loss": "none"}, "nr5g"),
        ({"model": "trace"}, "nr5g"),
        ({"like": "lte", "rate_up": "9 Mbit/s"}, None),
        ({"like": "nr5g", "rate_up": "100 Mbit/s", "rate_down": "100 Mbit/s"}, None),
    ],
)
def test_the_interface_fits_the_link(link: Any, name: str | None):
    setting = scenario([{"name": "car1", "device": "jetson_tx2", "edge": "edge1", "link": link}])
    found = build._interfaces(setting)
    assert (found["car1"].name if found else None) == name
    assert OF_LINKS.keys() == LINKS.keys()


def test_comparisons_have_prices():
    made = run(["local", "remote"])
    compared = compare.compare([made])
    rows = {row.metric: row for row in compared.rows if row.against}
    assert rows["bytes_up_per_frame"].difference == 100_000
    energy = rows["energy_per_frame"]
    assert energy.difference == pytest.approx(
        value(made, "energy_per_frame", "remote") - value(made, "energy_per_frame", "local")
    )
    assert energy.low is None and energy.by == ""


def test_batches_are_counted():
    batched = {"name": "fours", "method": "remote", "serving": {"batch": 4, "queue": "per_camera"}}
    slow = devices() | {"agx_xavier": fixed_device("slow", detector="90 ms")}
    cars = [{"name": f"car{i}", "device": "jetson_tx2", "edge": "edge1"} for i in range(6)]
    made = run(["remote", batched], cars=cars, of=slow)
    assert value(made, "batch_size", "remote", "edge") == 1
    assert 2 < value(made, "batch_size", "fours", "edge") <= 4


def test_tables_without_hosts_have_no_prices():
    made = run(["local"])
    tables = {name: made.tables[name] for name in ("frames", "lookups")}
    names = {metric.metric for metric in metrics.compute(made.methods, tables)}
    assert "energy_per_frame" not in names and "answered_share" in names
    hosts = Table(HOSTS)
    hosts.append(HostRow("local", "car1", "car", "d", None, 5 * S, 0, 3, 3, 0, 0, 0, 0, 0))
    power = Table(POWER)
    power.append(PowerRow("local", "device", "d", "idle", 1.0, 1.0, 1.0))
    timed = prices.with_time(hosts.columns(), Columns.of(made.tables["frames"]))
    assert prices.energy(timed, power.columns()) == ([None] * 3, ["d"])
    assert timed["there_s"].tolist() == [1.931]


LATE_S = 95


def join(start_s: int) -> Run:
    """Two cars that keep their accelerator and their 10 Mbit/s busy; the first starts so late."""
    link = {"rate_up": "10 Mbit/s", "delay": "1 ms", "overhead": 0}
    who = {"device": "jetson_tx2", "edge": "edge1", "link": link}
    cars = [
        {"name": "car1", **who, "route": {"start": f"{start_s} s"}},
        {"name": "car2", **who},
    ]
    exact = devices()
    slow = fixed_device("exact_car", detector="150 ms", hop="0 ms", per_megabyte="0 ms")
    exact["jetson_tx2"] = replace(slow, power=CAR_POWER)
    return run(["local", "remote"], cars=cars, of=exact)


def test_a_car_costs_the_same_however_late_it_starts():
    """Rates, use and energy of cars are those of the time in which they drive."""
    together, apart = join(0), join(LATE_S)
    of_cars = {"car1.accelerator", "car2.accelerator", "car1->edge1", "car2->edge1"}
    of_cars |= {"edge1->car1", "edge1->car2", "car1.cpu"}
    late = {one[:4]: one.value for one in apart.measured}
    compared = 0
    for one in together.measured:
        of_host = one.component in of_cars and one.method == "local"
        energy = one.metric.startswith("energy") and one.placement == "car"
        if of_host or (one.method == "local" and energy):
            assert late[one[:4]] == pytest.approx(one.value, rel=1e-9), one
            compared += 1
        if one.metric == "utilization" and one.component.endswith("->edge1"):
            assert late[one[:4]] == pytest.approx(one.value, rel=0.01), one
    assert compared > 3
    busy = [
        metric.value
        for metric in apart.measured
        if (metric.metric, metric.component) == ("utilization", "car1.accelerator")
    ]
    assert busy[0] > 0.95
