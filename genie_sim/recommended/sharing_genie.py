"""A Genie beside an edge's detector, not in its way: it learns what detectors found, and shares
with each car the tracks of others.

The detector answers the cars directly. This node reads the frames that come up (for their poses),
the detector's answers, and the looks that neighbouring edges broadcast. After each answer the car
that asked gets the tracks of other cars around it.
"""

from collections.abc import Sequence
from typing import Any

from genie_sim.core.messages import Answer, Effect, Publish, Request
from genie_sim.core.node import MakeAnswer
from genie_sim.recommended.shared_tracks import SHARED, SharingRules, tracks_to_share
from genie_sim.recommended.tracking_genie import TrackingGenie, look_of
from genie_sim.sim.method import REMOTE
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track_map import TrackMap


class SharingGenie(TrackingGenie):
    """The Genie of an edge server whose cars look for themselves. Its map learns the looks of all
    cars of this edge and of its neighbours.

    Parameters
    ----------
    name, inputs, outputs, object_map, make_answer, names_changes
        As those of ``TrackingGenie``.
    rules : SharingRules
        What cars get.
    answers_frames : bool
        Whether it answers frames out of its map, as on an edge that gets positions and no images.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        *,
        object_map: TrackMap,
        rules: SharingRules,
        make_answer: MakeAnswer,
        answers_frames: bool = False,
        names_changes: bool = True,
    ) -> None:
        super().__init__(
            name,
            inputs,
            outputs,
            object_map=object_map,
            make_answer=make_answer,
            names_changes=names_changes,
        )
        self._rules = rules
        self._answers_frames = answers_frames
        self._between_edges = self._objects + REMOTE

    def subscriptions(self) -> tuple[str, ...]:
        return (self._images, self._objects, self._between_edges)

    def publications(self) -> tuple[str, ...]:
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
        effects = self._forget(now_ns)
        is_own = topic == self._objects
        viewer = self._viewers.pop(answer.header, None) if is_own else None
        look = answer.look if viewer is None else look_of(answer, viewer)
        if look is not None:
            effects.append(self._learn(look, now_ns))
            if is_own:  # neighbours get the look itself, and track its objects in maps of their own
                report = answer.with_objects(()).with_look(look, None)
                effects.append(Publish(self._between_edges, report))
        return effects if viewer is None else [*effects, self._share(answer, viewer, now_ns)]

    def _answer(self, frame: Request, now_ns: int) -> list[Effect]:
        """What the map shows at the frame's pose, where it is now."""
        if frame.pose is None:
            return []
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        answer = self._answer_from_map(viewer, now_ns)
        return [Publish(self._objects, answer.credited("map", self.name))]

    def _share(self, answer: Answer, viewer: Viewer, now_ns: int) -> Publish:
        """The tracks that the car gets that asked."""
        tracks = tracks_to_share(
            self.object_map,
            car=answer.header.origin,
            pose=viewer.pose,
            now_ns=now_ns,
            rules=self._rules,
        )
        answer_of_others = self._make_answer(answer.header, tuple(tracks)).with_look(None, now_ns)
        return Publish(self._objects, answer_of_others.credited(SHARED, self.name))
