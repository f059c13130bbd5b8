"""Messages go to other processes as they are."""

import pickle

import pytest

from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image, Look
from genie_sim.tracks.track import Motion

HEADER = Header(7, "camera_02", "car1")
POSE = CameraPose(1.0, 2.0, 3.0, 0.5)
SEEN = Motion((1.0, 2.0), 0.3, 0.9, HEADER)
DETECTION = Detection(
    "car",
    0.5,
    (1.0, 2.0, 3.0, 4.0),
    (5.0, 6.0, 7.0),
    0.8,
    placed_by="lidar",
    motion=SEEN,
    seen_in=Header(6, "camera_03", "car2"),
)
LOOK = Look(HEADER, POSE, 1.4, (DETECTION,))
ANSWER = Detections(
    HEADER, (DETECTION,), "cache", "edge1/genie", LOOK, valid_ns=9, seen_in=Header(5, "", "car3")
)
IMAGE = Image(HEADER, 100, "digest", 3, POSE, 1.4, content="frame")


@pytest.mark.parametrize("message", [DETECTION, ANSWER, IMAGE], ids=lambda it: type(it).__name__)
def test_a_message_survives_the_way_to_another_process(message):
    arrived = pickle.loads(pickle.dumps(message))
    assert type(arrived) is type(message) and repr(arrived) == repr(message)
    assert arrived == message and hash(arrived) == hash(message)
