"""Which random number belongs to what: the keys of ``base.seeds.Draws``.

They say what a frame or a message is, and never when it comes or after which others, so that it has
the same number under every method. Nodes have other names under other methods, so a sender is known
by its host.
"""

from genie_sim.core.header import Header
from genie_sim.core.messages import Detections, Message


def frame_key(header: Header) -> str:
    """The key of a frame."""
    stamp_ns, frame_id, origin = header
    return f"{stamp_ns}\n{origin}\n{frame_id}"


def message_key(topic: str, message: Message, at: str) -> str:
    """The key of a message: what it is about, what it says, the ``topic`` on which it comes (empty
    on a link), and the host or node ``at`` its other end, which is known by its host.
    """
    source = message.source if isinstance(message, Detections) else ""
    return f"{frame_key(message.header)}\n{source}\n{topic}\n{at.partition('/')[0]}"
