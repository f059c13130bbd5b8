"""A car's Genie whose looks are apart from its answers.

Every frame is answered at once, out of the map of tracks. Looks, the passes of a detector over one
frame, are a flow of their own: the car's own detector takes what it can, and frames go up to the
edge's detector as the pacer lets them. No stored answer ever stands for a look: the map learns from
detectors alone. It has the topics of ``core.node.GenieNode``.
"""

from collections.abc import Sequence
from typing import Any

from genie_sim.core.messages import Answer, Effect, Publish, Request
from genie_sim.core.node import SUFFIXES, MakeAnswer
from genie_sim.recommended.pacing import Loss, NewestLooks, Pacer
from genie_sim.recommended.shared_tracks import SHARED, SharedTracks
from genie_sim.recommended.tracking_genie import TrackingGenie, look_of
from genie_sim.sim.monitor import LookEvent
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track_map import TrackMap


class PacedGenie(TrackingGenie):
    """The Genie of a car with cameras.

    Parameters
    ----------
    name, inputs, outputs, object_map, make_answer, names_changes
        As those of ``TrackingGenie``.
    pacer : Pacer
        Decides what goes up; ``None`` on a car without an edge.
    shared_tracks : SharedTracks
        What the edge shares of other cars' looks; ``None`` where edges share nothing.
    suffixes : tuple[str, str]
        What is affixed to topics towards the own node, and towards the edge (Section III-C).
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        *,
        pacer: Pacer | None,
        object_map: TrackMap,
        shared_tracks: SharedTracks | None = None,
        make_answer: MakeAnswer,
        suffixes: tuple[str, str] = SUFFIXES,
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
        self._shared_tracks = shared_tracks
        self._pacer = pacer
        # images go to the own detector and to the edge, answers come from both
        self._to_node, self._to_edge = (self._images + suffix for suffix in suffixes)
        self._from_node, self._from_edge = (self._objects + suffix for suffix in suffixes)
        self._newest_looks = NewestLooks()

    def subscriptions(self) -> tuple[str, ...]:
        return (self._images, self._from_node, self._from_edge)

    def publications(self) -> tuple[str, ...]:
        return (self._to_node, self._to_edge, self._objects)

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """A frame of a camera, or an answer of the own detector or of the edge."""
        effects = self._forget(now_ns)
        if topic == self._images:
            return effects + self._on_frame(message, now_ns)
        if message.source == SHARED:
            if self._shared_tracks is not None:
                self._shared_tracks.replace(message.objects or (), message.valid_ns or 0)
            return effects
        return effects + self._on_answer(message, topic == self._from_node, now_ns)

    def next_deadline_ns(self) -> int | None:
        return None if self._pacer is None else self._pacer.next_deadline_ns()

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Gives up the frames that should have been answered by now."""
        return [] if self._pacer is None else [*_lost(self._pacer.expire(now_ns))]

    def _on_frame(self, frame: Request, now_ns: int) -> list[Effect]:
        viewer = self._remember(frame)
        if viewer is None:  # without a pose the map can neither answer nor learn
            return [Publish(self._to_node, frame)]
        heading_rad = viewer.pose.heading_rad
        looked_ns = self._newest_looks.add_frame(frame.header, heading_rad)
        answer = self._with_shared(self._answer_from_map(viewer, now_ns), viewer, now_ns)
        effects: list[Effect] = [
            LookEvent(frame.header, "map", "answered", looked_ns=looked_ns),
            Publish(self._objects, answer.credited("map", self.name)),
        ]
        if self._pacer is not None:
            effects += _lost(self._pacer.expire(now_ns))
            departure = self._pacer.dispatch(frame.header, heading_rad, now_ns)
            if departure is not None:
                effects.append(LookEvent(frame.header, "edge", "sent", departure.gap_ns))
                effects.append(Publish(self._to_edge, frame))
        effects.append(Publish(self._to_node, frame))  # whose queue keeps the newest
        return effects

    def _on_answer(self, answer: Answer, is_own: bool, now_ns: int) -> list[Effect]:
        """A detector looked at one of the frames: the map learns it, and the answer to that frame
        is published once more, with what the map then shows.
        """
        effects: list[Effect] = []
        is_in_time = True
        if is_own or self._pacer is None:
            effects.append(LookEvent(answer.header, "own", "answered"))
        else:
            arrival = self._pacer.answered(answer.header, now_ns)
            is_in_time = arrival.is_in_time
            effects += _lost(arrival.losses)
            outcome = "answered" if is_in_time else "stale"
            effects.append(
                LookEvent(answer.header, "edge", outcome if arrival.is_awaited else "late")
            )
        viewer = self._viewers.get(answer.header)
        if viewer is None and is_own:  # nobody knows where the camera was: the answer itself counts
            return [*effects, Publish(self._objects, answer)]
        if viewer is None or not is_in_time:
            return effects
        self._newest_looks.add_look(answer.header)
        look = look_of(answer, viewer)
        effects.append(self._learn(look, now_ns))
        objects = self.object_map.in_view(viewer, now_ns)
        answer = answer.with_objects(objects).with_look(look, now_ns)
        effects.append(Publish(self._objects, self._with_shared(answer, viewer, now_ns)))
        return effects

    def _with_shared(self, answer: Answer, viewer: Viewer, now_ns: int) -> Answer:
        """An answer with what other cars saw in view, as far as this one believes it."""
        if self._shared_tracks is None:
            return answer
        own_objects = answer.objects or ()
        candidates = self._shared_tracks.believed(own_objects, viewer.pose, now_ns)
        in_view = [item for item in candidates if self.object_map.is_in_view(viewer, item)]
        return answer.with_objects([*own_objects, *in_view])


def _lost(losses: Sequence[Loss]) -> list[Effect]:
    return [LookEvent(loss.header, "edge", loss.cause) for loss in losses]
