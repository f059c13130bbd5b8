"""A Genie in front of an unmodified ROS 1 node: real master, real messages, real processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.ros.conftest import DETECTOR, HERE, IMAGES, OBJECTS, PATIENCE_S, Master, until

pytestmark = pytest.mark.slow

REPUBLISH = Path("/usr/lib/image_transport/republish")
UNTOUCHED = ([IMAGES], [OBJECTS])
BEHIND_GENIE = ([IMAGES + "_local"], [OBJECTS + "_local"])
GENIE = "/genie_vision_darknet_detect"


def command_line(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def back_as_it_was(master: Master, original: bytes) -> bool:
    pid = master.pid_of(DETECTOR)
    return (
        master.topics_of(DETECTOR) == UNTOUCHED
        and pid is not None
        and command_line(pid) == original
    )


def test_the_second_time_at_a_place_is_a_hit(master: Master):
    """Three places, twice: three runs of the detector, three answers out of the cache, each under
    its own header.
    """
    detector = master.start_node(DETECTOR, "detector.py", "_seconds:=0.2")
    original = command_line(detector.pid)
    attached = master.attach()
    assert master.topics_of(DETECTOR) == BEHIND_GENIE

    answers = master.play("1,2,3,1,2,3", pause_s=0.4)

    assert master.outcomes() == ["miss"] * 3 + ["hit"] * 3
    assert [answer["stamp_ns"] for answer in answers] == [
        second * 10**9 + 7 for second in range(1, 7)
    ]
    assert {answer["frame_id"] for answer in answers} == {"camera_02"}
    assert [answer["seq"] for answer in answers] == [1, 2, 3, 4, 5, 6]
    assert [answer["objects"] for answer in answers] == [
        [["car", place, 0.75, ["place", str(place)]]] for place in (1, 2, 3, 1, 2, 3)
    ]
    assert (master.folder / "seen").read_text().split() == ["1", "2", "3"]

    master.detach()
    assert attached.wait(PATIENCE_S) == 0
    until(lambda: back_as_it_was(master, original), "the node has its own topics again")
    assert [answer["objects"][0][1] for answer in master.play("1,1", pause_s=0.4)] == [1, 1]
    assert len(master.outcomes()) == 6, "the Genie is gone"


def test_the_same_image_while_the_first_is_under_way_waits_for_its_answer(master: Master):
    master.start_node(DETECTOR, "detector.py", "_seconds:=0.5")
    master.attach()
    answers = master.play("4,4", pause_s=0.1, listen_s=1.5)
    assert master.outcomes() == ["miss", "coalesced"]
    assert [answer["stamp_ns"] for answer in answers] == [1_000_000_007, 2_000_000_007]


def test_where_a_pose_is_known_the_object_map_answers_at_once(master: Master):
    """Seen once, the car at (10, 5) m is known: a camera two metres on is told so before its own
    detector is done.
    """
    master.start_node(DETECTOR, "detector.py", "_seconds:=0.4")
    settings = {"similarity": {"name": "pose_grid", "cell": "1 m"}}
    master.attach(settings=settings, pose_topic="/current_pose", horizontal_fov_rad=1.4)
    answers = master.play("1@2.2,1@4.2,1@2.7", pause_s=0.8)
    assert master.outcomes() == ["miss", "miss", "hit"]
    told = [
        (answer["stamp_ns"] // 10**9, [one[0] for one in answer["objects"]]) for answer in answers
    ]
    assert told == [(1, []), (1, ["car"]), (2, ["car"]), (2, ["car"]), (3, ["car"])]
    first_of_map = answers[2]
    assert first_of_map["objects"] == [["car", 0, 0.75, []]]
    seen_twice = round(0.75 + 0.1 * 0.75 * (1 - 0.75), 3)  # noisy or
    assert [answers[index]["objects"][0][2] for index in (1, 3, 4)] == [
        0.75,
        seen_twice,
        seen_twice,
    ]
    assert answers[4]["objects"][0][3] == ["place", "1"], (
        "no field of the node's own answer is lost"
    )


def test_a_killed_genie_leaves_the_robot_with_its_node(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    original = command_line(detector.pid)
    attached = master.attach()
    os.kill(master.pid_of(GENIE) or 0, signal.SIGKILL)
    assert attached.wait(PATIENCE_S) == 1
    assert "its Genie ended" in master.errors_of("attach")
    until(lambda: back_as_it_was(master, original), "the watchdog has restored the node")
    assert len(master.play("1,2")) == 2


def test_a_killed_watchdog_leaves_the_robot_with_its_node(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    original = command_line(detector.pid)
    attached = master.attach()
    genie = master.pid_of(GENIE)
    attached.kill()
    until(lambda: back_as_it_was(master, original), "the Genie has restored the node and gone")
    until(lambda: not Path(f"/proc/{genie}").exists(), "the Genie is gone")


def test_detach_repairs_what_a_power_cut_would_leave(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    original = command_line(detector.pid)
    attached = master.attach()
    genie = master.pid_of(GENIE) or 0
    for pid in (attached.pid, genie):
        os.kill(pid, signal.SIGSTOP)  # so that neither sees the other die
    for pid in (attached.pid, genie):
        os.kill(pid, signal.SIGKILL)
    attached.wait()
    assert master.topics_of(DETECTOR) == BEHIND_GENIE
    master.detach()
    until(lambda: back_as_it_was(master, original), "detach has restored the node")


def test_a_node_that_its_user_stops_stays_stopped(master: Master):
    master.start_node(DETECTOR, "detector.py")
    attached = master.attach()
    os.kill(master.pid_of(DETECTOR) or 0, signal.SIGINT)
    assert attached.wait(PATIENCE_S) == 1
    assert "it was not started again" in master.errors_of("attach")
    assert master.topics_of(DETECTOR) == ([], [])


def test_what_cannot_be_attached_to_is_refused_and_left_alone(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    assert f"unknown node '/vision_darknet' (did you mean '{DETECTOR}'?)" in master.try_attach(
        "/vision_darknet"
    )
    assert "pose_grid needs to know where the camera is" in master.try_attach(
        settings={"similarity": "pose_grid"}
    )
    assert "genie.eviction: unknown eviction 'lruu'" in master.try_attach(
        settings={"eviction": "lruu"}
    )
    assert "needs a folder of keys" in master.try_attach(connect=["edge1@127.0.0.1:1"])
    assert "unknown topic '/image'" in master.try_attach(requests=["/image"])
    assert master.pid_of(DETECTOR) == detector.pid
    master.attach()
    assert "already has a Genie" in master.try_attach()


def test_a_bag_played_at_it(master: Master, ros1_python: Path):
    """Ten places, twice, at 10 Hz out of a bag: ten runs of the detector and ten hits, in order."""
    bag, places = master.folder / "drive.bag", [*range(1, 11)] * 2
    make = [ros1_python, HERE / "make_bag.py", bag, ",".join(map(str, places)), "0.1"]
    subprocess.run(make, env=master.env, check=True, timeout=PATIENCE_S)
    master.start_node(DETECTOR, "detector.py")
    master.attach()
    listener = master.camera("-", 0, 5.0)
    listener.stdin.write("go\n")
    listener.stdin.flush()
    subprocess.run(
        ["rosbag", "play", "-q", bag],
        env=master.env,
        check=True,
        timeout=PATIENCE_S,
        stdin=subprocess.DEVNULL,
    )
    answers = [
        json.loads(line) for line in listener.communicate(timeout=PATIENCE_S)[0].splitlines()
    ]
    assert master.outcomes() == ["miss"] * 10 + ["hit"] * 10
    assert [answer["objects"][0][1] for answer in answers] == places
    assert [answer["stamp_ns"] for answer in answers] == [
        (index + 1) * 10**9 + 7 for index in range(20)
    ]


@pytest.mark.skipif(
    not REPUBLISH.exists(), reason=f"needs a C++ node: no {REPUBLISH} (image-transport-tools)"
)
def test_a_cpp_node_with_an_anonymous_name_and_remappings_of_its_own(master: Master):
    node = master.run([REPUBLISH, "raw", "in:=/image_raw", "raw", "out:=/image_copy"], "republish")
    name = until(
        lambda: next((one for one in master.subscribers(IMAGES) if "republish" in one), None),
        "it started",
    )
    original = command_line(node.pid)
    attached = master.attach(name)
    assert master.topics_of(name)[0] == ["/image_raw_local"]
    assert "/image_copy_local" in master.topics_of(name)[1]
    answers = master.play("1,2,1,2", answers="/image_copy")
    assert [answer["place"] for answer in answers] == [1, 2, 1, 2]
    assert [answer["stamp_ns"] // 10**9 for answer in answers] == [1, 2, 3, 4]
    assert master.outcomes() == ["miss", "miss", "hit", "hit"]
    master.detach(name)
    assert attached.wait(PATIENCE_S) == 0
    back = until(
        lambda: [one for one in master.subscribers(IMAGES) if "republish" in one],
        "it has its topics again",
    )
    assert command_line(master.pid_of(back[0]) or 0) == original
