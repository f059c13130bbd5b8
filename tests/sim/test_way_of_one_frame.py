"""The way of one frame, added up by hand: with fixed service times every answer comes at a known
nanosecond.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pandas as pd
import pytest

from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.trace import Trace, TraceFrame
from genie_sim.scenario.profiles import DeviceProfile
from tests.make import FOV_RAD, drive, fixed_device, scenario, trace_frame

MS = 1_000_000
IMAGE_BYTES = 1_397_297
ANSWER_BYTES = 426  # an array with one object

CAR_GENIE = 9 * MS
CAR_DETECTOR = 300 * MS
CAR_HOP_IMAGE = 3_094_594  # 0.3 ms and 2 ms/MB
CAR_HOP_ANSWER = 300_852
CAR_HOP_EMPTY = 300_052  # an array without objects: 26 B

EDGE_GENIE = 8 * MS
EDGE_DETECTOR = 60 * MS
EDGE_HOP_IMAGE = 1_597_297  # 0.2 ms and 1 ms/MB
EDGE_HOP_ANSWER = 200_426

DELAY = 200_000
LINK_IMAGE = 11_873_176 + DELAY  # 1 Gbit/s: 965 segments with 90 B each
LINK_ANSWER = 4_128 + DELAY

UP = CAR_HOP_IMAGE + LINK_IMAGE  # from a node of the car to the edge's
DOWN = EDGE_HOP_ANSWER + LINK_ANSWER
# from the camera until the car's Genie has looked the frame up
FIRST_LOOK = CAR_HOP_IMAGE + CAR_GENIE
LAST_STEP = CAR_GENIE + CAR_HOP_ANSWER  # an answer's way through the car's Genie to the consumer
OWN_DETECTOR = CAR_HOP_IMAGE + CAR_DETECTOR + CAR_HOP_ANSWER
EDGE_DETECTION = EDGE_HOP_IMAGE + EDGE_DETECTOR + EDGE_HOP_ANSWER + EDGE_GENIE

OBJECT = Detection("car", 0.9, (0.0, 0.0, 10.0, 10.0), (20.0, 4.0, 0.8), 0.9, "scan")


def view(index: int, stamp_ns: int, east_m: float) -> TraceFrame:
    pose = CameraPose(east_m, 0.0, 1.6, 0.0)
    return trace_frame(
        index=index,
        stamp_ns=stamp_ns,
        size_bytes=IMAGE_BYTES,
        pose=pose,
        horizontal_fov_rad=FOV_RAD,
        detections=(OBJECT,),
    )


def trace(*views: TraceFrame) -> Trace:
    return Trace("one_object", (49.0, 8.4, 110.0), {"02": views}, {"made_by": "tests"})


ONE_FRAME = trace(view(0, 0, 0.5))
ONE_CAMERA = [{"name": "camera_02", "recording": "02"}]


def fixed(detector: str = "300 ms", cores: int = 4) -> dict[str, DeviceProfile]:
    """The devices whose times stand above."""
    return {
        "jetson_tx2": fixed_device("jetson_tx2", detector=detector, genie="9 ms", cores=cores),
        "agx_xavier": fixed_device(
            "agx_xavier", detector="60 ms", genie="8 ms", hop="0.2 ms", per_megabyte="1 ms"
        ),
    }


def frames(
    of: Trace,
    fleet: list[dict[str, Any]] | None = None,
    detector: str = "300 ms",
    cores: int = 4,
    sent: Trace | None = None,
    codec: float = 1.0,
    **settings: Any,
) -> dict[str, pd.DataFrame]:
    """The frames of each method, with the times counted from their stamps."""
    devices = fixed(detector, cores)
    slow = replace(devices["jetson_tx2"].codec, value=codec)
    devices["jetson_tx2"] = replace(devices["jetson_tx2"], codec=slow)
    fleet = fleet if fleet is not None else [car("car1", "edge1")]
    setting = scenario(fleet, **({"cameras": ONE_CAMERA, "start_jitter": "0 s"} | settings))
    table = drive(setting, of, devices, sent)["frames"]
    for column in ("received", "first_answer", "result_answer"):
        table[column] = table[f"{column}_ns"] - table["stamp_ns"]
    return {
        str(method): rows.reset_index(drop=True)
        for method, rows in table.groupby("method", observed=True)
    }


def answers(frame: pd.Series) -> tuple[int, int, str]:
    return int(frame["first_answer"]), int(frame["result_answer"]), str(frame["source"])


def car(name: str, edge: str, **route: Any) -> dict[str, Any]:
    return {"name": name, "device": "jetson_tx2", "edge": edge, "route": route}


def test_a_frame_is_received_one_hop_after_its_stamp():
    assert all(rows["received"].tolist() == [CAR_HOP_IMAGE] for rows in frames(ONE_FRAME).values())


SENT_BYTES = 100_000  # one object was lost, two are new
SENT = Trace(
    "sent",
    (49.0, 8.4, 110.0),
    {
        "02": (
            replace(ONE_FRAME.frames["02"][0], size_bytes=SENT_BYTES, detections=(OBJECT, OBJECT)),
        )
    },
    {},
)
ENCODE, DECODE = 1_620_865, 1_900_324  # 1.16 and 1.36 ms/MB, of the picture in memory
LINK_SENT = 850_400 + DELAY  # 70 segments with 90 B each


def test_an_encoded_picture_costs_both_cpus_and_is_what_the_edge_s_detector_sees():
    found = frames(ONE_FRAME, sent=SENT, image_encoding="jpeg80")
    assert (
        answers(found["local"].loc[0])[0] == OWN_DETECTOR
        and found["local"].loc[0, "objects_served"] == 1
    )
    row = found["remote"].loc[0]
    down = EDGE_HOP_ANSWER + 400 + (826 + 90) * 8 + DELAY  # two objects
    assert answers(row)[0] == CAR_HOP_IMAGE + ENCODE + LINK_SENT + DECODE + EDGE_DETECTOR + down
    assert row["objects_served"] == 2
    slow = frames(ONE_FRAME, sent=SENT, codec=4.0, image_encoding="jpeg80")["remote"].loc[0]
    assert answers(slow)[0] - answers(row)[0] == pytest.approx(3 * ENCODE, abs=3)


LATER = {  # a second frame that is a hit, and one that waits for the answer to the first
    "hit": (ONE_FRAME, [car("car1", "edge1", laps=2)]),
    "coalesced": (trace(view(0, 0, 0.5), view(1, 50 * MS, 0.7)), None),
}


def test_a_frame_is_charged_what_was_sent_for_it():
    sent = frames(ONE_FRAME)
    encoded = frames(ONE_FRAME, sent=SENT, image_encoding="jpeg80")
    carried = {name: rows.loc[0] for name, rows in sent.items()}
    carried |= {"encoded": encoded["remote"].loc[0]}
    carried |= {name: frames(*how)["genie"].loc[1] for name, how in LATER.items()}
    assert {name: (row["bytes_up"], row["bytes_down"]) for name, row in carried.items()} == {
        "local": (0, 0),
        "remote": (IMAGE_BYTES, ANSWER_BYTES),
        "genie": (IMAGE_BYTES, ANSWER_BYTES),
        "encoded": (SENT_BYTES, 826),
        "hit": (0, 0),
        "coalesced": (0, 0),
    }


def test_genie_answers_a_miss_from_its_map_at_once_and_with_the_edge_s_detection_later():
    row = frames(ONE_FRAME)["genie"].loc[0]
    first = FIRST_LOOK + CAR_HOP_EMPTY
    fresh = FIRST_LOOK + UP + EDGE_GENIE + EDGE_DETECTION + DOWN + LAST_STEP
    assert answers(row) == (first, fresh, "map")
    assert (first, fresh) == (12_394_646, 114_765_493)
    assert (row["objects_served"], row["objects_fresh"]) == (0, 1)


def test_a_fast_car_s_own_detection_comes_before_the_edge_s():
    row = frames(ONE_FRAME, detector="20 ms", genie={"miss_policy": "blocking"})["genie"].loc[0]
    fresh = FIRST_LOOK + CAR_HOP_IMAGE + 20 * MS + CAR_HOP_ANSWER + LAST_STEP
    assert answers(row) == (fresh, fresh, "own_detector")


def test_a_car_without_edge_waits_for_its_own_detector():
    row = frames(ONE_FRAME, [{"name": "car1", "device": "jetson_tx2"}])["genie"].loc[0]
    fresh = FIRST_LOOK + OWN_DETECTOR + LAST_STEP
    assert answers(row) == (FIRST_LOOK + CAR_HOP_EMPTY, fresh, "map")


def test_genie_answers_a_hit_from_its_cache():
    """On its second lap the car knows the place."""
    rows = frames(ONE_FRAME, [car("car1", "edge1", laps=2)])["genie"]
    hit = FIRST_LOOK + CAR_HOP_ANSWER
    assert rows["image_hit"].tolist() == [False, True]
    assert answers(rows.loc[1]) == (hit, hit, "own_cache")
    assert hit == 12_395_446


def test_genie_answers_a_miss_with_what_its_map_knows_to_be_in_view():
    """The second frame is taken elsewhere; the object that the first has shown is in its view."""
    rows = frames(trace(view(0, 0, 0.5), view(1, 1000 * MS, 5.5)))["genie"]
    assert rows["image_hit"].tolist() == [False, False]
    assert rows["objects_served"].tolist() == [0, 1]
    assert answers(rows.loc[1])[0] == FIRST_LOOK + CAR_HOP_ANSWER


def test_edges_pass_encoded_pictures_on_and_each_decodes_them():
    cars = [car("car1", "edge1"), car("car2", "edge2", start="1 s")]
    rules = {"miss_policy": "blocking", "share_answers": "on_request"}
    row = frames(ONE_FRAME, cars, sent=SENT, image_encoding="jpeg80", genie=rules)["genie"].loc[1]
    two_objects = 400 + 400 * 8  # more to hand over, and on the wire
    there_and_back = (
        EDGE_HOP_IMAGE
        + LINK_SENT
        + DECODE
        + EDGE_GENIE
        + EDGE_HOP_ANSWER
        + LINK_ANSWER
        + two_objects
    )
    up = CAR_HOP_IMAGE + ENCODE + LINK_SENT + DECODE
    fresh = (
        FIRST_LOOK
        + up
        + EDGE_GENIE
        + there_and_back
        + EDGE_GENIE
        + DOWN
        + two_objects
        + LAST_STEP
        + 800
    )
    assert answers(row) == (fresh, fresh, "peer_cache")


def test_frames_taken_together_wait_for_the_only_core_of_a_cpu():
    both = [{"name": name, "recording": "02"} for name in ("camera_02", "camera_03")]
    first, second = frames(ONE_FRAME, cameras=both, cores=1)["genie"]["first_answer"]
    assert (first, second) == (FIRST_LOOK + CAR_HOP_EMPTY, FIRST_LOOK + CAR_GENIE + CAR_HOP_EMPTY)
