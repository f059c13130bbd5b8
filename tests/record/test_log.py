"""What the log keeps of a frame that is lost, and of objects that a map forgets and finds again."""

from __future__ import annotations

import pytest

from genie_sim.core.messages import (
    CameraPose,
    Detections,
    Expired,
    Forgotten,
    Header,
    Image,
    MapChange,
    ObjectLookups,
)
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables

HEADER = Header(0, "camera_02", "car1")
IMAGE = Image(HEADER, 1000, "", 0, CameraPose(0.0, 0.0, 1.6, 0.0), 1.4, None)
GENIE = "car1/genie"


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
