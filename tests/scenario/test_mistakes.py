"""A mistake in a scenario is told in one line, which names the field, the kind of mistake, and the
choices where there are.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.reading import load_scenario

STREET = """\
edges:
  - {name: edge1, device: agx_xavier}
  - {name: edge2, device: agx_xavier}
cars:
  - {name: car1, device: jetson_tx2, edge: edge1}
  - {name: car2, device: jetson_tx2, edge: edge1}
"""
TOWN = """\
perception: {source: town, duration: 1 s}
fleet: {cars: 2, devices: jetson_tx2, edge_device: agx_xavier, cell: 200 m}
"""
NAMED = ("did you mean", "known: ", "there are no")

# What a line of each kind says, and settings with that mistake. The field is what is set, or it
# stands beside the setting.
MISTAKES = {
    "unknown": [
        "genie.evictoin=lru",
        "cars[1].genei=true",
        "cars[1].edge=edge9",
        "cars[1].device=jetson",
        "cars[1].link=wfi",
        "model=yolov9s",
        "spread=busy",
        "image_encoding=jpeg79",
        "genie.eviction=lruu",
        "genie.similarity=posegrid",
        "genie.object_map.rule=nor",
        "genie.miss_policy=block",
        "perception.trace=kitti_0006",
        "perception=alive",
        "methods[1]=lokal",
        "record[0]=frames",
        ("edges=[]", "cars[0].edge"),
        ("cars[1].link.like=5g", "cars[1].link.like"),
        ("cars[1].link={model: wir}", "cars[1].link.model"),
        ("cars[1].link={model: [wire]}", "cars[1].link.model"),
        ("cars[1].link={losss: 0.1}", "cars[1].link.losss"),
        ("genie.similarity={name: exact, cell: 1 m}", "genie.similarity.cell"),
        ("genie.object_map={algorithm: literal}", "genie.object_map.algorithm"),
        ("methods[0]={name: a, method: gene}", "methods[0].method"),
        ("methods[0]={method: genie, models: x}", "methods[0].models"),
        ("methods[2]={method: genie, model: yolov9s}", "methods[2].model"),
        ("methods[2]={method: genie, genie: {evictoin: lru}}", "methods[2].genie.evictoin"),
        ("faults[0]={fault: outtage, target: car1, begin: 1 s}", "faults[0].fault"),
        ("faults[0]={fault: outage, target: car1, begn: 1 s}", "faults[0].begn"),
        ("faults[0]={fault: outage, target: car9, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: outage, target: car1->edge9, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: crash, target: edge9, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: crash, target: car1, begin: 1 s, memory: hot}", "faults[0].memory"),
        ("faults[0]={fault: stall, target: edges, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: slow, target: car7, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: gnss, target: edge1, begin: 1 s}", "faults[0].target"),
        (
            "faults[0]={fault: hand_over, target: edge1, edge: edge2, begin: 1 s}",
            "faults[0].target",
        ),
        ("faults[0]={fault: camera, target: edge1, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: partition, target: [car1, x], begin: 1 s}", "faults[0].target"),
    ],
    "missing": [
        ("genie.eviction=ttl", "genie.ttl"),
        ("cars=[{name: a}]", "cars[0].device"),
        ("cars[0].cameras=[{name: a}]", "cars[0].cameras[0].recording"),
        ("faults[0]={target: car1}", "faults[0].fault"),
        ("faults[0]={fault: outage, begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: outage, target: car1}", "faults[0].begin"),
    ],
    "must": [  # be of another type, in a range, or written so
        "cars=3",
        "cars=[]",
        "cars[1].genie=no",
        "cars[1].name=my car",
        "cars[0].cameras=[]",
        "cars[0].cameras=no",
        "cars[1].link=5",
        "cars[1].link.loss=1.5",
        "cars[1].link.rate_up=-1 Mbit/s",
        "cars[1].link.rate_up=0",
        "cars[1].link.delay=-1 ms",
        "cars[1].link.mtu_payload=0 B",
        "cars[1].route.start=-3 s",
        "cars[1].route.laps=1.5",
        "cars[1].route.laps=0",
        "cars[1].route.window=[5 s, 3 s]",
        "cars[1].route.window=[5 s]",
        "name=../up",
        'name="mine\\n"',
        "seed=-1",
        "queue_length=0",
        "origin=[91, 8, 100]",
        "perception=5",
        "genie.capacity=10",
        "genie.capacity={}",
        "genie.similarity.cell=0 m",
        "genie.object_map.threshold=60",
        "genie.object_map.threshold=range60",
        ("genie.object_map.threshold={percentile: 101}", "genie.object_map.threshold.percentile"),
        "genie.passes=3",
        ("cars=[car1]", "cars[0]"),
        ("genie.similarity={name: dhash, radius: 1.5}", "genie.similarity.radius"),
        ("cameras=[{name: a, recording: 2}]", "cameras[0].recording"),
        ("methods[0]={method: genie, title: ''}", "methods[0].title"),
        ("methods[0]={method: genie, name: 5}", "methods[0].name"),
        ("methods[0]={method: genie, name: a b}", "methods[0].name"),
        ("methods[0]={method: my.code:Own, x: null}", "methods[0].x"),
        ("methods[0]={method: foggycache, theta: 1.2}", "methods[0].theta"),
        ("methods[0]={method: foggycache, neighbours: 1}", "methods[0].neighbours"),
        ("methods[0]={method: potluck, dropout: -0.1}", "methods[0].dropout"),
        ("methods[0]={method: potluck, keep: 2}", "methods[0].keep"),
        ("methods[0]={method: sim_lru, radius: -1}", "methods[0].radius"),
        ("methods[0]={method: deadline, shares: []}", "methods[0].shares"),
        ("methods[0]={method: deadline, shares: [0.0]}", "methods[0].shares[0]"),
        ("cars[0].link={model: cell, power: {up: 5000 dBm}}", "cars[0].link.power.up"),
        ("methods[0]={method: deadline, deadline: 0 s}", "methods[0].deadline"),
        ("methods[0]={method: cachier, per_entry: -1 ms}", "methods[0].per_entry"),
        ("methods[0]={method: cachier, period: 0 s}", "methods[0].period"),
        ("methods[0]={method: paced_remote, in_flight: 0}", "methods[0].in_flight"),
        ("methods[0]={method: paced_remote, every: -1 ms}", "methods[0].every"),
        ("methods[0]={method: paced_remote, stale: 0 s}", "methods[0].stale"),
        "faults[0]=outage",
        ("faults[0]={fault: outage, target: car1, begin: 5 s, end: 5 s}", "faults[0].end"),
        ("faults[0]={fault: outage, target: car1, mean_duration: 2 s}", "faults[0].mean_duration"),
        (
            "faults[0]={fault: outage, target: car1, mean_time_between: 1 us, mean_duration: 9 us}",
            "faults[0].mean_time_between",
        ),
        (
            "faults[0]={fault: outage, target: car1, mean_time_between: 9 s, mean_duration: 0 s}",
            "faults[0].mean_duration",
        ),
        (
            "faults[0]={fault: hand_over, target: car1, edge: edge2, begin: 5 s, gap: -1 ms}",
            "faults[0].gap",
        ),
        ("faults[0]={fault: slow, target: car1, begin: 1 s, factor: 0}", "faults[0].factor"),
        ("faults[0]={fault: gnss, target: car1, begin: 1 s, bias: -1 m}", "faults[0].bias"),
        ("faults[0]={fault: partition, target: [], begin: 1 s}", "faults[0].target"),
        ("faults[0]={fault: partition, target: car1, begin: 1 s}", "faults[0].target"),
    ],
    "unit": [
        "cars[1].route.start=3",
        "cars[1].route.start=soon",
        "cars[1].route.start=3 days",
        "cars[1].link.delay=null",
        "cars[1].link.rate_up=1 GB/s",
        ("faults[0]={fault: outage, target: car1, begin: 5}", "faults[0].begin"),
    ],
    "duplicate name": [
        "cars[1].name=car1",
        "cars[1].name=edge1",
        ("methods=[genie, genie]", "methods[1].name"),
        ("cameras=[{name: a, recording: 02}, {name: a, recording: 03}]", "cameras[1].name"),
    ],
    "no such file": [
        "cars[1].device=./mine.yaml",
        "cars[1].route.trace=./gone.parquet",
    ],
    "is over before": [
        ("model=detr_resnet_101_dc5", "genie.request_expiry"),
        (
            "methods[2]={method: genie, genie: {request_expiry: 10 ms}}",
            "methods[2].genie.request_expiry",
        ),
    ],
    "network between the edges": ["cars[1].name=edges"],
    "no effect": ["genie.ttl=10 s"],
    "leads nowhere": [("cars[1]={name: a, device: jetson_tx2, link: wifi}", "cars[1].link")],
    "instead": [  # what has another setting in its place, or none
        (
            "faults[0]={fault: outage, target: car1, mean_time_between: 9 s, mean_duration: 1 s,"
            " end: 9 s}",
            "faults[0].end",
        ),
    ],
    "once": [
        (
            "faults[0]={fault: hand_over, target: car1, edge: edge2, mean_time_between: 60 s,"
            " mean_duration: 2 s}",
            "faults[0].mean_time_between",
        ),
    ],
    "leave": [
        (
            "faults[0]={fault: hand_over, target: car1, edge: edge2, begin: 5 s, end: 9 s}",
            "faults[0].end",
        ),
    ],
}
OF_A_FLEET = {
    "unknown": [
        "fleet.devices=tx3",
        "fleet.edge_device=tx3",
        ("perception.town={blok: 3}", "perception.town.blok"),
    ],
    "must": [
        "fleet.cars=0",
        "fleet.devices={jetson_tx2: 0.5}",
        "perception.town.blocks=3",
        "perception.town.block=1e30 km",
    ],
    "missing": [("fleet=null", "cars")],
    "unit": ["fleet.cell=100"],
    "makes more than": ["perception.interval=1 ns"],
    "leave": [
        "origin=[49, 8, 100]",
        ("cars=[{name: a, device: jetson_tx2}]", "cars"),
    ],
    "too short": ["perception.town.block=5 m"],
}


@pytest.mark.parametrize(
    ("text", "kind", "setting"),
    [
        (text, kind, setting)
        for text, mistakes in ((STREET, MISTAKES), (TOWN, OF_A_FLEET))
        for kind, settings in mistakes.items()
        for setting in settings
    ],
)
def test_a_mistake_names_its_field_and_kind(
    text: str, kind: str, setting: str | tuple[str, str]
) -> None:
    override, field = (setting, setting.partition("=")[0]) if isinstance(setting, str) else setting
    Path("x.yaml").write_text(text)
    with pytest.raises(UserError) as error:
        load_scenario("x.yaml", [override])
    line = str(error.value)
    assert line.startswith(f"--set {override}: {field}: ") and "\n" not in line
    assert kind in line
    assert kind != "unknown" or any(words in line for words in NAMED)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("edges: []\n", "x.yaml: cars: missing"),
        (STREET + "ttl: 3 s\n", "x.yaml: ttl: unknown field; did you mean 'genie.ttl'?"),
        ("- a\n", "x.yaml: is a list; expected a mapping such as 'name: value'"),
        (
            STREET + "genie: {eviction: lruu}\n",
            "x.yaml: genie.eviction: unknown eviction 'lruu' "
            "(did you mean 'lru'?); known: fifo, lfu, lru, ttl, or package.module:Class",
        ),
    ],
)
def test_whole_lines(text: str, line: str) -> None:
    Path("x.yaml").write_text(text)
    with pytest.raises(UserError) as error:
        load_scenario("x.yaml")
    assert str(error.value) == line


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("cars: [\n", "line 2: "),
        (STREET + "cars: []\n", "line 7: duplicate key 'cars'"),
        ("cars: !!python/object/apply:os.system [ls]\n", "line 1: tags"),
        ("scenario: street_1car_homo\naxes: {}\n", "axes: belongs to a sweep"),
        ("edge: []\n" + STREET, "edge: unknown"),
        ("model: detr_resnet_101_dc5\ncars: [{name: a, device: orin_nano}]\n", "model: orin_nano"),
    ],
)
def test_a_mistake_in_the_file_names_its_place(text: str, place: str) -> None:
    Path("x.yaml").write_text(text)
    with pytest.raises(UserError) as error:
        load_scenario("x.yaml")
    assert str(error.value).startswith(f"x.yaml: {place}") and "\n" not in str(error.value)


def test_a_slow_detector_needs_a_request_that_waits_or_none() -> None:
    Path("x.yaml").write_text(STREET)
    for setting in ("genie.request_expiry=5 s", "methods=[local, remote]"):
        load_scenario("x.yaml", ["model=detr_resnet_101_dc5", setting])
