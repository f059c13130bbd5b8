"""Image encoding: the car's CPU encodes an image before the uplink, the edge's CPU decodes it.

What a detector finds in it then comes from a recording of the same images after encoding and
decoding.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from genie_sim.core.messages import Encoding, Frame, Image, Message
from genie_sim.sim.clock import Steps
from genie_sim.sim.content import BentFrame, EncodedContent
from genie_sim.sim.device import MEGABYTE
from genie_sim.sim.ros_graph import Graph, Node, camera_flow


class CodecTimes(NamedTuple):
    """Times per megabyte of pixels [ns]."""

    encode: int
    decode: int


# With OpenCV on one core of an AMD EPYC: medians over drive 2011_09_26/0005
# (tools/make/encodings.py). Devices have a factor.
TIMES_NS: dict[Encoding, CodecTimes] = {
    "png": CodecTimes(14_410_000, 6_940_000),
    "jpeg90": CodecTimes(1_330_000, 1_690_000),
    "jpeg80": CodecTimes(1_160_000, 1_360_000),
}
CoderRole = Literal["encoder", "decoder"]
Take = Callable[[str, Message, str], None]  # topic, message, sender
# by car; by the image's digest and stamp
Recorded = Mapping[str, Mapping[tuple[str, int], Frame]]


@dataclass(frozen=True)
class ImageCodec:
    """How images are encoded, and how they are recorded after that.

    A camera whose images have a smaller size than the recording's, such as a grey one, sends as
    many bytes as the recorded image, but never more than its own size.
    """

    encoding: Encoding
    recordings: Recorded

    def encoded(self, message: Message) -> Message:
        """The message as it goes over a link."""
        if not isinstance(message, Image):
            return message
        content = message.content
        if not isinstance(content, EncodedContent):
            frames = self.recordings.get(message.header.origin, {})
            _, _, digest = message.digest.rpartition("/")
            frame = frames.get((digest, content.stamp_ns))
            if frame is None:  # a position
                return message
            detections = frame.detections
            if isinstance(content, BentFrame):
                detections = content.change(detections)
            content = EncodedContent(
                detections=detections,
                encoded_bytes=min(frame.size_bytes, message.size_bytes),
                raw_bytes=message.size_bytes,
                features=getattr(content, "features", {}),
            )
        return replace(message, size_bytes=content.encoded_bytes, content=content)

    def is_image(self, message: Message) -> bool:
        """Whether it encodes a message: one with an image, and not with a mere position."""
        return self.encoded(message) is not message

    def decoded(self, message: Message) -> Message:
        """The message after it was decoded."""
        if isinstance(message, Image) and isinstance(message.content, EncodedContent):
            return replace(message, size_bytes=message.content.raw_bytes)
        return message


class Coder(Node):
    """Takes the time in which images are encoded or decoded on the CPU of its host, then hands the
    raw images to ``take``; all else it hands over at once. What goes over a link is encoded there,
    by the ``Bridge``, without time. It keeps the newest images of each camera, as the node that it
    belongs to does.

    Parameters
    ----------
    graph : Graph
        The graph that it registers with.
    codec : ImageCodec
        How images are encoded.
    role : {"encoder", "decoder"}
        What it is, and the end of its name.
    take : callable
        Called with topic, message and sender.
    """

    part = "encoding"

    def __init__(
        self,
        graph: Graph,
        codec: ImageCodec,
        *,
        role: CoderRole,
        take: Take,
    ) -> None:
        super().__init__(f"{graph.name}/{role}", graph, (), (), threads=graph.host.device.cores)
        self._codec = codec
        self._take = take
        times = TIMES_NS[codec.encoding]
        per_megabyte_ns = times.encode if role == "encoder" else times.decode
        self._per_megabyte_ns = per_megabyte_ns * self.host.device.codec_factor

    def inject(self, topic: str, message: Message, sender: str) -> None:
        """A message comes; an image waits with those of its camera."""
        if self._codec.is_image(message):
            self.deliver(topic, message, sender)
        else:
            self._take(topic, message, sender)

    def flow(self, topic: str, message: Message) -> Hashable:
        return camera_flow(topic, message)

    def work(self, topic: str, message: Message, sender: str) -> Steps:
        raw = self._codec.decoded(message)
        service_ns = round(raw.size_bytes / MEGABYTE * self._per_megabyte_ns)
        return self.host.cpu.serve(service_ns, self.work_label)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        self._take(topic, self._codec.decoded(message), sender)
