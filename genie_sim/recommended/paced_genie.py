"""A car's Genie whose looks are apart from its answers.

Every frame is answered at once, out of the map of tracks. Looks, the passes of a detector over one
frame, are a flow of their own: the car's own detector takes what it can, and frames go up to the
edge's detector as the pacer lets them. No stored answer ever stands for a look, so the map sees as
long as any detector does. It has the topics of ``core.node.GenieNode``, and as little clock or
middleware.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any

from genie_sim.core.messages import (
    SHARED,
    Answer,
    Detection,
    Effect,
    Forgotten,
    Header,
    Look,
    LookEvent,
    MapChange,
    NewestLook,
    Observation,
    Publish,
)
from genie_sim.core.node import Request
from genie_sim.recommended.pacing import Loss, NewestLooks, Pacer
from genie_sim.recommended.shared_tracks import SharedTracks
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track_map import TrackMap

MakeAnswer = Callable[[Header, tuple[Detection, ...]], Answer]
REMEMBERED_NS = 10_000_000_000  # assumed: a frame that is older gets no look any more


class PacedGenie:
    """The Genie of a car with cameras.

    Parameters
    ----------
    name : str
        Of the node.
    subscribed, published : Sequence[str]
        The encapsulated detector's own topics: one of images, one of objects.
    pacer : Pacer
        Decides what goes up; ``None`` on a car without an edge.
    object_map : TrackMap
        Counts looks and serves tracks.
    shared : SharedTracks
        What the edge shares of other cars' looks; ``None`` where edges share nothing.
    map_answer : callable
        Makes an answer out of a header and objects.
    suffixes : tuple[str, str]
        What is affixed to topics towards the own node, and towards the edge (Section III-C).
    names_changes : bool
        Whether observations name the objects of the map that changed.
    """

    def __init__(
        self,
        name: str,
        subscribed: Sequence[str],
        published: Sequence[str],
        *,
        pacer: Pacer | None,
        object_map: TrackMap,
        shared: SharedTracks | None = None,
        map_answer: MakeAnswer,
        suffixes: tuple[str, str] = ("-local", "-remote"),
        names_changes: bool = True,
    ) -> None:
        self.name = name
        self.object_map = object_map
        self._shared = shared
        self._pacer = pacer
        self._map_answer = map_answer
        self._names_changes = names_changes
        (self._images,), (self._objects,) = subscribed, published
        self._to_node, self._to_edge = (self._images + suffix for suffix in suffixes)
        self._from_node, self._from_edge = (self._objects + suffix for suffix in suffixes)
        self._viewers: OrderedDict[Header, Viewer] = OrderedDict()  # of frames, by their stamps
        self._newest_looks = NewestLooks()

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return (self._images, self._from_node, self._from_edge)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        return (self._to_node, self._to_edge, self._objects)

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """A frame of a camera, or an answer of the own detector or of the edge."""
        effects: list[Effect] = self._forget(now_ns)
        if topic == self._images:
            return effects + self._on_frame(message, now_ns)
        if message.source == SHARED:
            if self._shared is not None:
                self._shared.replace(message.objects or (), message.valid_ns or 0)
            return effects
        return effects + self._on_answer(message, topic == self._from_node, now_ns)

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return None if self._pacer is None else self._pacer.next_deadline_ns()

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Gives up the frames that should have been answered by now."""
        return [] if self._pacer is None else [*_lost(self._pacer.expire(now_ns))]

    def cache_entries(self) -> int:
        """It has no message cache."""
        return 0

    def on_void(self) -> list[Observation]:
        """Records of what is lost when a fault wipes this Genie's state: the objects of its map."""
        objects = tuple(map(MapChange.of, self.object_map))
        return [Forgotten(objects)] if self._names_changes and objects else []

    def _on_frame(self, frame: Request, now_ns: int) -> list[Effect]:
        if frame.pose is None:  # without a place there is nothing to see, and nothing to learn
            return [Publish(self._to_node, frame)]
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        self._remember(viewer)
        looked_ns = self._newest_looks.looked_ns(frame.header, frame.pose.heading_rad)
        effects: list[Effect] = [
            NewestLook(frame.header, looked_ns),
            Publish(self._objects, self._answer_from_map(viewer, now_ns)),
        ]
        if self._pacer is not None:
            effects += _lost(self._pacer.expire(now_ns))
            if self._pacer.sends(frame.header, frame.pose.heading_rad, now_ns):
                effects.append(LookEvent(frame.header, "edge", "sent", self._pacer.gap_ns))
                effects.append(Publish(self._to_edge, frame))
        effects.append(Publish(self._to_node, frame))  # whose queue keeps the newest
        return effects

    def _on_answer(self, answer: Answer, own: bool, now_ns: int) -> list[Effect]:
        """A detector looked at one of the frames: the map learns it, and whoever waits for objects
        gets the answer to that frame anew.
        """
        effects: list[Effect] = []
        is_fresh = True
        if own or self._pacer is None:
            effects.append(LookEvent(answer.header, "own", "answered"))
        else:
            arrival = self._pacer.answered(answer.header, now_ns)
            is_fresh = arrival.is_fresh
            effects += _lost(arrival.lost)
            outcome = "answered" if is_fresh else "stale"
            effects.append(
                LookEvent(answer.header, "edge", outcome if arrival.is_awaited else "late")
            )
        viewer = self._viewers.get(answer.header)
        if viewer is None and own:  # nobody knows where the camera was: the answer itself counts
            return [*effects, Publish(self._objects, answer)]
        if viewer is None or not is_fresh:
            return effects
        self._newest_looks.learned(answer.header)
        look = look_of(answer, viewer)
        effects.append(self.object_map.learn(look, now_ns, self._names_changes))
        objects = self.object_map.visible(viewer, now_ns)
        answer = answer.with_objects(objects).with_look(look, now_ns)
        effects.append(Publish(self._objects, self._with_shared(answer, viewer, now_ns)))
        return effects

    def _answer_from_map(self, viewer: Viewer, now_ns: int) -> Answer:
        """The map's objects in view, where they are now."""
        objects = tuple(self.object_map.visible(viewer, now_ns))
        answer = self._map_answer(viewer.header, objects).with_look(None, now_ns)
        return self._with_shared(answer, viewer, now_ns).served("map", self.name)

    def _with_shared(self, answer: Answer, viewer: Viewer, now_ns: int) -> Answer:
        """An answer with what others saw in view, as far as the car believes it."""
        if self._shared is None:
            return answer
        own = answer.objects or ()
        believed = self._shared.served(own, viewer.pose, now_ns)
        in_view = [seen for seen in believed if self.object_map.shows(viewer, seen)]
        return answer.with_objects([*own, *in_view])

    def _remember(self, viewer: Viewer) -> None:
        self._viewers[viewer.header] = viewer
        oldest_ns = viewer.header.stamp_ns - REMEMBERED_NS
        while next(iter(self._viewers)).stamp_ns < oldest_ns:
            self._viewers.popitem(last=False)

    def _forget(self, now_ns: int) -> list[Effect]:
        objects = tuple(map(MapChange.of, self.object_map.forget(now_ns)))
        return [Forgotten(objects)] if self._names_changes and objects else []


def look_of(answer: Answer, viewer: Viewer) -> Look:
    """What a detector's answer to a frame says."""
    placed = tuple(item for item in answer.objects or () if item.location is not None)
    return Look(answer.header, viewer.pose, viewer.horizontal_fov_rad, placed)


def _lost(losses: Sequence[Loss]) -> list[Effect]:
    return [LookEvent(loss.header, "edge", loss.cause) for loss in losses]
