"""A Genie beside an edge's detector, not in its way: it counts what cameras saw, and shares with
each car the tracks of others.

The detector answers the cars directly. This node reads the frames that come up (for their poses),
the detector's answers, and the looks that neighbouring edges broadcast. After each answer the car
that asked gets the tracks of other cars around it.
"""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

from genie_sim.core.messages import (
    SHARED,
    Answer,
    Effect,
    Forgotten,
    Header,
    MapChange,
    Observation,
    Publish,
)
from genie_sim.core.node import Request
from genie_sim.recommended.paced_genie import REMEMBERED_NS, MakeAnswer, look_of
from genie_sim.recommended.shared_tracks import SharingRules, tracks_to_share
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track_map import TrackMap


class SharingGenie:
    """The Genie of an edge server whose cars look for themselves.

    Parameters
    ----------
    name : str
        Of the node.
    subscribed, published : Sequence[str]
        The detector's own topics: one of images, one of objects.
    object_map : TrackMap
        Counts the looks of all cars of this edge and of its neighbours.
    rules : SharingRules
        What cars get.
    make_answer : Callable
        Makes an answer out of a header and objects.
    answers_frames : bool
        Whether it answers frames out of its map, as on an edge that gets positions and no images.
    remote : str
        What is affixed to the topic of objects between edges.
    names_changes : bool
        Whether observations name the objects of the map that changed.
    """

    def __init__(
        self,
        name: str,
        subscribed: Sequence[str],
        published: Sequence[str],
        *,
        object_map: TrackMap,
        rules: SharingRules,
        make_answer: MakeAnswer,
        answers_frames: bool = False,
        remote: str = "-remote",
        names_changes: bool = True,
    ) -> None:
        self.name = name
        self.object_map = object_map
        self._rules = rules
        self._make_answer = make_answer
        self._answers_frames = answers_frames
        self._names_changes = names_changes
        (self._images,), (self._objects,) = subscribed, published
        self._between_edges = self._objects + remote
        self._viewers: OrderedDict[Header, Viewer] = OrderedDict()

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return (self._images, self._objects, self._between_edges)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        return (self._objects, self._between_edges)

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """A frame that came up, an answer of the detector, or a look of a neighbour's."""
        if topic == self._images and not self._answers_frames:
            self._remember(message)
            return []
        if topic == self._images:
            return self._answer(message, now_ns)
        answer: Answer = message
        if answer.source == SHARED:  # its own
            return []
        effects: list[Effect] = []
        forgotten = tuple(map(MapChange.of, self.object_map.forget(now_ns)))
        if forgotten and self._names_changes:
            effects.append(Forgotten(forgotten))
        own = topic == self._objects
        viewer = self._viewers.pop(answer.header, None) if own else None
        look = answer.look if viewer is None else look_of(answer, viewer)
        if look is not None:
            effects.append(self.object_map.learn(look, now_ns, self._names_changes))
            if own:  # the look itself travels; tracks are each map's own
                travels = answer.with_objects(()).with_look(look, None)
                effects.append(Publish(self._between_edges, travels))
        return effects if viewer is None else [*effects, self._shared(answer, viewer, now_ns)]

    def _answer(self, frame: Request, now_ns: int) -> list[Effect]:
        """What the map shows at the frame's pose, where it is now."""
        if frame.pose is None:
            return []
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        objects = tuple(self.object_map.visible(viewer, now_ns))
        answer = self._make_answer(frame.header, objects).with_look(None, now_ns)
        return [Publish(self._objects, answer.served("map", self.name))]

    def _shared(self, answer: Answer, viewer: Viewer, now_ns: int) -> Publish:
        """The tracks that the car gets that asked."""
        tracks = tuple(
            tracks_to_share(
                self.object_map,
                self.object_map.existence,
                car=answer.header.origin,
                pose=viewer.pose,
                now_ns=now_ns,
                rules=self._rules,
            )
        )
        shared = self._make_answer(answer.header, tracks).with_look(None, now_ns)
        return Publish(self._objects, shared.served(SHARED, self.name))

    def next_deadline_ns(self) -> int | None:
        """It waits for nothing."""
        return None

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """It waits for nothing."""
        return []

    def cache_entries(self) -> int:
        """It has no message cache."""
        return 0

    def on_void(self) -> list[Observation]:
        """Records of what is lost when a fault wipes this Genie's state: the objects of its map."""
        objects = tuple(map(MapChange.of, self.object_map))
        return [Forgotten(objects)] if self._names_changes and objects else []

    def _remember(self, frame: Request) -> None:
        if frame.pose is None:
            return
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        self._viewers[frame.header] = viewer
        oldest_ns = frame.header.stamp_ns - REMEMBERED_NS
        while next(iter(self._viewers)).stamp_ns < oldest_ns:
            self._viewers.popitem(last=False)
