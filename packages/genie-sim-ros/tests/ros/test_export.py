"""A run as a bag: what is read back, by other libraries' readers, is what the run wrote down."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.record.results import Run
from genie_sim.runs.folder import run_in_memory, run_to_folder
from genie_sim.scenario.reading import load_scenario
from genie_sim_ros.export import bag, confidence_colour, mcap

START_NS = 10**9  # of ROS time, when the simulation begins


@pytest.fixture(scope="module")
def run() -> Run:
    settings = [
        "cars[0].route.window=[0 s, 2 s]",
        "genie.object_map.forget_after=300 ms",
    ]
    return run_in_memory(load_scenario("street_1car_hetero", settings))


@pytest.fixture(scope="module", params=["mcap", "bag"])
def read_back(
    request: pytest.FixtureRequest, run: Run, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """(topic, time [ns], message) of everything in the exported file, and how much ``export`` said
    it is.
    """
    path = tmp_path_factory.mktemp("export") / f"run.{request.param}"
    written = {"mcap": mcap, "bag": bag}[request.param](run, path)
    assert list(path.parent.iterdir()) == [path], "nothing is left beside it"
    return written, _read_mcap(path) if request.param == "mcap" else _read_bag(path)


def _read_mcap(path: Path) -> list[tuple[str, int, Any]]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as file:
        found = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        return [
            (channel.topic, message.log_time, decoded) for _, channel, message, decoded in found
        ]


def _read_bag(path: Path) -> list[tuple[str, int, Any]]:
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        return [
            (one.topic, at, reader.deserialize(raw, one.msgtype))
            for one, at, raw in reader.messages()
        ]


def _of(read_back: Any, topic: str) -> list[tuple[int, Any]]:
    return [(at, message) for name, at, message in read_back[1] if name == topic]


def _ns(stamp: Any) -> int:
    return int(stamp.sec * 10**9 + stamp.nanosec)


def test_every_message_is_there_and_in_order_of_time(read_back, run):
    written, found = read_back
    assert len(found) == written
    times = [at for _, at, _ in found]
    assert times == sorted(times)
    images = (run.lookups["kind"] == "image").sum()
    answers = (run.frames["first_answer_ns"].notna() & run.frames["received_ns"].notna()).sum()
    drops = run.frames["drop"].notna().sum()
    held = (run.held_objects["judged"] != "right").sum()
    numbers = sum(name.endswith(("/queue", "/accelerator")) for name, _, _ in found)
    assert written == (
        len(run.poses) + 1 + len(run.objects) + 2 * images + drops + answers + held + numbers
    )


def test_false_and_missed_objects_are_markers_of_each_method(read_back, run):
    wrong = run.held_objects[run.held_objects["method"] == "genie"]
    for what, judged in (
        ("false", ["moved_away", "never_there", "duplicate"]),
        ("missed", ["missed"]),
    ):
        rows = wrong[wrong["judged"].isin(judged)].sort_values("begin_ns", kind="stable")
        markers = [
            (at - START_NS, one.markers[0]) for at, one in _of(read_back, f"/car1/genie/{what}")
        ]
        assert rows["label"].size and [at for at, _ in markers] == rows["begin_ns"].tolist()
        assert [one.pose.position.x for _, one in markers] == rows["east_m"].tolist()
        lasted = (rows["end_ns"] - rows["begin_ns"]).fillna(0).astype("int64")
        assert [_ns(one.lifetime) for _, one in markers] == lasted.tolist()


def test_queues_and_accelerators_are_numbers_over_time(read_back, run):
    rows = run.resources[run.resources["method"] == "local"]
    queue = rows[rows["resource"] == "car1/vision_darknet_detect"]
    told = dict(_of(read_back, "/car1/vision_darknet_detect/local/queue"))
    at_each, now = [], 0.0
    for t_ns in queue["t_ns"]:
        now = told[t_ns + START_NS].data if t_ns + START_NS in told else now
        at_each.append(now)
    assert at_each == queue["queue"].tolist() and max(at_each) > 0
    busy = rows[rows["resource"] == "car1.accelerator"]
    shares = [one.data for _, one in _of(read_back, "/car1/local/accelerator")]
    step_ns = busy["t_ns"].diff().iloc[1:]
    assert sum(shares * step_ns) == pytest.approx(busy["busy_ns"].iloc[-1])


def test_cars_are_transforms_at_their_own_instants(read_back, run):
    tf = _of(read_back, "/tf")
    assert sorted(at for at, _ in tf) == sorted(run.poses["stamp_ns"] + START_NS)
    assert all(_ns(message.transforms[0].header.stamp) == at for at, message in tf)
    transforms = {
        (at, one.transforms[0].child_frame_id): one.transforms[0].transform for at, one in tf
    }
    row = run.poses.iloc[7]
    placed = transforms[row.stamp_ns + START_NS, f"{row.car}/{row.stream}"]
    assert placed.translation.x == row.east_m
    turn = placed.rotation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(row.heading_rad)
    assert (turn.x, turn.y) == (0.0, 0.0) and math.hypot(turn.z, turn.w) == pytest.approx(1.0)


def test_the_object_map_has_its_confidences_as_colours(read_back, run):
    genies = sorted(run.objects["genie"].unique())
    assert genies == ["car1/genie", "edge1/genie"]
    for genie in genies:
        rows = run.objects[run.objects["genie"] == genie]
        boxes = [(at, one.markers[0]) for at, one in _of(read_back, f"/{genie}/object_map")]
        assert [at - START_NS for at, _ in boxes] == rows["t_ns"].tolist()
        assert [box.pose.position.y for _, box in boxes] == rows["north_m"].tolist()
        assert [box.action for _, box in boxes] == [
            2 if unknown else 0 for unknown in rows["confidence"].isna()
        ]
        assert rows["confidence"].isna().any(), "what is forgotten is taken away"
        for (_, box), confidence in zip(boxes, rows["confidence"].fillna(0.0), strict=True):
            assert (box.color.r, box.color.g, box.color.b) == pytest.approx(
                confidence_colour(confidence), abs=1e-6
            )
        objects = rows["object"].nunique()
        assert len({(box.ns, box.id) for _, box in boxes}) == objects, (
            "an object seen again is the same box"
        )


def test_hits_and_misses_are_events(read_back, run):
    images = run.lookups[run.lookups["kind"] == "image"]
    events = [
        (at, one.msg)
        for at, one in _of(read_back, "/events")
        if " at " in one.msg and "dropped" not in one.msg
    ]
    assert Counter(text.split()[0] for _, text in events) == Counter(images["outcome"])
    assert sorted(at - START_NS for at, _ in events) == images["t_ns"].tolist()
    assert len(_of(read_back, "/lookups")) == len(images)
    assert {"hit", "miss"} <= set(images["outcome"])


def test_response_times_of_every_method(read_back, run):
    for method in ("local", "remote", "genie"):
        rows = run.frames[(run.frames["method"] == method) & run.frames["first_answer_ns"].notna()]
        expected = sorted((rows["first_answer_ns"] - rows["received_ns"]) / 1e6)
        assert sorted(
            one.data for _, one in _of(read_back, f"/car1/{method}/response")
        ) == pytest.approx(expected)


def test_a_result_folder_on_the_command_line(tmp_path, capsys):
    from genie_sim.cli.main import main

    folder = run_to_folder(
        load_scenario("street_1car_hetero", ["cars[0].route.window=[0 s, 1 s]"]), tmp_path
    ).folder
    assert main(["export", str(folder), "--format", "mcap"]) == 0
    assert capsys.readouterr().out.startswith(f"{folder / 'run.mcap'}: ")
    assert _read_mcap(folder / "run.mcap")


def test_a_run_that_wrote_down_no_poses_is_no_bag(tmp_path):
    settings = ["cars[0].route.window=[0 s, 1 s]", "record=[lookups]"]
    run = run_to_folder(load_scenario("street_1car_homo", settings), tmp_path)
    with pytest.raises(UserError, match="no poses"):
        mcap(run, tmp_path / "run.mcap")
    assert not list(tmp_path.rglob("*mcap*"))


def test_lighter_is_more_confident():
    lightness = [
        sum(w * c for w, c in zip((0.3, 0.6, 0.1), confidence_colour(x / 10), strict=True))
        for x in range(11)
    ]
    assert lightness == sorted(lightness)
