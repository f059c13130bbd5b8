"""No cache, but good routing: every frame goes where its answer is expected in time, or nowhere.

After DeepDecision (X. Ran et al., INFOCOM 2018) with Neurosurgeon's split fixed at the input (Y.
Kang et al., ASPLOS 2017). Expected times are estimated from the answers so far.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal, NamedTuple

from genie_sim.base.marks import Bounds, NotEmpty
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.messages import Effect, Expired, Header, Image, Message, Publish
from genie_sim.sim.method import (
    LOCAL,
    REMOTE,
    REMOTE_UPLINK,
    HostConfig,
    HostContext,
    LocalAndRemote,
    Method,
)

GAIN = 1 / 8  # of exponential means, as TCP's of round-trip times (RFC 6298)
Way = Literal["local", "remote"]


class SentImage(NamedTuple):
    """The way that a frame takes, and the size of its image on it."""

    way: Way
    size_bytes: int


class LinearEstimate:
    """An exponentially weighted regression line: time against bytes."""

    def __init__(self) -> None:
        self._means: tuple[float, ...] = ()  # of x, t, x x, x t

    def add(self, size_bytes: int, time_ns: int) -> None:
        """One more measurement."""
        x, t = float(size_bytes), float(time_ns)
        new = (x, t, x * x, x * t)
        old = self._means or new
        self._means = tuple(a + GAIN * (b - a) for a, b in zip(old, new, strict=True))

    def at(self, size_bytes: int) -> float | None:
        """The time [ns] for so many bytes; ``None`` before the first measurement."""
        if not self._means:
            return None
        x, t, xx, xt = self._means
        variance = xx - x * x
        # Of equal sizes, all of the time is taken to grow with the size.
        slope = max((xt - x * t) / variance, 0.0) if variance > 1e-6 * xx else t / x
        return max(t + slope * (size_bytes - x), 0.0)


class Scheduler:
    """Chooses each frame's way and image size.

    Parameters
    ----------
    deadline_ns : int
        How long an answer may take [ns].
    shares : sequence of float
        The share of an image's bytes that each quality takes, best quality first.
    probe_ns : int
        A way that was not used for so long is tried again [ns].
    """

    def __init__(self, deadline_ns: int, shares: Sequence[float], probe_ns: int) -> None:
        self._deadline_ns = deadline_ns
        self._shares = shares
        self._probe_ns = probe_ns
        self._service_ns: float | None = None  # mean of the car's own detector
        self._remote = LinearEstimate()
        # frames without an answer: their bytes, and when they were sent
        self._pending: dict[Way, dict[Header, tuple[int, int]]] = {
            "local": {},
            "remote": {},
        }
        self._used_ns: dict[Way, int] = {}  # when a way was last chosen
        self._free_ns = 0  # when the car's own detector gave its last answer

    def choose(self, header: Header, size_bytes: int, now_ns: int) -> list[SentImage]:
        """The ways of a frame: the best one if it meets the deadline, and those that have not
        been tried for too long.
        """
        choices: list[SentImage] = []
        best = self._best(size_bytes)
        if best is not None:
            choices.append(best)
        for way in ("local", "remote"):
            last_ns = self._used_ns.get(way)
            is_stale = last_ns is None or now_ns - last_ns >= self._probe_ns
            if is_stale and all(choice.way != way for choice in choices):
                choices.append(SentImage(way, size_bytes))
        for choice in choices:
            self._used_ns[choice.way] = now_ns
            self._pending[choice.way][header] = (choice.size_bytes, now_ns)
        return choices

    def _best(self, size_bytes: int) -> SentImage | None:
        """The faster way, in the best quality for which it meets the deadline."""
        local_ns = None
        if self._service_ns is not None:
            waiting = min(len(self._pending["local"]), 2)
            local_ns = self._service_ns * (1 + waiting)
        for share_of_bytes in self._shares:
            sent_bytes = round(share_of_bytes * size_bytes)
            options = [
                (local_ns, SentImage("local", size_bytes)),
                (self._remote.at(sent_bytes), SentImage("remote", sent_bytes)),
            ]
            estimates = [(time_ns, choice) for time_ns, choice in options if time_ns is not None]
            if estimates:
                time_ns, choice = min(estimates)
                if time_ns <= self._deadline_ns:
                    return choice
        return None

    def answered(self, way: Way, header: Header, now_ns: int) -> None:
        """An answer came back on a way. Frames sent earlier and not answered were dropped on the
        way.
        """
        pending = self._pending[way]
        if header not in pending:
            return
        size_bytes, sent_ns = pending[header]
        self._pending[way] = {
            frame: departure for frame, departure in pending.items() if departure[1] > sent_ns
        }
        if way == "remote":
            self._remote.add(size_bytes, now_ns - sent_ns)
            return
        duration_ns = now_ns - max(sent_ns, self._free_ns)
        mean_ns = duration_ns if self._service_ns is None else self._service_ns
        self._service_ns = mean_ns + GAIN * (duration_ns - mean_ns)
        self._free_ns = now_ns


@dataclass(frozen=True)
class Deadline(Method):
    """Each frame goes to the car's detector or up, in less quality if need be, or nowhere if both
    are too late.
    """

    title = "deadline"

    deadline_ns: Annotated[int, Bounds(above=0)] = 300 * NS_PER_MS
    """How long an answer may take."""

    shares: Annotated[tuple[Annotated[float, Bounds(above=0, maximum=1)], ...], NotEmpty()] = (
        1.0,
        0.7,
        0.35,
    )
    """How many of an image's bytes each quality takes, best first."""

    probe_ns: int = NS_PER_S
    """A way that was not used for so long is tried again."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        if not host.has_edge:
            return HostConfig(detector=True)
        return HostConfig(
            detector=True, interceptor=partial(self._router, host), uplink=REMOTE_UPLINK
        )

    def _router(
        self, host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]
    ) -> "Router":
        scheduler = Scheduler(self.deadline_ns, self.shares, self.probe_ns)
        return Router(f"{host.name}/router", scheduler, inputs, outputs)


class Router(LocalAndRemote):
    """Sends each image on the way that its scheduler chooses, and answers with what comes
    back.
    """

    def __init__(self, name: str, scheduler: Scheduler, *topics: tuple[str, ...]) -> None:
        super().__init__(name, *topics)
        self._scheduler = scheduler

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic != self._images:
            way: Way = "local" if topic.endswith(LOCAL) else "remote"
            self._scheduler.answered(way, message.header, now_ns)
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        choices = self._scheduler.choose(message.header, message.size_bytes, now_ns)
        if not choices:
            return [Expired(message.header)]
        return [self._request(message, choice) for choice in choices]

    def _request(self, image: Image, choice: SentImage) -> Publish:
        suffix = LOCAL if choice.way == "local" else REMOTE
        return Publish(self._images + suffix, replace(image, size_bytes=choice.size_bytes))
