"""What the log writes: each value into its column, why a frame is lost, and objects that a map
forgets and finds again.
"""

from __future__ import annotations

from dataclasses import replace
from unittest import mock

import pytest

from genie_sim.core.messages import (
    CameraPose,
    Detections,
    Expired,
    Forgotten,
    Header,
    Image,
    ImageLookup,
    MapChange,
    ObjectLookups,
)
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables
from genie_sim.sim.monitor import FaultSpan, HostUsage, LookEvent, Span, SpanLabel

HEADER = Header(0, "camera_02", "car1")
FRAME = Header(10, "camera_02", "car1")
IMAGE = Image(HEADER, 1000, "", 0, CameraPose(0.0, 0.0, 1.6, 0.0), 1.4, None)
GENIE = "car1/genie"


ROWS = """
frames: method=genie car=car1 stream=camera_02 stamp_ns=10 frame=11 lap=12 received_ns=13\
 bytes_up=14 bytes_down=15 first_answer_ns=30 fresh_answer_ns=30 result_answer_ns=30\
 first_looked_ns=10 looked_ns=10 objects_fresh=0 objects_result=0 objects_served=0\
 source=own_detector served_by=d image_hit=False coalesced=False drop=None
lookups: method=genie t_ns=22 genie=h placement=edge kind=sighting requester=None car=car1\
 stream=camera_02 stamp_ns=10 outcome=None requests=18 hits=19 updates=20 boost_sum=8.5 entries=21
looks: method=genie car=car1 stream=camera_02 stamp_ns=10 t_ns=25 genie=g way=edge outcome=sent\
 looked_ns=24 gap_ns=23
poses: method=genie car=car1 stream=camera_02 stamp_ns=10 frame=11 east_m=2.5 north_m=3.5\
 heading_rad=5.5 horizontal_fov_rad=1.4
objects: method=genie t_ns=22 genie=h object=0 label=bus east_m=6.5 north_m=7.5 confidence=0.25
steps: method=genie car=car1 stream=camera_02 stamp_ns=10 which=both part=hop place=car1\
 begin_ns=13 end_ns=30
resources: method=genie t_ns=39 resource=car1->edge1 kind=link capacity=31 busy_ns=32 queue=33\
 completed=34 dropped=35 bytes=36 queue_ns=37 queue_max=38
hosts: method=genie host=car1 placement=car device=tx2 interface=wifi accelerator_ns=40 cpu_ns=41\
 pictures=42 batches=43 bytes_up=44 bytes_down=45 transfer_ns=46 tail_ns=47 begin_ns=48
faults: method=genie fault=outage target=car1 begin_ns=50 end_ns=51
"""


def test_each_column_gets_its_own_value():
    """Two values in each other's place are told: columns next to each other have different ones.
    The last row of each table.
    """
    tables = new_tables()
    log = Log("genie", tables, ["lookups", "looks", "poses", "objects", "steps"])
    image = replace(IMAGE, header=FRAME, pose=CameraPose(2.5, 3.5, 4.5, 5.5))
    log.published(image, 11, 12)
    log.received(FRAME, 13)
    for column, size in (("bytes_up", 14), ("bytes_down", 15)):
        log.carried(column, replace(image, size_bytes=size))
    log.observe("car", "g", ImageLookup(FRAME, "miss", "client", 16), 17)
    seen = MapChange(0, "bus", (6.5, 7.5), 0.25)
    looked_up = ObjectLookups(FRAME, "sighting", 18, 19, 20, 8.5, 21, changes=(seen,))
    log.observe("edge", "h", looked_up, 22)
    log.observe("car", "g", LookEvent(FRAME, "edge", "sent", gap_ns=23, looked_ns=24), 25)
    path = Span(SpanLabel("hop", "car1"), 30, Span(None, 13, None, FRAME), FRAME)
    log.answered(Detections(FRAME, (), "detector", "d", seen_in=FRAME), "own_detector", 30, path)
    resource = mock.Mock(
        kind="link",
        capacity=31,
        busy_ns=32,
        queued=33,
        completed=34,
        drops=35,
        sent_bytes=36,
        occupancy=mock.Mock(total_ns=37, most=38),
    )
    resource.name = "car1->edge1"
    log.sample([resource], 39)
    log.used([HostUsage("car1", "car", "tx2", "wifi", *range(40, 49))])
    log.failed([FaultSpan("outage", "car1", 50, 51)])
    log.close()
    for line in ROWS.strip().splitlines():
        name, _, row = line.partition(": ")
        table = tables[name].columns()
        columns = {column: str(table[column].tolist()[-1]) for column in table.names}
        assert columns == dict(told.split("=") for told in row.split()), name


def log_of(tables: Tables) -> Log:
    log = Log("genie", tables, ["objects"])
    log.published(IMAGE, 0, 0)
    return log


def answer(log: Log, source: str, now_ns: int = 9) -> None:
    log.answered(Detections(HEADER, (), source), source, now_ns)


def expire(log: Log) -> None:
    log.observe("car", GENIE, Expired(HEADER), 5)


@pytest.mark.parametrize(
    ("events", "cause"),
    [
        ([], None),
        ([expire], "car1/genie:expired"),
        ([lambda log: log.dropped(IMAGE, "uplink"), expire], "uplink"),
        ([expire, lambda log: log.dropped(IMAGE, "uplink")], "uplink"),
        ([lambda log: answer(log, "detector"), expire], None),
        ([lambda log: answer(log, "detector"), lambda log: log.dropped(IMAGE, "uplink")], None),
        ([expire, lambda log: answer(log, "detector")], None),
        ([lambda log: answer(log, "map"), expire], "car1/genie:expired"),
    ],
    ids=[
        "nothing was lost",
        "a request expired",
        "what was lost explains why a request expires later",
        "what is lost after a request expired",
        "a request expires after the result",
        "a copy is lost after the result",
        "a result comes after all",
        "an answer of the map is no result",
    ],
)
def test_a_frame_without_a_result_keeps_the_cause_of_its_loss(events, cause: str | None):
    tables = new_tables()
    log = log_of(tables)
    for event in events:
        event(log)
    log.close()
    (drop,) = tables["frames"].columns()["drop"].tolist()
    assert drop == cause


def changed(log: Log, genie: str, number: int, now_ns: int, forgotten: bool = False) -> None:
    change = MapChange(number, "car", (1.0, 2.0), 0.5)
    if forgotten:
        log.observe("car", genie, Forgotten((change,)), now_ns)
    else:
        seen = ObjectLookups(HEADER, "sighting", 1, 0, 1, 0.5, 1, changes=(change,))
        log.observe("car", genie, seen, now_ns)


def test_an_object_that_comes_again_after_it_was_forgotten_is_another_one():
    """A Genie counts from 0 again after a crash; the table has a number for each object."""
    tables = new_tables()
    log = log_of(tables)
    changed(log, "a", 0, 1)
    changed(log, "a", 0, 2)
    changed(log, "a", 0, 3, forgotten=True)
    changed(log, "a", 0, 4)
    changed(log, "a", 7, 5)
    changed(log, "b", 0, 6)
    rows = tables["objects"].to_frame()
    assert list(zip(rows["genie"], rows["object"], strict=True)) == [
        ("a", 0),
        ("a", 0),
        ("a", 0),
        ("a", 1),
        ("a", 2),
        ("b", 0),
    ]
    assert rows["confidence"].isna().tolist() == [False, False, True, False, False, False]
