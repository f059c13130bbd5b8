"""Network interfaces of cars: how long they send or receive, and how long they stay awake."""

from typing import NamedTuple


class Interface(NamedTuple):
    """The kind of a car's network interface, and how long one stays awake after a transfer."""

    name: str
    tail_time_ns: int


class InterfaceUse:
    """The use of one interface by the links of a car, in both directions and to any edge.

    ``tail_ns`` is the time between two transfers in which it stayed awake, at most ``tail_time_ns``
    each time.
    """

    def __init__(self, tail_time_ns: int = 0) -> None:
        self.tail_ns = 0
        self._tail_time_ns = tail_time_ns
        self._transfers = 0  # that are going on now
        self._transfer_ns = 0  # of completed transfers
        self._since_ns = 0
        self._idle_since_ns: int | None = None

    def begin(self, now_ns: int) -> None:
        """A transfer begins."""
        if self._transfers == 0:
            self._since_ns = now_ns
            if self._idle_since_ns is not None:
                idle_ns = now_ns - self._idle_since_ns
                self.tail_ns += min(idle_ns, self._tail_time_ns)
        self._transfers += 1

    def end(self, now_ns: int) -> None:
        """A transfer ends."""
        self._transfers -= 1
        if self._transfers == 0:
            self._transfer_ns += now_ns - self._since_ns
            self._idle_since_ns = now_ns

    def transfer_ns(self, now_ns: int) -> int:
        """How long anything was sent or received until now."""
        return self._transfer_ns + (now_ns - self._since_ns if self._transfers else 0)
