"""All that code of your own imports: ``from genie_sim.extend import Fault``.

A method, a link, a fault, a process, a metric, a source of frames, a detector, an eviction, a
similarity: each is a class of yours that a scenario names as ``package.module:Class``, and each has
a page under *Extend it*. The names below stay where they are while the package changes inside.
"""

# Times are whole nanoseconds, sizes bytes, places metres; a setting's unit is in its name.
from genie_sim.analysis.correctness import HITS, is_wrong
from genie_sim.analysis.frame_metrics import response_ms
from genie_sim.analysis.metric import HIGHER, LOWER, Metric, Sample, mean, share
from genie_sim.analysis.statistics import Measured
from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.geometry import Array, Geodetic, rigid, transform
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_bytes
from genie_sim.base.plugins import Choice
from genie_sim.base.progress import Progress
from genie_sim.base.seeds import Draws
from genie_sim.base.settings import Bounds, Share
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.eviction import LRU, Eviction
from genie_sim.core.messages import (
    Answer,
    CameraPose,
    Detection,
    Detections,
    Effect,
    Expired,
    Header,
    Image,
    ImageLookup,
    Look,
    Message,
    Observation,
    Publish,
)
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import KeyIndex, Similarity
from genie_sim.core.view import ViewSector
from genie_sim.data.detectors.detector import (
    DETECTORS,
    DetectedBox,
    DetectorSettings,
    ImageDetector,
    detector_facts,
    look,
)
from genie_sim.data.detectors.placement import Placement
from genie_sim.data.encoding import difference_hash
from genie_sim.data.frame_source import Drive, Frames, FrameSource
from genie_sim.data.geodesy import enu_SE3_enu
from genie_sim.data.importers.table_import import ImportedCar, Sensor, cars_of_tables, write_cars
from genie_sim.data.importers.trace_import import (
    detection,
    picture_frame,
    placed,
    scan_frame,
    tell_network,
    traces,
    write_told,
)
from genie_sim.data.kitti.number_files import lines, within
from genie_sim.data.kitti.perceive import FrameSelection, perceive
from genie_sim.data.trace import Trace, TraceFrame, write_trace
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import (
    Replay,
    SimilarityCache,
    SimilarityCaching,
    same,
)
from genie_sim.recommended.pacing import Pacer, RoundTrip
from genie_sim.record.columns import Columns
from genie_sim.sim.bends import Bend, Objects, bent, shifted
from genie_sim.sim.clock import Occupancy, Steps
from genie_sim.sim.draw_keys import frame_key
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.link_model import LINK, LinkEnds, Sender
from genie_sim.sim.message_random import MessageRandom
from genie_sim.sim.method import (
    LOCAL,
    REMOTE,
    REMOTE_UPLINK,
    HostConfig,
    HostContext,
    Interceptor,
    LocalAndRemote,
    Method,
    Uplink,
)
from genie_sim.sim.network import Network
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.existence import Existence
from genie_sim.tracks.track import COAST_NS, PERSON, kind_of
from genie_sim.tracks.track_map import TrackMap

__all__ = [
    "COAST_NS",
    "DETECTORS",
    "HIGHER",
    "HITS",
    "LINK",
    "LOCAL",
    "LOWER",
    "LRU",
    "NS_PER_MS",
    "NS_PER_S",
    "PERSON",
    "REMOTE",
    "REMOTE_UPLINK",
    "Answer",
    "Array",
    "Bend",
    "Bounds",
    "CameraPose",
    "Capacity",
    "Choice",
    "Columns",
    "DetectedBox",
    "Detection",
    "Detections",
    "DetectorSettings",
    "Draws",
    "Drive",
    "Effect",
    "Eviction",
    "Existence",
    "Expired",
    "Fault",
    "FeatureKey",
    "FrameSelection",
    "FrameSource",
    "Frames",
    "Geodetic",
    "Graph",
    "Header",
    "HostConfig",
    "HostContext",
    "Image",
    "ImageDetector",
    "ImageLookup",
    "ImportReport",
    "ImportedCar",
    "Interceptor",
    "KeyIndex",
    "LinkEnds",
    "LocalAndRemote",
    "Look",
    "Measured",
    "Message",
    "MessageRandom",
    "Method",
    "Metric",
    "Network",
    "Objects",
    "Observation",
    "Occupancy",
    "Pacer",
    "Placement",
    "Progress",
    "Publish",
    "Replay",
    "RoundTrip",
    "Sample",
    "Sender",
    "Sensor",
    "Share",
    "Similarity",
    "SimilarityCache",
    "SimilarityCaching",
    "Steps",
    "Strike",
    "Subscriber",
    "Trace",
    "TraceFrame",
    "TrackMap",
    "Uplink",
    "UserError",
    "ViewSector",
    "Viewer",
    "as_user_error",
    "bent",
    "cars_of_tables",
    "detection",
    "detector_facts",
    "difference_hash",
    "enu_SE3_enu",
    "frame_key",
    "is_wrong",
    "kind_of",
    "lines",
    "look",
    "mean",
    "perceive",
    "picture_frame",
    "placed",
    "read_bytes",
    "response_ms",
    "rigid",
    "same",
    "scan_frame",
    "share",
    "shifted",
    "tell_network",
    "traces",
    "transform",
    "unknown",
    "within",
    "write_cars",
    "write_told",
    "write_trace",
]
