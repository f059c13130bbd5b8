"""What travels through the system: headers, images, detections, and the effects a Genie asks for.

Nothing here is changed once it is made, but for ``ObjectLookups``, which count up while a message
is handled. Of what a run makes most, these are plain classes with slots: they cost three fifths of
named tuples, and less than frozen classes. Locations are metres in the scenario's one east-north-up
frame, angles radians, times integer nanoseconds, boxes pixels ``(x1, y1, x2, y2)``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, Self

from genie_sim.core.encodings import Encoding as Encoding
from genie_sim.core.header import Header as Header

Location = tuple[float, float, float]
Box = tuple[float, float, float, float]

# autowarefoundation/autoware: a DetectedObjectArray of n objects with empty clouds takes 26 + 400 n
# bytes.
ARRAY_BYTES = 26
OBJECT_BYTES = 400  # class, score, place, velocity, variance and a header of its own among them
# A look: the pose of its camera (geometry_msgs/PoseStamped, 81) and its field of view (8), and of
# each detection class (8), score (4) and place (3 x 8).
LOOK_BYTES = 89
LOOK_DETECTION_BYTES = 36


class CameraPose(NamedTuple):
    """Where a camera stands and looks.

    Parameters
    ----------
    east_m, north_m, up_m : float
        Its centre in the scenario's one east-north-up frame, in metres.
    heading_rad : float
        Its optical axis in radians, counter-clockwise from east.
    """

    east_m: float
    north_m: float
    up_m: float
    heading_rad: float

    def carried(self, location: Location, to: "CameraPose") -> Location:
        """The place that is as far ahead, aside and above of pose ``to`` as a location is of this
        one.
        """
        turn_rad = to.heading_rad - self.heading_rad
        cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
        east_m, north_m = location[0] - self.east_m, location[1] - self.north_m
        return (
            to.east_m + cosine * east_m - sine * north_m,
            to.north_m + sine * east_m + cosine * north_m,
            to.up_m + (location[2] - self.up_m),
        )


class Message(Protocol):
    """What Algorithm 1 needs of a message; the payload stays opaque."""

    @property
    def header(self) -> Header: ...

    @property
    def size_bytes(self) -> int: ...


class Request(Message, Protocol):
    """A message that a client sends. ``pose`` is where its camera stood, ``None`` where that is
    unknown.
    """

    @property
    def pose(self) -> CameraPose | None: ...

    @property
    def horizontal_fov_rad(self) -> float: ...


class Answer(Message, Protocol):
    """An answer can be replayed under another header, and carries objects if its type has any (else
    ``None``).

    ``source`` is what produced it (``detector``, ``cache`` or ``map``) and ``served_by`` the node
    that did.
    """

    @property
    def objects(self) -> "Sequence[Detection] | None": ...

    @property
    def source(self) -> str: ...

    @property
    def look(self) -> "Look | None": ...

    @property
    def valid_ns(self) -> int | None: ...

    @property
    def seen_in(self) -> Header | None: ...

    def restamped(self, header: Header) -> Self: ...

    def with_objects(self, objects: "Sequence[Detection]") -> Self: ...

    def with_look(self, look: "Look | None", valid_ns: int | None) -> Self: ...

    def credited(self, source: str, by: str, header: Header | None = None) -> Self: ...


@dataclass(slots=True, unsafe_hash=True)
class Image:
    """One camera frame.

    Parameters
    ----------
    header : Header
        Who took it, with which camera, when.
    size_bytes : int
        What it takes to send, in bytes.
    digest : str
        The SHA-256 of the picture, 64 hexadecimal digits: equal pictures have equal ones.
    dhash : int
        Its difference hash, 64 bits: similar pictures differ in few of them.
    pose : CameraPose
        Where the camera was.
    horizontal_fov_rad : float
        What it sees from its left to its right border, in radians.
    content : object
        What a detector would look at: in a simulation a ``Frame``, in real ROS the message.
        A Genie never reads it.
    """

    header: Header
    size_bytes: int
    digest: str
    dhash: int
    pose: CameraPose
    horizontal_fov_rad: float
    content: Any = None


@dataclass(slots=True, unsafe_hash=True)
class Detection:
    """One object found in an image.

    Parameters
    ----------
    label : str
        Its class, such as ``car`` or ``person``.
    score : float
        The detector's, from 0 to 1.
    box : tuple of float or None
        Left, top, right and bottom in the image, in pixels; ``None`` where the object comes from an
        object map and not from this image.
    location : tuple of float or None
        East, north and up of its centre, in metres, in the scenario's one frame; ``None`` where the
        object could not be placed in the world.
    confidence : float
        The object map's, from 0 to 1; equal to the score until a map has seen the object.
    placed_by : str
        How it was placed: ``scan``, ``ground``, ``table``; ``map`` of what an object map says;
        ``none`` if it was not; ``unknown``.
    motion : object or None
        What a map beyond the paper's adds (``tracks.track.Motion``); no rule of the paper reads it.
    seen_in : Header or None
        The newest frame in which a detector found an object of a map; ``None`` for what a detector
        has just found: the frame is that of the answer.
    """

    label: str
    score: float
    box: Box | None
    location: Location | None
    confidence: float
    placed_by: str = "unknown"
    motion: Any = None
    seen_in: Header | None = field(default=None, compare=False)

    def with_confidence(self, confidence: float) -> "Detection":
        if confidence == self.confidence:
            return self
        # by position: one is made for every sighting, and keywords take half as long again
        return Detection(
            self.label,
            self.score,
            self.box,
            self.location,
            confidence,
            self.placed_by,
            self.motion,
            self.seen_in,
        )

    def with_location(self, location: Location) -> "Detection":
        return replace(self, location=location)


class Look(NamedTuple):
    """A detector's raw answer to one frame: what it found, and from where it looked.

    Parameters
    ----------
    header : Header
        The frame. It identifies the look: whoever gets it by two ways learns it once.
    pose : CameraPose
        Where the camera was.
    horizontal_fov_rad : float
        What it saw from its left to its right border, in radians. What is in there and was not
        found is evidence, too.
    detections : tuple of Detection
        What was found, in no particular order.
    """

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float
    detections: tuple[Detection, ...]

    @property
    def size_bytes(self) -> int:
        return LOOK_BYTES + LOOK_DETECTION_BYTES * len(self.detections)


class Frame(Protocol):
    """One frame of a recording: when it was taken, its image's size and fingerprints, and what a
    detector finds in it.

    ``stamp_ns`` counts from the drive's first frame; ``digest`` is the sha256 of the image,
    ``dhash`` its 64-bit difference hash.
    """

    @property
    def stamp_ns(self) -> int: ...

    @property
    def size_bytes(self) -> int: ...

    @property
    def digest(self) -> str: ...

    @property
    def dhash(self) -> int: ...

    @property
    def pose(self) -> CameraPose: ...

    @property
    def horizontal_fov_rad(self) -> float: ...

    @property
    def detections(self) -> tuple[Detection, ...]: ...


@dataclass(slots=True, unsafe_hash=True)
class Detections:
    """A detector's answer to one image, in the manner of ``autoware_msgs/DetectedObjectArray``.

    Parameters
    ----------
    header : Header
        The frame that it answers.
    objects : tuple of Detection
        What is there, as far as the sender knows.
    source : str
        What produced it: ``detector``, ``cache`` or ``map``, or a word of a method's own.
    served_by : str
        The node that gave it, such as ``car1/genie``; empty until one has.
    look : Look or None
        The detector's raw answer behind it, where it travels along.
    valid_ns : int or None
        Objects are all those that the sender believes to be in view, each at the place predicted
        for this time [ns]; ``None``: as they were detected.
    seen_in : Header or None
        The frame at which the detector looked; ``None``: that of ``header``, to which it first was
        an answer.
    """

    header: Header
    objects: tuple[Detection, ...]
    source: str = "detector"
    served_by: str = ""
    look: Look | None = None
    valid_ns: int | None = None
    seen_in: Header | None = field(default=None, compare=False)

    @property
    def size_bytes(self) -> int:
        size_bytes = ARRAY_BYTES + OBJECT_BYTES * len(self.objects)
        if self.look is not None:
            size_bytes += self.look.size_bytes
        return size_bytes

    @property
    def is_fresh(self) -> bool:
        """Whether it shows a detector's look at the very frame that it is an answer to."""
        return self.source == "detector" and self.seen_in in (None, self.header)

    @property
    def looked_ns(self) -> int | None:
        """When the newest frame was taken in which a detector saw any of it; of a detector's answer
        the frame at which it looked, even if it found nothing. ``None`` for nothing out of a map.
        """
        newest_ns: int | None = None
        if self.source != "map":
            newest_ns = (self.seen_in or self.header).stamp_ns
        return newest_look_ns(self.objects, newest_ns)

    def restamped(self, header: Header) -> "Detections":
        """The answer under another header."""
        return replace(self, header=header, seen_in=self.seen_in or self.header)

    def with_objects(self, objects: Sequence[Detection]) -> "Detections":
        """The answer with other objects."""
        return replace(self, objects=tuple(objects))

    def with_look(self, look: Look | None, valid_ns: int | None) -> "Detections":
        """The answer with this look and the instant for which it holds, or without."""
        return Detections(
            self.header,
            self.objects,
            self.source,
            self.served_by,
            look,
            valid_ns=valid_ns,
            seen_in=self.seen_in,
        )

    def credited(self, source: str, by: str, header: Header | None = None) -> "Detections":
        """The answer as a node gives it, under another ``header`` if one is given. One out of an
        object map stays that, even when a cache replays it: it was never a detection.
        """
        return Detections(
            self.header if header is None else header,
            self.objects,
            "map" if self.source == "map" else source,
            by,
            self.look,
            valid_ns=self.valid_ns,
            seen_in=self.seen_in or self.header,
        )


def newest_look_ns(objects: Sequence[Detection], newest_ns: int | None) -> int | None:
    """When the newest frame was taken in which a detector saw one of the objects, or the
    ``newest_ns`` known already.
    """
    for item in objects:
        header = item.seen_in
        if header is not None and (newest_ns is None or newest_ns < header.stamp_ns):
            newest_ns = header.stamp_ns
    return newest_ns


@dataclass(slots=True)
class Publish:
    """Effect: publish ``message`` on ``topic``; ``to`` names one receiver, ``None`` every
    subscriber.
    """

    topic: str
    message: Message
    to: str | None = None


@dataclass(slots=True)
class Observation:
    """Effect: what a node tells the log. A method may have further kinds."""


@dataclass(slots=True)
class ImageLookup(Observation):
    """The message cache was asked once. ``outcome`` is ``hit``, ``miss`` or ``coalesced``;
    ``requester`` is ``client`` (its own network) or ``neighbour`` (another Genie on the edge
    network).
    """

    header: Header
    outcome: str
    requester: str
    entries: int


class MapObject(Protocol):
    """An object of a map. ``number`` is its own: the map gives each one once."""

    number: int
    label: str

    @property
    def confidence(self) -> float: ...

    @property
    def location(self) -> Location: ...


class MapChange(NamedTuple):
    """An object of a map that is new, was seen again or is forgotten, as it is then.

    ``number`` tells which object of the map it is: the objects of a map that tracks move.
    """

    number: int
    label: str
    location: Location
    confidence: float

    @classmethod
    def of(cls, item: MapObject) -> "MapChange":
        """An object of a map as it is now."""
        return cls(item.number, item.label, item.location, item.confidence)


@dataclass(slots=True)
class ObjectLookups(Observation):
    """The object map was asked ``requests`` times for one message.

    ``kind`` is ``sighting`` (Algorithm 2, line 4) or ``boost`` (line 11). ``hits`` are the
    look-ups answered by a stored object with C >= C_T; ``updates`` the confidences changed, by
    ``boost_sum`` in total (C_new - C_old). ``changes`` are the objects that these updates changed,
    and the new ones; ``forgotten`` those that the map no longer holds because of this message. A
    Genie that does not tell them has none of either.
    """

    header: Header
    kind: str
    requests: int = 0
    hits: int = 0
    updates: int = 0
    boost_sum: float = 0.0
    objects: int = 0
    changes: tuple[MapChange, ...] = ()
    forgotten: tuple[MapChange, ...] = ()


@dataclass(slots=True)
class Expired(Observation):
    """A client's request was forgotten before anybody answered it."""

    header: Header


@dataclass(slots=True)
class Forgotten(Observation):
    """Objects that the map holds no longer, because nobody has seen them for long enough; each as
    it was last.
    """

    objects: tuple[MapChange, ...]


Effect = Publish | Observation
