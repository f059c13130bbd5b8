"""Pictures that are encoded before they go over a link: by a CPU of the car, and decoded by one of the edge.

What a detector finds in them then comes from a recording of the very pictures after encoding and decoding.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from genie_sim.messages import Detection, Encoding, Frame, Image, Message
from genie_sim.sim.device import Arguments, Done
from genie_sim.sim.ros_graph import Graph, Node
from genie_sim.sim.service import MEGABYTE

# To encode and to decode a megabyte of pixels [ns], with OpenCV on one core of an AMD EPYC: medians over drive
# 2011_09_26/0005 (benchmarks/encodings.py). Devices have a factor.
TIMES_NS: dict[Encoding, tuple[int, int]] = {
    "png": (14_410_000, 6_940_000),
    "jpeg90": (1_330_000, 1_690_000),
    "jpeg80": (1_160_000, 1_360_000),
}
Take = Callable[[str, Message, str], None]  # topic, message, sender
Recorded = Mapping[
    str, Mapping[tuple[str, int], Frame]
]  # by car; by the picture's digest and stamp


class Sent(NamedTuple):
    """What is found in a picture that was sent, its size on the wire and in memory, and the raw picture's features."""

    detections: tuple[Detection, ...]
    wire_bytes: int
    raw_bytes: int
    features: Mapping[str, bytes]


@dataclass(frozen=True)
class Codec:
    """How pictures are sent, and how they are recorded after that.

    A camera whose pictures have a smaller size than the recording's, such as a grey one, sends as many bytes as the
    recorded picture, but never more than it has.
    """

    encoding: Encoding
    recorded: Recorded

    def on_wire(self, message: Message) -> Message:
        """The message as it goes over a link."""
        if not isinstance(message, Image):
            return message
        content = message.content
        if not isinstance(content, Sent):
            frames = self.recorded.get(message.header.origin, {})
            frame = frames.get((message.digest.rpartition("/")[2], content.stamp_ns))
            if frame is None:  # a position
                return message
            wire_bytes, features = (
                min(frame.size_bytes, message.size_bytes),
                getattr(content, "features", {}),
            )
            content = Sent(frame.detections, wire_bytes, message.size_bytes, features)
        return replace(message, size_bytes=content.wire_bytes, content=content)

    def in_memory(self, message: Message) -> Message:
        """The message after it was decoded."""
        if isinstance(message, Image) and isinstance(message.content, Sent):
            return replace(message, size_bytes=message.content.raw_bytes)
        return message


class Coder(Node):
    """Encodes (``step`` 0) or decodes (1) pictures on the CPU of its host; then ``take`` gets them, and all else at
    once. It keeps the newest pictures of each camera, as the node that it belongs to does."""

    part = "encoding"

    def __init__(self, name: str, graph: Graph, codec: Codec, step: int, take: Take) -> None:
        super().__init__(name, graph, (), (), threads=graph.host.device.cores)
        self._codec = codec
        self._take = take
        self._per_megabyte = TIMES_NS[codec.encoding][step] * self.host.device.codec_factor

    def inject(self, topic: str, message: Message, sender: str) -> None:
        """A message comes; its picture waits with those of its camera."""
        if self._codec.on_wire(message) is message:
            self._take(topic, message, sender)
        else:
            camera = message.header
            self.deliver(f"{topic} {camera.origin}/{camera.frame_id}", message, sender)

    def work(self, message: Message, done: Done, arguments: Arguments) -> None:
        raw = self._codec.in_memory(message)
        self.host.cpu.run(round(raw.size_bytes / MEGABYTE * self._per_megabyte), done, arguments)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        self._take(topic.partition(" ")[0], self._codec.in_memory(message), sender)
