"""No cache, but good routing: every frame goes where its answer is expected in time, or nowhere."""

from functools import partial

from genie_sim.core.caches.deadline import Scheduler, Send
from genie_sim.messages import Effect, Expired, Image, Message, Observe, Publish
from genie_sim.methods.similarity import LOCAL, REMOTE, UPLINK, TwoWays, at_least, share
from genie_sim.sim.station import Method, Place, Station
from genie_sim.units import NS_PER_MS, NS_PER_S


class Deadline(Method):
    """Each frame goes to the car's detector or up, in less quality if need be, or nowhere if both are too late."""

    title = "deadline"

    def __init__(
        self, deadline_ns: int = 300 * NS_PER_MS, shares: tuple[float, ...] = (1.0, 0.7, 0.35), probe_ns: int = NS_PER_S
    ) -> None:
        """``shares``: how many of a picture's bytes each quality takes, best first."""
        if not shares:
            raise ValueError("shares: must not be empty")
        self._told = int(at_least("deadline", deadline_ns, 1)), tuple(share("shares", one) for one in shares), probe_ns

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        if not place.joined:
            return Station(detector=True)
        return Station(detector=True, interceptor=partial(Router, place.name, self._told), uplink=UPLINK)


class Router(TwoWays):
    """Sends each picture on its way, and answers with what comes back."""

    def __init__(
        self,
        car: str,
        told: tuple[int, tuple[float, ...], int],
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
    ) -> None:
        super().__init__(f"{car}/router", subscribed, published)
        self._scheduler = Scheduler(*told)

    def on_message(self, topic: str, message: Message, now_ns: int, sender: str | None = None) -> list[Effect]:
        if topic != self._images:
            self._scheduler.answered("local" if topic.endswith(LOCAL) else "remote", message.header, now_ns)
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        ways = self._scheduler.choose(message.header, message.size_bytes, now_ns)
        return [self._sent(message, send) for send in ways] or [Observe(Expired(message.header))]

    def _sent(self, image: Image, send: Send) -> Publish:
        suffix = LOCAL if send.route == "local" else REMOTE
        return Publish(self._images + suffix, image._replace(size_bytes=send.size_bytes))
