"""No cache, but good routing: every frame goes where its answer is expected in time, or nowhere.

After DeepDecision (X. Ran et al., INFOCOM 2018) with Neurosurgeon's split fixed at the input (Y. Kang et al., ASPLOS
2017). What is expected is estimated from the answers so far.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

from genie_sim.messages import Effect, Expired, Header, Image, Message, Publish
from genie_sim.methods.genie import REMOTE, UPLINK
from genie_sim.methods.similarity import LOCAL, TwoWays, at_least, share
from genie_sim.sim.station import Method, Place, Station
from genie_sim.units import NS_PER_MS, NS_PER_S

GAIN = 1 / 8  # of exponential means, as TCP's of round-trip times (RFC 6298)
Route = Literal["local", "remote"]


class Send(NamedTuple):
    """A frame is to go this way, in so many bytes."""

    route: Route
    size_bytes: int


class Line:
    """An exponentially weighted regression line: time against bytes."""

    def __init__(self) -> None:
        self._sums: tuple[float, ...] = ()  # means of x, t, x x, x t

    def seen(self, size_bytes: int, time_ns: int) -> None:
        x, t = float(size_bytes), float(time_ns)
        new = x, t, x * x, x * t
        self._sums = tuple(a + GAIN * (b - a) for a, b in zip(self._sums or new, new, strict=True))

    def at(self, size_bytes: int) -> float | None:
        """The time [ns] for so many bytes; ``None`` before the first is known."""
        if not self._sums:
            return None
        x, t, xx, xt = self._sums
        spread = xx - x * x
        slope = (
            max((xt - x * t) / spread, 0.0) if spread > 1e-6 * xx else t / x
        )  # of equal sizes: it is all the link
        return max(t + slope * (size_bytes - x), 0.0)


class Scheduler:
    """Chooses a route, and how much of a picture goes up it. ``shares`` are those of its bytes, best quality first."""

    def __init__(self, deadline_ns: int, shares: Sequence[float], probe_ns: int) -> None:
        self._deadline_ns, self._shares, self._probe_ns = deadline_ns, shares, probe_ns
        self._service_ns: float | None = None
        self._line = Line()
        self._sent: dict[Route, dict[Header, tuple[int, int]]] = {
            "local": {},
            "remote": {},
        }  # bytes, when
        self._used_ns: dict[Route, int] = {}
        self._free_ns = 0  # when the own detector gave its last answer

    def choose(self, header: Header, size_bytes: int, now_ns: int) -> list[Send]:
        """The ways of a frame: one, none where no estimate meets the deadline, and one more where none was tried for
        too long."""
        found: list[Send] = []
        waiting = min(len(self._sent["local"]), 2)
        local = None if self._service_ns is None else self._service_ns * (1 + waiting)
        for size in (round(part * size_bytes) for part in self._shares):
            options = [
                (local, Send("local", size_bytes)),
                (self._line.at(size), Send("remote", size)),
            ]
            known = [(estimate, send) for estimate, send in options if estimate is not None]
            best = min(known, default=None)
            if best is not None and best[0] <= self._deadline_ns:
                found.append(best[1])
                break
        for route in ("local", "remote"):
            last_ns = self._used_ns.get(route)
            if all(send.route != route for send in found) and (
                last_ns is None or now_ns - last_ns >= self._probe_ns
            ):
                found.append(Send(route, size_bytes))
        for send in found:
            self._used_ns[send.route] = now_ns
            self._sent[send.route][header] = send.size_bytes, now_ns
        return found

    def answered(self, route: Route, header: Header, now_ns: int) -> None:
        """An answer came back this way. Frames sent earlier and not answered were dropped on the way."""
        sent = self._sent[route]
        if header not in sent:
            return
        size_bytes, sent_ns = sent[header]
        self._sent[route] = {one: known for one, known in sent.items() if known[1] > sent_ns}
        if route == "remote":
            self._line.seen(size_bytes, now_ns - sent_ns)
            return
        took_ns = now_ns - max(sent_ns, self._free_ns)
        before_ns = took_ns if self._service_ns is None else self._service_ns
        self._service_ns = before_ns + GAIN * (took_ns - before_ns)
        self._free_ns = now_ns


class Deadline(Method):
    """Each frame goes to the car's detector or up, in less quality if need be, or nowhere if both are too late."""

    title = "deadline"

    def __init__(
        self,
        deadline_ns: int = 300 * NS_PER_MS,
        shares: tuple[float, ...] = (1.0, 0.7, 0.35),
        probe_ns: int = NS_PER_S,
    ) -> None:
        """``shares``: how many of a picture's bytes each quality takes, best first."""
        if not shares:
            raise ValueError("shares: must not be empty")
        self._told = (
            int(at_least("deadline", deadline_ns, 1)),
            tuple(share("shares", one) for one in shares),
            probe_ns,
        )

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        if not place.joined:
            return Station(detector=True)
        return Station(detector=True, interceptor=partial(self._router, place), uplink=UPLINK)

    def _router(self, place: Place, *topics: tuple[str, ...]) -> "Router":
        return Router(f"{place.name}/router", Scheduler(*self._told), *topics)


class Router(TwoWays):
    """Sends each picture on its way, and answers with what comes back."""

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic != self._images:
            self._known.answered(
                "local" if topic.endswith(LOCAL) else "remote", message.header, now_ns
            )
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        ways = self._known.choose(message.header, message.size_bytes, now_ns)
        return [self._sent(message, send) for send in ways] or [Expired(message.header)]

    def _sent(self, image: Image, send: Send) -> Publish:
        suffix = LOCAL if send.route == "local" else REMOTE
        return Publish(self._images + suffix, replace(image, size_bytes=send.size_bytes))
