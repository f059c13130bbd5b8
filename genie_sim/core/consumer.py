"""What a car makes of the answers to its frames: the objects that it believes to be around it at any instant."""

import math
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from genie_sim.core.freshness.existence import Recommended
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.track_map import TrackMap
from genie_sim.core.tracking import COAST_NS, NEAR_M
from genie_sim.core.view import bearing
from genie_sim.messages import Detection, Detections, Header, Image, Location, Look

ConsumerName = Literal["newest", "tracker"]
ASKED = 256  # so many of its last frames a consumer remembers


class Consumer(ABC):
    """The node that the answers are for. Times are nanoseconds of the clock that stamps frames."""

    def __init__(self) -> None:
        self._frames: OrderedDict[Header, Image] = OrderedDict()  # that answers may still come for

    def on_frame(self, image: Image) -> None:
        """The car took a frame, to which answers will come."""
        at = image.pose, image.horizontal_fov_rad
        self._frames[image.header] = Image(
            image.header, image.size_bytes, image.digest, image.dhash, *at
        )
        if len(self._frames) > ASKED:
            self._frames.popitem(last=False)

    @abstractmethod
    def on_answer(self, answer: Detections, now_ns: int) -> None:
        """An answer is in the consumer's hands."""

    @abstractmethod
    def held(self, now_ns: int) -> tuple[Detection, ...]:
        """The objects that the consumer believes in, each at its place."""


class Newest(Consumer):
    """Holds, of each camera stream, the objects of the answer to its newest frame.

    An answer that holds at an instant (``Detections.valid_ns``) shows all that is in view then: its objects go on with
    their velocities, for a second at most, and what older answers show in that field of view counts no more. Of two
    objects of a class within a metre the first counts.
    """

    def __init__(self, laws: DetectorLaws = ASSUMED) -> None:
        super().__init__()
        self._newest: dict[str, Detections] = {}

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        stream = answer.header.frame_id
        held = self._newest.get(stream)
        if held is None or _instant(answer) >= _instant(held):
            self._newest[stream] = answer

    def held(self, now_ns: int) -> tuple[Detection, ...]:
        answers = [self._newest[stream] for stream in sorted(self._newest)]
        answers.sort(key=lambda one: 0 if one.valid_ns is None else -one.valid_ns)
        kept: list[Detection] = []
        places: dict[str, list[Location]] = {}  # of those kept, by their class
        shown: list[Image] = []
        for answer in answers:
            for one in answer.objects:
                at = one.location
                if at is None or any(_in_view(image, at) for image in shown):
                    continue
                one = one if answer.valid_ns is None else _moved(one, now_ns - answer.valid_ns)
                others = places.setdefault(one.label, [])
                if one.location is not None and not _is_near(one.location, others):
                    others.append(one.location)
                    kept.append(one)
            image = self._frames.get(answer.header)
            if answer.valid_ns is not None and image is not None:
                shown.append(image)
        return tuple(kept)


class Tracker(Consumer):
    """Tracks what detectors found in the car's frames, and predicts it: policy ``recommended`` in the car itself.

    It counts the look that comes with an answer. Of an answer without, the objects are the look, as far as a detector
    found them in this frame: what a cache or map adds is no look.
    """

    def __init__(self, laws: DetectorLaws = ASSUMED) -> None:
        super().__init__()
        policy = Recommended()
        policy.laws = laws
        self._map = TrackMap(ObjectMapRules(), policy)

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        look = answer.look
        if look is None and answer.source == "detector":
            image = self._frames.get(answer.header)
            if image is not None:
                found = tuple(one for one in answer.objects if one.method != "map")
                look = Look(answer.header, image.pose, image.horizontal_fov_rad, found)
        if look is not None:
            self._map.look(look, now_ns)

    def held(self, now_ns: int) -> tuple[Detection, ...]:
        self._map.forget(now_ns)
        return tuple(self._map.served(now_ns))


CONSUMERS: dict[ConsumerName, Callable[[DetectorLaws], Consumer]] = {
    "newest": Newest,
    "tracker": Tracker,
}


def _instant(answer: Detections) -> int:
    return answer.header.stamp_ns if answer.valid_ns is None else answer.valid_ns


def _in_view(image: Image, at: Location) -> bool:
    return abs(bearing(image.pose, at[0], at[1])[1]) <= image.horizontal_fov_rad / 2


def _moved(one: Detection, for_ns: int) -> Detection:
    if one.motion is None or one.location is None or for_ns <= 0:
        return one
    (east_mps, north_mps), dt_s = one.motion.velocity_mps, min(for_ns, COAST_NS) * 1e-9
    east_m, north_m, up_m = one.location
    return replace(one, location=(east_m + east_mps * dt_s, north_m + north_mps * dt_s, up_m))


def _is_near(at: Location, others: Sequence[Location]) -> bool:
    east_m, north_m, _ = at
    for other in others:
        if (
            abs(other[0] - east_m) < NEAR_M
            and math.hypot(other[0] - east_m, other[1] - north_m) < NEAR_M
        ):
            return True
    return False
