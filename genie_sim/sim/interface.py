"""Network interfaces of cars: how long they send or receive, and how long they stay awake."""

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from genie_sim.sim.link import Link


class NetworkInterface(NamedTuple):
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
        self._links: list[tuple[Link, Link]] = []  # up and down
        self._transfers = 0  # that are going on now
        self._transfer_ns = 0  # of completed transfers
        self._since_ns = 0
        self._idle_since_ns: int | None = None

    def carry(self, up: "Link", down: "Link") -> None:
        """Two links of the car use it from now on."""
        self._links.append((up, down))
        up.interface = down.interface = self

    def bytes_carried(self) -> tuple[int, int]:
        """How much went up and came down."""
        return (
            sum(up.sent_bytes for up, _ in self._links),
            sum(down.sent_bytes for _, down in self._links),
        )

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
