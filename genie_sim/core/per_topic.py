"""``pending_index: per_topic``: Algorithm 1 to the letter, where answers are not recognised."""

from typing import Any

from genie_sim.core.maps import EnhancedAnswer
from genie_sim.core.messages import Effect, Publish
from genie_sim.core.node import GenieNode


class PerTopicGenie(GenieNode):
    """A Genie that looks up a header among the requests on the message's own topic (line 7).

    An answer comes on another topic than its request, so it is never found, is taken for a request
    that misses, and is published for the node and for other Genies (lines 12 to 14).
    """

    def publications(self) -> tuple[str, ...]:
        answer_topics = [
            topic for topic, arrival in self._arrivals.items() if not arrival.is_request
        ]
        misses = [
            topic + suffix for topic in answer_topics for suffix in (self._local, self._remote)
        ]
        return (*super().publications(), *misses)

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """Algorithm 1, OnMessageArrival. See ``GenieNode.on_message``."""
        if self._arrivals[topic].is_request:
            return super().on_message(topic, message, now_ns, sender)
        confident = message
        if message.objects is not None:
            threshold = self.object_map.threshold
            confident = message.with_objects(
                [detection for detection in message.objects if detection.confidence >= threshold]
            )
        answer = EnhancedAnswer(message, to_clients=confident, to_neighbours=confident)
        return [
            *self._time_passes(now_ns),
            Publish(topic + self._local, confident),  # line 13
            Publish(topic + self._remote, self._readings.part_for_neighbours(answer)),  # line 14
        ]
