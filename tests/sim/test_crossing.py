"""Messages that go from one process to another arrive as they were."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from genie_sim.messages import CameraPose, Detection, Detections, Header, Image, Look, Motion
from genie_sim.sim.crossing import SeenElsewhere, pack, unpack

HERE, THERE = Header(10**9 + 1, "camera_02", "car1"), Header(7, "camera_03", "car2")
POSE = CameraPose(1.5, -2.25, 1.65, 0.125)
SEEN = Detection("car", 0.5, (1.0, 2.0, 3.0, 4.0), (5.0, 6.0, 0.75), 0.625, "scan")
NOWHERE = Detection("person", 0.25, None, None, 0.25)
TRACK = replace(
    SEEN,
    box=None,
    method="map",
    motion=Motion((1.0, -0.5), 0.75, 0.875, THERE, ("car2", "car3"), signed=True),
    seen_in=THERE,
)
LOOK = Look(THERE, POSE, 1.25, (SEEN, NOWHERE), signed=True)
ANSWER = Detections(HERE, (SEEN, NOWHERE, TRACK), "map", "edge/genie", LOOK, 123, THERE)
IMAGE = Image(HERE, 90_000, "digest", 2**63 + 1, POSE, 1.5, SeenElsewhere((SEEN, TRACK)), (LOOK,))


@pytest.mark.parametrize(
    "message",
    [ANSWER, IMAGE, Detections(THERE, ()), replace(IMAGE, looks=(), content=SeenElsewhere(()))],
)
def test_a_message_arrives_as_it_was(message):
    arrived = unpack(pickle.loads(pickle.dumps(pack(message))))
    assert type(arrived) is type(message) and arrived == message
    assert repr(arrived) == repr(message)  # comparing leaves out in which frame it was seen
    for name in ("header", "seen_in"):
        header = getattr(arrived, name, None)
        assert header is None or type(header) is Header


def test_of_an_image_only_what_a_detector_finds_in_it_goes_along():
    class Recorded:
        detections = (SEEN,)
        picture = b"pixels"

    arrived = unpack(pack(replace(IMAGE, content=Recorded())))
    assert arrived.content == SeenElsewhere((SEEN,))


def test_another_kind_of_message_is_refused():
    with pytest.raises(TypeError, match=r"^int cannot go to another process$"):
        pack(5)
