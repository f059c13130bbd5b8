"""All that code of your own imports: ``from genie_sim.extend import Fault``.

A method, a link, a fault, a process, a metric, a source of frames, a detector, an eviction, a
similarity: each is a class of yours that a scenario names as ``package.module:Class``, and each has
a page under *Extend it*. The names below, by what one writes, stay where they are while the package
changes inside. Times are whole nanoseconds, sizes bytes, places metres; a setting's unit is in its
name.
"""

# ruff: noqa: I001, RUF022  (in the order of what one writes)

# Messages and what is in them: what every class gets or makes.
from genie_sim.core.messages import (
    Message,
    Header,
    CameraPose,
    Image,
    Answer,
    Detections,
    Detection,
    Look,
    Effect,
    Publish,
    Observation,
    ImageLookup,
    Expired,
)

# A method: what runs on cars and edges.
from genie_sim.sim.method import (
    Method,
    HostContext,
    HostConfig,
    Interceptor,
    LocalAndRemote,
    UplinkTopics,
    LOCAL,
    REMOTE,
    REMOTE_UPLINK,
)

# A cache of its own: keys, eviction, similar images.
from genie_sim.core.similarity import Similarity, KeyIndex
from genie_sim.core.eviction import Eviction, LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import Replay, SimilarityCache, SimilarityCaching, are_same

# Looks: when they go up, and a map that tracks what they show.
from genie_sim.recommended.pacing import Pacer, RoundTrip
from genie_sim.tracks.track_map import TrackMap
from genie_sim.tracks.existence import Existence
from genie_sim.tracks.coverage import Viewer
from genie_sim.core.view import ViewSector
from genie_sim.tracks.track import kind_of, PERSON, COAST_NS

# A link: how long a message takes.
from genie_sim.sim.link_model import LinkModel, LinkEnds, Sender, TimedSender, LINK
from genie_sim.sim.message_random import MessageRandom
from genie_sim.base.plugins import Choice

# A fault or another process: what happens to hosts, links and messages.
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network
from genie_sim.sim.bends import Bend, Objects, bent, shifted

# What both are made of: ROS graphs, time, random numbers.
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.clock import Steps, Occupancy
from genie_sim.base.seeds import Draws
from genie_sim.sim.draw_keys import frame_key

# A metric: a number of a run.
from genie_sim.analysis.metric import Metric, Sample, HIGHER, LOWER, mean_of, share_of
from genie_sim.analysis.statistics import Estimate
from genie_sim.record.columns import Columns
from genie_sim.analysis.correctness import HITS, is_wrong
from genie_sim.analysis.frame_metrics import response_ms

# A source of frames.
from genie_sim.data.frame_source import FrameSource, Frames, Drive

# A detector, and traces of what it finds.
from genie_sim.data.detectors.detector import (
    DetectedBox,
    DetectorSettings,
    DETECTORS,
    ImageDetector,
    detector_facts,
    look,
)
from genie_sim.data.detectors.placement import Placement
from genie_sim.data.kitti.perceive import FrameSelection, perceive
from genie_sim.data.trace import Trace, TraceFrame, write_trace

# An importer of recordings: tables, pictures, scans, places.
from genie_sim.base.import_report import ImportReport
from genie_sim.base.progress import Progress
from genie_sim.data.importers.table_import import ImportedCar, Sensor, cars_of_tables, write_cars
from genie_sim.data.importers.trace_import import (
    traces,
    picture_frame,
    scan_frame,
    detection,
    placed,
    tell_network,
    write_told,
)
from genie_sim.data.encoding import difference_hash
from genie_sim.base.paths import read_bytes
from genie_sim.data.kitti.number_files import numbered_lines, are_plausible
from genie_sim.base.geometry import Array, Geodetic, rigid, transform
from genie_sim.data.geodesy import enu_SE3_enu

# Settings, units and errors, for all of them.
from genie_sim.base.settings import Bounds, Share
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.base.errors import UserError, as_user_error, unknown

__all__ = [
    # Messages and what is in them: what every class gets or makes.
    "Message",
    "Header",
    "CameraPose",
    "Image",
    "Answer",
    "Detections",
    "Detection",
    "Look",
    "Effect",
    "Publish",
    "Observation",
    "ImageLookup",
    "Expired",
    # A method: what runs on cars and edges.
    "Method",
    "HostContext",
    "HostConfig",
    "Interceptor",
    "LocalAndRemote",
    "UplinkTopics",
    "LOCAL",
    "REMOTE",
    "REMOTE_UPLINK",
    # A cache of its own: keys, eviction, similar images.
    "Similarity",
    "KeyIndex",
    "Eviction",
    "LRU",
    "Capacity",
    "FeatureKey",
    "Replay",
    "SimilarityCache",
    "SimilarityCaching",
    "are_same",
    # Looks: when they go up, and a map that tracks what they show.
    "Pacer",
    "RoundTrip",
    "TrackMap",
    "Existence",
    "Viewer",
    "ViewSector",
    "kind_of",
    "PERSON",
    "COAST_NS",
    # A link: how long a message takes.
    "LinkModel",
    "LinkEnds",
    "Sender",
    "TimedSender",
    "MessageRandom",
    "LINK",
    "Choice",
    # A fault or another process: what happens to hosts, links and messages.
    "Fault",
    "Strike",
    "Network",
    "Bend",
    "Objects",
    "bent",
    "shifted",
    # What both are made of: ROS graphs, time, random numbers.
    "Graph",
    "Subscriber",
    "Steps",
    "Occupancy",
    "Draws",
    "frame_key",
    # A metric: a number of a run.
    "Metric",
    "Sample",
    "Estimate",
    "Columns",
    "HIGHER",
    "LOWER",
    "HITS",
    "mean_of",
    "share_of",
    "is_wrong",
    "response_ms",
    # A source of frames.
    "FrameSource",
    "Frames",
    "Drive",
    # A detector, and traces of what it finds.
    "DetectedBox",
    "DetectorSettings",
    "DETECTORS",
    "ImageDetector",
    "detector_facts",
    "look",
    "Placement",
    "FrameSelection",
    "perceive",
    "Trace",
    "TraceFrame",
    "write_trace",
    # An importer of recordings: tables, pictures, scans, places.
    "ImportReport",
    "Progress",
    "ImportedCar",
    "Sensor",
    "cars_of_tables",
    "write_cars",
    "traces",
    "picture_frame",
    "scan_frame",
    "detection",
    "placed",
    "tell_network",
    "write_told",
    "difference_hash",
    "read_bytes",
    "numbered_lines",
    "are_plausible",
    "Array",
    "Geodetic",
    "rigid",
    "transform",
    "enu_SE3_enu",
    # Settings, units and errors, for all of them.
    "Bounds",
    "Share",
    "NS_PER_MS",
    "NS_PER_S",
    "UserError",
    "as_user_error",
    "unknown",
]
