"""What travels through the system: headers, images, detections, and the effects a Genie asks for.

Everything here is immutable. These are named tuples because very many are made: they cost a third of frozen
dataclasses. Locations are metres in the scenario's one east-north-up frame, angles radians, times integer nanoseconds,
boxes pixels ``(x1, y1, x2, y2)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, Self

Location = tuple[float, float, float]
Box = tuple[float, float, float, float]

# autowarefoundation/autoware: a DetectedObjectArray of n objects with empty clouds takes 26 + 400 n bytes.
ARRAY_BYTES = 26
OBJECT_BYTES = 400


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
    def objects(self) -> Sequence[Detection] | None: ...

    def restamped(self, header: Header) -> Self: ...

    def with_objects(self, objects: Sequence[Detection]) -> Self: ...

    def served(self, source: str, by: str) -> Self: ...


class Image(NamedTuple):
    """One camera frame. ``content`` is what a detector would look at; a Genie never reads it."""

    header: Header
    size_bytes: int
    digest: str
    dhash: int
    pose: CameraPose
    horizontal_fov_rad: float
    content: Any = None


class Detection(NamedTuple):
    """One object found in an image.

    ``score`` is the detector's, ``confidence`` the object map's (equal to the score until a map has seen it).
    ``location`` is ``None`` where the object could not be placed in the world, ``box`` where it comes from an object
    map and not from this image.
    """

    label: str
    score: float
    box: Box | None
    location: Location | None
    confidence: float
    method: str = "unknown"

    def with_confidence(self, confidence: float) -> Detection:
        return Detection(self.label, self.score, self.box, self.location, confidence, self.method)


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


class Detections(NamedTuple):
    """A detector's answer to one image, in the manner of ``autoware_msgs/DetectedObjectArray``."""

    header: Header
    objects: tuple[Detection, ...]
    source: str = "detector"
    served_by: str = ""

    @property
    def size_bytes(self) -> int:
        return ARRAY_BYTES + OBJECT_BYTES * len(self.objects)

    def restamped(self, header: Header) -> Detections:
        return Detections(header, self.objects, self.source, self.served_by)

    def with_objects(self, objects: Sequence[Detection]) -> Detections:
        return Detections(self.header, tuple(objects), self.source, self.served_by)

    def served(self, source: str, by: str) -> Detections:
        """An answer out of an object map stays one, even when a cache replays it: it was never a detection."""
        return Detections(self.header, self.objects, "map" if self.source == "map" else source, by)


class Publish(NamedTuple):
    """Effect: publish ``message`` on ``topic``; ``to`` names one receiver, ``None`` every subscriber."""

    topic: str
    message: Message
    to: str | None = None


class ImageLookup(NamedTuple):
    """The message cache was asked once. ``outcome`` is ``hit``, ``miss`` or ``coalesced``; ``requester`` is ``client``
    (its own network) or ``neighbour`` (another Genie on the edge network)."""

    header: Header
    outcome: str
    requester: str
    entries: int


class MapChange(NamedTuple):
    """A stored object that is new or has been seen again, with its confidence from now on.

    Class and location are those of its first sighting, so they tell which object it is.
    """

    label: str
    location: Location
    confidence: float


class ObjectLookups(NamedTuple):
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


class Expired(NamedTuple):
    """A client's request was forgotten before anybody answered it."""

    header: Header


class Forgotten(NamedTuple):
    """Objects that the map holds no longer, because nobody has seen them for long enough; each as it was last."""

    objects: tuple[MapChange, ...]


Observation = ImageLookup | ObjectLookups | Expired | Forgotten


class Observe(NamedTuple):
    """Effect: an observation for the log."""

    record: Observation


Effect = Publish | Observe
