"""Latency breakdown: a clock that records, for every call, the chain of spans that led to it.

Every delay of a run is a call at a later time (``Clock.after``) with a label: a span on the path of
the frame that caused it. Queues keep the path of each message beside it and continue it with
``waited``. A span begins where the one before it ends, so the spans of an answer add up to its
response time.
"""

from collections.abc import Callable
from typing import Any

from genie_sim.messages import Header
from genie_sim.monitor import Span, SpanLabel
from genie_sim.sim.clock import Clock


class TracingClock(Clock):
    """A clock that follows every frame. It changes neither the instants nor the order of calls."""

    def begin(self, header: Header) -> None:
        self.path = Span(None, self.now, before=None, header=header)

    def waited(self, path: Span | None, label: SpanLabel) -> None:
        if path is not None and path.end_ns != self.now:
            path = Span(label, self.now, before=path, header=path.header)
        self.path = path

    def after(
        self,
        delay_ns: int,
        call: Callable[..., None],
        arguments: tuple[Any, ...] = (),
        label: SpanLabel | None = None,
    ) -> None:
        if self.path is None or label is None:
            super().after(delay_ns, call, arguments)
        else:
            super().after(delay_ns, self._continue, (self.path, label, call, arguments))

    def _continue(
        self, path: Span, label: SpanLabel, call: Callable[..., None], arguments: tuple[Any, ...]
    ) -> None:
        self.waited(path, label)
        call(*arguments)
        self.path = None
