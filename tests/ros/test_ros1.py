"""A Genie in front of an unmodified ROS 1 node: real master, real messages, real processes."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from tests.ros.conftest import DETECTOR, Master, until

IMAGES, OBJECTS = "/image_raw", "/detection/image_detector/objects"
UNTOUCHED = ([IMAGES], [OBJECTS])
BEHIND_GENIE = ([IMAGES + "_local"], [OBJECTS + "_local"])
GENIE = "/genie_vision_darknet_detect"


def command_line(pid: int) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def back_as_it_was(master: Master, original: bytes) -> bool:
    pid = master.pid_of(DETECTOR)
    return master.topics_of(DETECTOR) == UNTOUCHED and pid is not None and command_line(pid) == original


def test_the_second_time_at_a_place_is_a_hit(master: Master):
    """Three places, twice: three runs of the detector, three answers out of the cache, each under its own header."""
    detector = master.start_node(DETECTOR, "detector.py")
    original = command_line(detector.pid)
    attached = master.attach()
    assert master.topics_of(DETECTOR) == BEHIND_GENIE

    answers = master.play("1,2,3,1,2,3")

    assert master.outcomes() == ["miss"] * 3 + ["hit"] * 3
    assert [answer["stamp_ns"] for answer in answers] == [second * 10**9 + 7 for second in range(1, 7)]
    assert {answer["frame_id"] for answer in answers} == {"camera_02"}
    assert [answer["seq"] for answer in answers] == [1, 2, 3, 4, 5, 6]
    assert [answer["objects"] for answer in answers] == [
        [["car", place, 0.75, ["place", str(place)]]] for place in (1, 2, 3, 1, 2, 3)
    ]
    assert min(answer["after_s"] for answer in answers[:3]) > 0.05 > max(answer["after_s"] for answer in answers[3:])

    master.detach()
    assert attached.wait(10) == 0
    until(lambda: back_as_it_was(master, original), "the node has its own topics again")
    assert [answer["objects"][0][1] for answer in master.play("1,1")] == [1, 1]
    assert len(master.outcomes()) == 6, "the Genie is gone"


def test_the_same_image_while_the_first_is_under_way_waits_for_its_answer(master: Master):
    master.start_node(DETECTOR, "detector.py", "_seconds:=0.5")
    master.attach()
    answers = master.play("4,4", pause_s=0.1, listen_s=1.5)
    assert master.outcomes() == ["miss", "coalesced"]
    assert [answer["stamp_ns"] for answer in answers] == [1_000_000_007, 2_000_000_007]


def test_a_killed_genie_leaves_the_robot_with_its_node(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    original = command_line(detector.pid)
    attached = master.attach()
    os.kill(master.pid_of(GENIE) or 0, signal.SIGKILL)
    assert attached.wait(20) == 1
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
    assert attached.wait(20) == 1
    assert "it was not started again" in master.errors_of("attach")
    assert master.topics_of(DETECTOR) == ([], [])


def test_what_cannot_be_attached_to_is_refused_and_left_alone(master: Master):
    detector = master.start_node(DETECTOR, "detector.py")
    assert f"unknown node '/vision_darknet' (did you mean '{DETECTOR}'?)" in master.try_attach("/vision_darknet")
    assert "pose_grid needs to know where the camera is" in master.try_attach(settings={"similarity": "pose_grid"})
    assert "genie: eviction: unknown eviction 'lruu'" in master.try_attach(settings={"eviction": "lruu"})
    assert "needs a file with the shared key" in master.try_attach(connect=["127.0.0.1:1"])
    assert "unknown topic '/image'" in master.try_attach(requests=["/image"])
    assert master.pid_of(DETECTOR) == detector.pid
    master.attach()
    assert "already has a Genie" in master.try_attach()
