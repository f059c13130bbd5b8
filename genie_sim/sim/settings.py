"""The settings of a simulation: who drives where (edges, cars with their cameras, links and
routes), and what methods may have otherwise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

from genie_sim.base import units
from genie_sim.base.marks import (
    Bounds,
    Count,
    Name,
    NotEmpty,
    Short,
)
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError, check_unique
from genie_sim.core.messages import Encoding, Frame
from genie_sim.core.rules import GenieRules
from genie_sim.sim.link_model import LINK, usual_link
from genie_sim.tracks.consumer import ConsumerRules

EDGES = "edges"  # the network between edges, in the names of links
ALL = "*"  # whoever hears a broadcast, in the names of links


@dataclass(frozen=True)
class Camera:
    """One stream of a car: which recording stands for it, at which phase, and how large its images
    are.
    """

    name: Name
    """Name of the stream and its topic."""

    recording: Name
    """The camera of the recording that stands for this stream."""

    phase_ns: int = 0
    """How much later than the recording the stream takes its pictures."""

    size_bytes: Annotated[int, Bounds(above=0)] | None = None
    """Bytes of an image; by default those of a raw `sensor_msgs/Image` of the recorded
    resolution."""

    rate: Annotated[float, units.FRAME_RATE, Bounds(above=0)] | None = None
    """How many pictures a second it takes: of the recorded ones those nearest to its times. By
    default all are taken; more than were recorded cannot be."""


# KITTI's two colour and two grey cameras at 10 Hz, at staggered phases. The grey ones are not
# recorded: a colour one stands for each, with the size of a mono8 image, a third of the bytes.
FOUR_CAMERAS = (
    Camera("camera_02", "02"),
    Camera("camera_03", "03", phase_ns=25 * units.NS_PER_MS),
    Camera("camera_00", "02", phase_ns=50 * units.NS_PER_MS, size_bytes=465_800),
    Camera("camera_01", "03", phase_ns=75 * units.NS_PER_MS, size_bytes=465_800),
)


@dataclass(frozen=True, kw_only=True)
class Serving:
    """How an edge's detector serves pictures: as the dynamic batcher of an inference server."""

    batch: Annotated[int, Bounds(minimum=1, maximum=1024)] = 1
    """The most pictures that the detector takes at once. How long so many take is in the device
    profile."""

    wait_ns: int = 0
    """How long the oldest waiting picture waits for a full batch when the detector is idle."""

    queue: Literal["shared", "per_camera"] = "shared"
    """Where pictures wait: all in one queue of `queue_length`, or each camera's in one of its
    own."""


@dataclass(frozen=True)
class Edge:
    """An edge server."""

    name: Name
    """The edge's name in every table."""

    device: str
    """A device profile by name or path."""

    neighbours: tuple[Name, ...] | None = None
    """The edges that it shares with; by default as `edge_neighbours` says."""

    serving: Serving | None = None
    """How its detector serves pictures; by default as the scenario's `serving` says."""

    at_m: tuple[Annotated[float, Bounds()], Annotated[float, Bounds()]] | None = None
    """Where the edge's antenna stands: east and north in the scenario's frame, such as `[40 m,
    -12 m]`. A link model with path loss needs it."""


@dataclass(frozen=True)
class Route:
    """Which part of a drive a car replays, when, and how often."""

    trace: str | None = None
    """A trace of its own, for two drives in one scenario; by default that of `perception`."""

    window_ns: tuple[int, int] | None = None
    """The part of the drive, such as `[0 s, 9.2 s]`; by default all of it."""

    start_ns: int = 0
    """When the car starts."""

    laps: Count = 1
    """How often the car drives its window."""

    pause_ns: int = units.NS_PER_S
    """Pause between two laps."""

    def __post_init__(self) -> None:
        if self.window_ns is not None and self.window_ns[0] >= self.window_ns[1]:
            raise SettingError("window", "must be [begin, end] with begin before end")

    def window_of(self, frames: Sequence[Frame]) -> tuple[int, int]:
        """From when until when [ns] it replays the frames of a recording."""
        return self.window_ns or (frames[0].stamp_ns, frames[-1].stamp_ns + 1)


@dataclass(frozen=True)
class Car:
    """A car with its computer and its link to its edge (both ``None`` for a car on its own)."""

    name: Name
    """The car's name in every table."""

    device: str
    """A device profile by name or path."""

    edge: str | None = None
    """The edge that it uploads to; `null` for a car without one."""

    link: Annotated[Choice, LINK] | None = None
    """Its link to the edge, with the settings of `edge_network`. By default Ethernet, as in the
    paper's set-up."""

    route: Route = Route()
    """Which part of a drive it replays, and when."""

    cameras: bool | Annotated[tuple[Camera, ...], NotEmpty()] = True
    """`true` for the scenario's cameras, or a list of the car's own. With `false` the car has no
    detector either: it sends requests with its position and gets what others have seen (Section V.F
    of the paper)."""

    genie: bool = True
    """Whether the car's nodes, and its edge's nodes that serve it, are wrapped by Genies, where a
    method uses them."""

    def __post_init__(self) -> None:
        if self.edge is None and self.link is not None:
            raise SettingError("link", "leads nowhere: the car has no 'edge'")
        if self.edge is not None and self.link is None:
            object.__setattr__(self, "link", usual_link())
        if not self.cameras and (self.edge is None or not self.genie):
            raise SettingError(
                "cameras",
                "a car without cameras needs an 'edge' and 'genie: true', or nobody answers it",
            )
        if isinstance(self.cameras, tuple):
            check_unique("cameras", [camera.name for camera in self.cameras], ".name")

    def streams(self, usual: Sequence[Camera]) -> Sequence[Camera]:
        """Its own cameras, or the ``usual`` ones. Without cameras, it knows its position whenever
        one of those would take a frame.
        """
        return self.cameras if isinstance(self.cameras, tuple) else usual


@dataclass(frozen=True, kw_only=True)
class MethodSettings:
    """The settings that a method of a scenario may have otherwise. Who drives where, and what
    cameras see, is the same for all.
    """

    model: str = "autoware_vision_detector"
    """The detector whose service times are used. Every device in the scenario must know it."""

    spread: Literal["isolated", "default", "loaded"] = "default"
    """Which service-time distribution of the device profiles is used: that of a node alone on its
    computer, of a node under usual load, or of one on a loaded computer."""

    queue_length: Count = 1
    """Messages that a topic holds while its subscriber is busy; when it is full the oldest is
    dropped. The default is what Autoware's detectors subscribe with."""

    consumer: Annotated[ConsumerRules, Short(("newest", "tracker"))] = field(
        default_factory=ConsumerRules
    )
    """What the car does with answers: hold the newest one of each stream, or track objects and
    predict between answers."""

    image_encoding: Encoding = "raw"
    """How pictures are sent over links: raw, or encoded. Sizes, encoding and decoding times were
    measured on the recorded frames; the edge's detector finds what it found in the decoded
    pictures."""

    edge_network: Annotated[Choice, LINK] = field(default_factory=usual_link)
    """The network between edges: a link's name, or a mapping with the settings below. The same
    settings apply to the `link` of a car or a fleet."""

    edge_neighbours: Count | None = None
    """With how many of the nearest edges each edge shares at least, where it does not name its own
    (`edges[].neighbours`). By default up to six edges all share with each other, and of more each
    with the four nearest."""

    serving: Serving = Serving()
    """How the detectors of edges serve pictures: one by one, or in batches."""

    genie: Annotated[GenieRules, Short(("literal",))] = field(default_factory=GenieRules)
    """How the paper's algorithms are read."""
