"""Random numbers of messages on a link: a message has the same ones under every method."""

from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.core.messages import Message
from genie_sim.sim.draw_keys import message_key

if TYPE_CHECKING:
    from genie_sim.sim.network import Network

REMEMBERED = 1000  # at least so many messages, of which it is known how often they were sent


class MessageRandom:
    """The random numbers of the message that one direction of a link sends now.

    It has the methods of a NumPy generator, such as ``integers``, and begins anew with every
    message. A message that is sent again has other numbers. Before the first message the numbers
    are the link's; what unfolds in time takes a generator of its own then, by ``spawn``.

    Parameters
    ----------
    network : Network
        Gives the random numbers.
    name : str
        The link's.
    """

    def __init__(self, network: "Network", name: str) -> None:
        self._draws = network.draws(name)
        self._message: Message | None = None
        self._host = ""
        self._key = "link"  # of the message; empty: not known yet
        self._drawn = 0  # how many numbers of it
        self._generator: np.random.Generator | None = None  # of it, once anybody asks
        self._times_sent: dict[str, int] = {}  # by the message
        self._times_before: dict[str, int] = {}  # of earlier messages

    def begin(self, message: Message | None, host: str) -> None:
        """From now on a message is sent to a host; ``None`` is background traffic."""
        self._message, self._host = message, host
        self._key = ""
        self._drawn = 0
        self._generator = None

    def random(self, size: Any = None) -> Any:
        """A number above 0 and below 1, or as many as ``size`` says."""
        if size is not None:
            return self.__getattr__("random")(size)
        self._drawn += 1
        return self._draws.uniform(f"{self._drawn}\n{self._key or self._find_key()}")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if self._generator is None:
            seed = int(self.random() * 2**52)
            self._generator = np.random.Generator(np.random.PCG64(seed))
        return getattr(self._generator, name)

    def _find_key(self) -> str:
        """The key of the present message, with how often it was sent before."""
        message = self._message
        key = "background" if message is None else message_key("", message, self._host)
        times = self._times_sent.get(key) or self._times_before.get(key, 0)
        self._times_sent[key] = times + 1
        if len(self._times_sent) >= REMEMBERED:
            self._times_before, self._times_sent = self._times_sent, {}
        self._key = f"{key}\n{times}"
        return self._key
