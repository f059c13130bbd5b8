"""A bound, not a method: a cache that knows which answers are right, has everybody's at once, and takes no time."""

from functools import partial

from genie_sim.core.caches.oracle import KnownAnswers
from genie_sim.messages import Detections, Effect, Image, ImageLookup, Message, Observe, Publish
from genie_sim.methods.similarity import LOCAL, REMOTE, UPLINK, TwoWays
from genie_sim.sim.station import Method, Place, Station


class Oracle(Method):
    """A bound: each car at once has every answer that any car got, and replays only those that are right."""

    title = "oracle (bound)"

    def __init__(self) -> None:
        self._known = KnownAnswers()

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        node = partial(AllKnowing, place.name, self._known)
        return Station(detector=True, interceptor=node, uplink=UPLINK if place.joined else None, free=True)


class AllKnowing(TwoWays):
    """Replays a right answer, or takes the first of both detectors: with the draws that they have, the faster way."""

    def __init__(
        self, car: str, known: KnownAnswers, subscribed: tuple[str, ...], published: tuple[str, ...]
    ) -> None:
        super().__init__(f"{car}/oracle", subscribed, published)
        self._known = known

    def on_message(self, topic: str, message: Message, now_ns: int, sender: str | None = None) -> list[Effect]:
        if topic != self._images:
            assert isinstance(message, Detections)
            self._known.add(message)
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        right = self._known.right(message.content.detections)
        lookup = ImageLookup(message.header, "miss" if right is None else "hit", "client", len(self._known))
        if right is not None:
            again = right.restamped(message.header).served("cache", self.name)
            return [Observe(lookup), Publish(self._objects, again)]
        return [Observe(lookup), *(Publish(self._images + suffix, message) for suffix in (LOCAL, REMOTE))]
