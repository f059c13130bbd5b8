"""The calls of a run, each due at an instant of simulated time."""

from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from operator import index
from typing import Any

from genie_sim.messages import Header
from genie_sim.monitor import Span, SpanLabel


class Timeline:
    """Calls by the instant at which they are due; ``now`` is the time since the run's start [ns].

    A heap holds the instants, and each instant has a list of calls, in the order in which they were
    scheduled. ``scheduled_ns`` is when the current call was scheduled, and ``has_ties`` whether the
    order of any two calls is unknown (see ``from_elsewhere``).

    Where time ``is_traced``, every frame is followed, which changes neither the instants nor the
    order of calls: a call that is scheduled with a label continues the path of the frame that is
    handled then, and ``path`` is the last span of the path that led to the current call. Queues
    keep the path of each message beside it and continue it with ``waited``. A span begins where the
    one before it ends, so the spans of an answer add up to its response time.
    """

    __slots__ = (
        "_calls",
        "_instants",
        "_is_traced",
        "_urgent",
        "now",
        "path",
    )

    def __init__(self, *, is_traced: bool = False) -> None:
        self.now = 0
        self.path: Span | None = None
        self._is_traced = is_traced
        self._instants: list[int] = []
        # of each, when it was scheduled, what is called, and with what
        self._calls: dict[int, list[tuple[Callable[..., None], tuple[Any, ...]]]] = {}
        # what comes before all other calls of this instant; ``step`` carries it out
        self._urgent: deque[Any] = deque()

    def after(
        self,
        delay_ns: int,
        call: Callable[..., None],
        arguments: tuple[Any, ...] = (),
        label: SpanLabel | None = None,
    ) -> None:
        """Schedules ``call(*arguments)``. Raises TypeError for a delay that is no whole number.

        Parameters
        ----------
        delay_ns : int
            The time until then [ns].
        call : callable
            What is called.
        arguments : tuple
            What it is called with.
        label : SpanLabel or None
            What the delay counts as on the path of the frame that is handled now; ``None``: the
            call has nothing to do with that frame.
        """
        if self.path is not None and label is not None:
            call, arguments = self._continue, (self.path, label, call, arguments)
        at_ns = self.now + index(delay_ns)
        calls = self._calls.get(at_ns)
        if calls is None:
            self._calls[at_ns] = [(call, arguments)]
            heappush(self._instants, at_ns)
        else:
            calls.append((call, arguments))

    def begin(self, header: Header) -> None:
        """A new frame is handled from now on."""
        if self._is_traced:
            self.path = Span(None, self.now, before=None, header=header)

    def waited(self, path: Span | None, label: SpanLabel) -> None:
        """Continues the ``path`` of a message that has waited until now, as ``label`` says."""
        if path is not None and path.end_ns != self.now:
            path = Span(label, self.now, before=path, header=path.header)
        self.path = path

    def _continue(
        self, path: Span, label: SpanLabel, call: Callable[..., None], arguments: tuple[Any, ...]
    ) -> None:
        """Carries out what was scheduled on the path of a frame."""
        self.waited(path, label)
        call(*arguments)
        self.path = None

    def next_ns(self) -> int | None:
        """The instant of the next call [ns]; ``None`` if none is scheduled."""
        return self._instants[0] if self._instants else None

    def step(self) -> None:
        """Carries out the next call. Raises IndexError if there is none."""
        self.now = self._instants[0]
        call, arguments = self._calls[self.now].pop(0)
        if not self._calls[self.now]:
            del self._calls[heappop(self._instants)]
        call(*arguments)

    def pass_time(self, until_ns: float) -> None:
        """Carries out all calls before an instant, at which it then is."""
        instants, take, urgent = self._instants, self._calls.pop, self._urgent
        while urgent:
            self.step()
        while instants and instants[0] < until_ns:
            self.now = at_ns = heappop(instants)
            for call, arguments in take(at_ns):
                call(*arguments)
                while urgent:
                    self.step()
        self.now = int(until_ns)

    def waits_only_for(self, call: Callable[..., None]) -> bool:
        """Whether no other call is scheduled."""
        for calls in self._calls.values():
            for scheduled, _ in calls:
                if scheduled != call:
                    return False
        return True

    def clear(self) -> None:
        """Drops all scheduled calls."""
        self._instants.clear()
        self._calls.clear()
