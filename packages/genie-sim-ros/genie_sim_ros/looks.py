"""Paced looks in real ROS: the clock of the cameras, and an edge that keeps nothing."""

from collections.abc import Sequence
from typing import Any

from genie_sim.core.messages import Effect, Publish

MAX_STEP_BACK_NS = 1_000_000_000  # a clock that falls behind by more was set back


class StampClock:
    """Tells the time on the clock that stamps frames, which need not be this computer's.

    A frame never comes before its stamp, so the frame that came soonest after its own shows how far
    the clocks are apart.
    """

    def __init__(self) -> None:
        self._ahead_ns: int | None = None

    def received(self, stamp_ns: int, now_ns: int) -> None:
        """A frame with this stamp has come."""
        ahead_ns = stamp_ns - now_ns
        if (
            self._ahead_ns is None
            or ahead_ns > self._ahead_ns
            or ahead_ns < self._ahead_ns - MAX_STEP_BACK_NS
        ):
            self._ahead_ns = ahead_ns

    def now_ns(self, now_ns: int) -> int:
        """The time there at this time here; the same before the first frame."""
        return now_ns + (self._ahead_ns or 0)


class EdgeRelay:
    """Stands in front of an edge's detector whose cars pace their looks: it hands every frame to
    the detector and every answer to whoever asked. No stored answer stands for a look.
    """

    def __init__(
        self,
        name: str,
        subscribed: Sequence[str],
        published: Sequence[str],
        *,
        suffixes: tuple[str, str],
    ) -> None:
        self.name = name
        (images,), (objects,) = subscribed, published
        local, _ = suffixes
        self._next = {images: images + local, objects + local: objects}

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that it listens to."""
        return tuple(self._next)

    def publications(self) -> tuple[str, ...]:
        """Every topic that it may publish on."""
        return tuple(self._next.values())

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """A frame, or an answer of the detector; what other edges say concerns nobody here."""
        return [Publish(self._next[topic], message)] if topic in self._next else []

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """It waits for nothing."""
        return []
