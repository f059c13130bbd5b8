"""What travels through the system: headers, images, detections, and the effects a Genie asks for.

Nothing here is changed once it is made. Of what a run makes most, these are plain classes with slots: they cost three
fifths of named tuples. Locations are metres in the scenario's one east-north-up frame,
angles radians, times integer nanoseconds, boxes pixels ``(x1, y1, x2, y2)``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, Self

Location = tuple[float, float, float]
Box = tuple[float, float, float, float]

Encoding = Literal[
    "raw", "png", "jpeg90", "jpeg80"
]  # how pictures are sent; the number is JPEG's quality

# autowarefoundation/autoware: a DetectedObjectArray of n objects with empty clouds takes 26 + 400 n bytes.
ARRAY_BYTES = 26
OBJECT_BYTES = 400  # class, score, place, velocity, variance and a header of its own among them
# A look: the pose of its camera (geometry_msgs/PoseStamped, 81) and its field of view (8), and of each detection class
# (8), score (4) and place (3 x 8).
LOOK_BYTES = 89
LOOK_DETECTION_BYTES = 36


class Header(NamedTuple):
    """Who took a picture, with which camera, when.

    ``origin`` (the car) is part of a request's identity because cars that replay the same drive can share stamps.
    """

    stamp_ns: int
    frame_id: str
    origin: str


class CameraPose(NamedTuple):
    """Where a camera stands and looks: east, north, up [m] and heading [rad], counter-clockwise from east."""

    east_m: float
    north_m: float
    up_m: float
    heading_rad: float


class Message(Protocol):
    """What Algorithm 1 needs of a message; the payload stays opaque."""

    @property
    def header(self) -> Header: ...

    @property
    def size_bytes(self) -> int: ...


class Answer(Message, Protocol):
    """An answer can be replayed under another header, and carries objects if its type has any (else ``None``).

    ``source`` is what produced it (``detector``, ``cache`` or ``map``) and ``served_by`` the node that did.
    """

    @property
    def objects(self) -> "Sequence[Detection] | None": ...

    @property
    def source(self) -> str: ...

    @property
    def look(self) -> "Look | None": ...

    @property
    def valid_ns(self) -> int | None: ...

    def restamped(self, header: Header) -> Self: ...

    def with_objects(self, objects: "Sequence[Detection]") -> Self: ...

    def with_look(self, look: "Look | None", valid_ns: int | None) -> Self: ...

    def served(self, source: str, by: str, header: Header | None = None) -> Self: ...


@dataclass(slots=True, unsafe_hash=True)
class Image:
    """One camera frame. ``content`` is what a detector would look at; a Genie never reads it."""

    header: Header
    size_bytes: int
    digest: str
    dhash: int
    pose: CameraPose
    horizontal_fov_rad: float
    content: Any = None


class Motion(NamedTuple):
    """What a map that tracks knows besides an object's place: its velocity east and north, how uncertain the place is,
    how likely the object exists, and the frame in which it was seen last."""

    velocity_mps: tuple[float, float]
    sigma_m: float
    existence: float
    seen: Header


@dataclass(slots=True, unsafe_hash=True)
class Detection:
    """One object found in an image.

    ``score`` is the detector's, ``confidence`` the object map's (equal to the score until a map has seen it).
    ``location`` is ``None`` where the object could not be placed in the world, ``box`` where it comes from an object
    map and not from this image. ``motion`` is ``None`` unless it comes from a map that tracks.
    """

    label: str
    score: float
    box: Box | None
    location: Location | None
    confidence: float
    method: str = "unknown"
    motion: Motion | None = None

    def with_confidence(self, confidence: float) -> "Detection":
        if confidence == self.confidence:
            return self
        return Detection(
            self.label, self.score, self.box, self.location, confidence, self.method, self.motion
        )


class Look(NamedTuple):
    """A detector's raw answer to one frame: what it found, and from where it looked.

    ``header`` identifies the look: whoever gets it by two ways counts it once. What is in the field of view and was
    not found is evidence, too.
    """

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float
    detections: tuple[Detection, ...]


class Frame(Protocol):
    """One frame of a recording: when it was taken, its image's size and fingerprints, and what a detector finds in it.

    ``stamp_ns`` counts from the drive's first frame; ``digest`` is the sha256 of the image, ``dhash`` its 64-bit
    difference hash.
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

    ``look`` is the detector's raw answer behind it, where it travels along. ``valid_ns``: every object that the sender
    believes to be in view, at the place predicted for that time; ``None``: objects as they were detected.
    """

    header: Header
    objects: tuple[Detection, ...]
    source: str = "detector"
    served_by: str = ""
    look: Look | None = None
    valid_ns: int | None = None

    @property
    def size_bytes(self) -> int:
        size_bytes = ARRAY_BYTES + OBJECT_BYTES * len(self.objects)
        if self.look is not None:
            size_bytes += LOOK_BYTES + LOOK_DETECTION_BYTES * len(self.look.detections)
        return size_bytes

    def restamped(self, header: Header) -> "Detections":
        return Detections(
            header, self.objects, self.source, self.served_by, self.look, self.valid_ns
        )

    def with_objects(self, objects: Sequence[Detection]) -> "Detections":
        return Detections(
            self.header, tuple(objects), self.source, self.served_by, self.look, self.valid_ns
        )

    def with_look(self, look: Look | None, valid_ns: int | None) -> "Detections":
        """The answer with this look and the instant for which it holds, or without."""
        return Detections(self.header, self.objects, self.source, self.served_by, look, valid_ns)

    def served(self, source: str, by: str, header: Header | None = None) -> "Detections":
        """The answer as a node gives it, under another ``header`` if one is given. One out of an object map stays that,
        even when a cache replays it: it was never a detection."""
        source, header = (
            "map" if self.source == "map" else source,
            self.header if header is None else header,
        )
        return Detections(header, self.objects, source, by, self.look, self.valid_ns)


@dataclass(slots=True)
class Publish:
    """Effect: publish ``message`` on ``topic``; ``to`` names one receiver, ``None`` every subscriber."""

    topic: str
    message: Message
    to: str | None = None


@dataclass(slots=True)
class ImageLookup:
    """The message cache was asked once. ``outcome`` is ``hit``, ``miss`` or ``coalesced``; ``requester`` is ``client``
    (its own network) or ``neighbour`` (another Genie on the edge network)."""

    header: Header
    outcome: str
    requester: str
    entries: int


# A stored object that is new or has been seen again, with its confidence from now on. Class and location are those of
# its first sighting, so they tell which object it is.
MapChange = tuple[str, Location, float]


@dataclass(slots=True)
class ObjectLookups:
    """The object map was asked ``requests`` times for one message.

    ``kind`` is ``sighting`` (Algorithm 2, line 4) or ``boost`` (line 10). ``hits`` counts the look-ups answered by a
    stored object with C >= C_T; ``updates`` the confidences changed, by ``boost_sum`` in total (C_new - C_old).
    ``changes`` are the objects that these updates changed, and the new ones; none from a Genie that does not tell them.
    """

    header: Header
    kind: str
    requests: int
    hits: int
    updates: int
    boost_sum: float
    objects: int
    changes: tuple[MapChange, ...] = ()


@dataclass(slots=True)
class Expired:
    """A client's request was forgotten before anybody answered it."""

    header: Header


@dataclass(slots=True)
class Forgotten:
    """Objects that the map holds no longer, because nobody has seen them for long enough; each as it was last."""

    objects: tuple[MapChange, ...]


Observation = ImageLookup | ObjectLookups | Expired | Forgotten  # for the log
Effect = Publish | Observation
