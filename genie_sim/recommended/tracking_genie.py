"""What the recommended Genies of cars and edges have in common: a map of tracks, and from where
frames were taken.
"""

from collections import OrderedDict
from collections.abc import Sequence

from genie_sim.core.messages import (
    Answer,
    Effect,
    Forgotten,
    Header,
    Look,
    MapChange,
    Observation,
    Request,
)
from genie_sim.core.node import MakeAnswer
from genie_sim.sim.method import Interceptor
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track_map import TrackMap

REMEMBERED_NS = 10_000_000_000  # assumed: a frame that is older gets no look any more


class TrackingGenie(Interceptor):
    """A Genie whose map learns the looks of detectors. It has no message cache.

    Parameters
    ----------
    name : str
        Of the node.
    inputs, outputs : Sequence[str]
        The detector's own topics: one of images, one of objects.
    object_map : TrackMap
        Learns looks and gives tracks.
    make_answer : callable
        Makes an answer out of a header and objects.
    names_changes : bool
        Whether observations name the objects of the map that changed.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        *,
        object_map: TrackMap,
        make_answer: MakeAnswer,
        names_changes: bool,
    ) -> None:
        self.name = name
        self.object_map = object_map
        self._make_answer = make_answer
        self._names_changes = names_changes
        (self._images,), (self._objects,) = inputs, outputs
        self._viewers: OrderedDict[Header, Viewer] = OrderedDict()  # of frames, by their stamps

    def on_memory_lost(self) -> list[Observation]:
        """Records of what is lost when a fault wipes this Genie's state: the objects of its map."""
        return [*self._forgotten(tuple(map(MapChange.of, self.object_map)))]

    def _answer_from_map(self, viewer: Viewer, now_ns: int) -> Answer:
        """The map's objects in view, where they are now."""
        objects = tuple(self.object_map.in_view(viewer, now_ns))
        return self._make_answer(viewer.header, objects).with_look(None, now_ns)

    def _remember(self, frame: Request) -> Viewer | None:
        """From where a frame was taken, noted until its look comes; ``None`` where that is
        unknown.
        """
        if frame.pose is None:
            return None
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        self._viewers[frame.header] = viewer
        oldest_ns = frame.header.stamp_ns - REMEMBERED_NS
        while next(iter(self._viewers)).stamp_ns < oldest_ns:
            self._viewers.popitem(last=False)
        return viewer

    def _learn(self, look: Look, now_ns: int) -> Observation:
        return self.object_map.learn(look, now_ns, names_changes=self._names_changes)

    def _forget(self, now_ns: int) -> list[Effect]:
        """The map forgets the tracks whose time is over."""
        return [*self._forgotten(tuple(map(MapChange.of, self.object_map.forget(now_ns))))]

    def _forgotten(self, objects: tuple[MapChange, ...]) -> list[Forgotten]:
        return [Forgotten(objects)] if self._names_changes and objects else []


def look_of(answer: Answer, viewer: Viewer) -> Look:
    """What a detector's answer to a frame says."""
    detections = tuple(item for item in answer.objects or () if item.location is not None)
    return Look(answer.header, viewer.pose, viewer.horizontal_fov_rad, detections)
