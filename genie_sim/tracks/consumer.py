"""What a car makes of the answers to its frames: the objects that it believes to be around it at
any instant.
"""

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from genie_sim.base import units
from genie_sim.base.marks import Share
from genie_sim.base.setting_errors import SettingError
from genie_sim.core.messages import Detection, Detections, Header, Image, Look
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.laws import ASSUMED, DetectorLaws
from genie_sim.tracks.track_map import TrackMap

REMEMBERED_NS = 30 * units.NS_PER_S  # for so long frames wait for their answers


class Shown(NamedTuple):
    """The objects of one answer that a consumer believes in.

    Those of an answer that holds at an instant, ``valid_ns``, are all that is in view of the
    ``viewer`` then; ``None`` if it is not known, or not any more.
    """

    objects: Sequence[Detection]
    valid_ns: int | None = None
    viewer: Viewer | None = None


class Consumer(ABC):
    """The node that the answers are for, node Z of the paper: ``judge.consumers`` hands it
    what the car's ``CarListener`` receives. Times are nanoseconds of the clock that stamps frames.
    """

    def __init__(self) -> None:
        # where the newest frames were taken, to which answers may still come
        self._viewers: OrderedDict[Header, Viewer] = OrderedDict()

    def on_frame(self, image: Image) -> None:
        """The car took a frame, to which answers will come."""
        self._viewers[image.header] = Viewer(image.header, image.pose, image.horizontal_fov_rad)
        while next(iter(self._viewers)).stamp_ns < image.header.stamp_ns - REMEMBERED_NS:
            self._viewers.popitem(last=False)

    @abstractmethod
    def on_answer(self, answer: Detections, now_ns: int) -> None:
        """An answer is in the consumer's hands."""

    @abstractmethod
    def shown(self, now_ns: int) -> Sequence[Shown]:
        """The objects that the consumer believes in, answer by answer. Where two answers show the
        same object, that of the first counts (``judge.held``).
        """


class Newest(Consumer):
    """Holds, of each camera stream, the objects of the answer to its newest frame."""

    def __init__(self) -> None:
        super().__init__()
        self._newest: dict[str, Detections] = {}

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        stream = answer.header.frame_id
        newest = self._newest.get(stream)
        if newest is None or _instant(answer) >= _instant(newest):
            self._newest[stream] = answer

    def shown(self, now_ns: int) -> Sequence[Shown]:
        answers = [self._newest[stream] for stream in sorted(self._newest)]
        # answers that hold at an instant come first, the newest of them before all others
        answers.sort(key=lambda answer: 0 if answer.valid_ns is None else -answer.valid_ns)
        return [
            Shown(answer.objects, answer.valid_ns, self._viewers.get(answer.header))
            for answer in answers
        ]


class Tracker(Consumer):
    """Tracks what detectors found in the car's frames, and predicts it: the map of the
    recommended Genie in the car itself.

    It learns the look that comes with an answer. Where none comes, what a detector found in the
    frame is the look; what a cache or a map has added is none.

    Parameters
    ----------
    p_min : float
        It holds what exists with at least this probability.
    tau_ns : int
        Looks within this time [ns] are no independent evidence; see ``tracks.existence``.
    laws : DetectorLaws
        The detectors' laws.
    """

    def __init__(self, p_min: float = 0.8, tau_ns: int = 0, laws: DetectorLaws = ASSUMED) -> None:
        super().__init__()
        self._map = TrackMap(ExistenceFilter(p_min, tau_ns, laws))

    def on_answer(self, answer: Detections, now_ns: int) -> None:
        look = answer.look
        if look is None and answer.source == "detector":
            viewer = self._viewers.get(answer.header)
            if viewer is not None:
                detections = tuple(item for item in answer.objects if item.placed_by != "map")
                look = Look(answer.header, viewer.pose, viewer.horizontal_fov_rad, detections)
        if look is not None:
            self._map.learn(look, now_ns)

    def shown(self, now_ns: int) -> Sequence[Shown]:
        self._map.forget(now_ns)
        return (Shown(self._map.believed(now_ns)),)


@dataclass(frozen=True)
class ConsumerRules:
    """What a car does with answers."""

    name: Literal["newest", "tracker"] = "newest"
    """`newest` holds the newest answer of each stream; `tracker` tracks objects and predicts
    between answers.
    """

    p_min: Share = 0.8
    """A tracker holds what exists with at least this probability."""

    tau_ns: int = 0
    """To a tracker looks within this time are no independent evidence; 0 weighs every look in
    full.
    """

    def __post_init__(self) -> None:
        if self.name != "tracker":
            for field in ("p_min", "tau_ns"):
                if getattr(self, field) != getattr(ConsumerRules, field):
                    text = f"has no effect with consumer {self.name!r}"
                    raise SettingError(field.removesuffix("_ns"), text)

    @classmethod
    def expand(cls, value: object) -> object:
        """``tracker`` for ``{name: tracker}``."""
        return {"name": value} if isinstance(value, str) else value

    def shorten(self) -> object:
        """The name alone where it says all."""
        if self == ConsumerRules(self.name):
            return self.name
        return {"name": self.name, "p_min": self.p_min, "tau": units.duration_text(self.tau_ns)}

    def new(self, laws: DetectorLaws = ASSUMED) -> Consumer:
        """A consumer with these settings and these laws of the detectors."""
        return Newest() if self.name == "newest" else Tracker(self.p_min, self.tau_ns, laws)


def _instant(answer: Detections) -> int:
    return answer.header.stamp_ns if answer.valid_ns is None else answer.valid_ns
