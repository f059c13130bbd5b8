"""All that code of your own imports: ``from genie_sim.extend import Fault``.

A method, a link, a fault, a process, a metric, a source of frames, a detector, an eviction, a
similarity: each is a class of yours that a scenario names as ``package.module:Class``, and each has
a page under *Extend it*. The names below, by what one writes, stay where they are while the package
changes inside. Times are whole nanoseconds, sizes bytes, places metres; a setting's unit is in its
name.
"""

# ruff: noqa: I001  (in the order of what one writes; "as" says that a name is offered here)

# Messages and what is in them: what every class gets or makes.
from genie_sim.core.messages import (
    Message as Message,
    Header as Header,
    CameraPose as CameraPose,
    Image as Image,
    Answer as Answer,
    Detections as Detections,
    Detection as Detection,
    Look as Look,
    Effect as Effect,
    Publish as Publish,
    Observation as Observation,
    ImageLookup as ImageLookup,
    Expired as Expired,
    Forgotten as Forgotten,
)

# A method: what runs on cars and edges.
from genie_sim.sim.method import (
    Method as Method,
    HostContext as HostContext,
    HostConfig as HostConfig,
    Costs as Costs,
    Interceptor as Interceptor,
    LocalAndRemote as LocalAndRemote,
    UplinkTopics as UplinkTopics,
    IMAGES as IMAGES,
    OBJECTS as OBJECTS,
    LOCAL as LOCAL,
    REMOTE as REMOTE,
    DIRECT_UPLINK as DIRECT_UPLINK,
    REMOTE_UPLINK as REMOTE_UPLINK,
)

# Genie itself: Algorithm 1 with its settings, as a car's or an edge's.
from genie_sim.methods.genie import Genie as Genie
from genie_sim.core.node import GenieNode as GenieNode
from genie_sim.core.rules import GenieRules as GenieRules
from genie_sim.core.genies import (
    make_genie as make_genie,
    rules_on_car as rules_on_car,
    rules_on_edge as rules_on_edge,
)

# A cache of its own: keys, eviction, similar images.
from genie_sim.core.similarity import (
    Similarity as Similarity,
    KeyIndex as KeyIndex,
)
from genie_sim.core.eviction import (
    Eviction as Eviction,
    LRU as LRU,
)
from genie_sim.core.rules import Capacity as Capacity
from genie_sim.methods.nearest import FeatureKey as FeatureKey
from genie_sim.methods.similarity_cache import (
    Replay as Replay,
    SimilarityCache as SimilarityCache,
    SimilarityCaching as SimilarityCaching,
    are_same as are_same,
)

# Looks: when they go up, and a map that tracks what they show.
from genie_sim.recommended.pacing import (
    Pacer as Pacer,
    RoundTrip as RoundTrip,
)
from genie_sim.tracks.track_map import TrackMap as TrackMap
from genie_sim.tracks.existence import ExistenceFilter as ExistenceFilter
from genie_sim.tracks.coverage import Viewer as Viewer
from genie_sim.core.view import ViewSector as ViewSector
from genie_sim.tracks.track import (
    kind_of as kind_of,
    PERSON as PERSON,
    COAST_NS as COAST_NS,
)

# A link: how long a message takes.
from genie_sim.sim.link_model import (
    LinkModel as LinkModel,
    LinkEnds as LinkEnds,
    Transmitter as Transmitter,
    TimedTransmitter as TimedTransmitter,
    LINK as LINK,
)
from genie_sim.sim.message_random import MessageRandom as MessageRandom
from genie_sim.base.plugins import Choice as Choice

# A fault or another process: what happens to hosts, links and messages.
from genie_sim.sim.fault import (
    Fault as Fault,
    Strike as Strike,
)
from genie_sim.sim.network import Network as Network
from genie_sim.sim.bends import (
    Bend as Bend,
    shifted as shifted,
)
from genie_sim.sim.content import (
    Objects as Objects,
    bent as bent,
)

# What both are made of: ROS graphs, time, random numbers.
from genie_sim.sim.ros_graph import (
    Graph as Graph,
    Subscriber as Subscriber,
)
from genie_sim.sim.clock import (
    Steps as Steps,
    Occupancy as Occupancy,
)
from genie_sim.base.seeds import Draws as Draws
from genie_sim.sim.draw_keys import frame_key as frame_key

# A metric: a number of a run.
from genie_sim.analysis.metric import (
    Metric as Metric,
    Sample as Sample,
    HIGHER as HIGHER,
    LOWER as LOWER,
    mean_of as mean_of,
    share_of as share_of,
)
from genie_sim.analysis.statistics import Estimate as Estimate
from genie_sim.record.columns import Columns as Columns
from genie_sim.analysis.correctness import (
    HITS as HITS,
    is_wrong as is_wrong,
)
from genie_sim.analysis.frame_metrics import response_ms as response_ms

# A source of frames.
from genie_sim.data.frame_source import (
    FrameSource as FrameSource,
    Drives as Drives,
    Drive as Drive,
)

# A detector, and traces of what it finds.
from genie_sim.data.detectors.boxes import DetectedBox as DetectedBox
from genie_sim.data.detectors.detector import (
    DetectorSettings as DetectorSettings,
    DETECTORS as DETECTORS,
    detector_facts as detector_facts,
)
from genie_sim.data.detectors.image_detector import (
    FeatureDetector as FeatureDetector,
    ImageDetector as ImageDetector,
    TellingDetector as TellingDetector,
    ThreadedDetector as ThreadedDetector,
    look as look,
    tell_network as tell_network,
)
from genie_sim.data.detectors.placement import (
    Placement as Placement,
    Plane as Plane,
    fit_ground as fit_ground,
)
from genie_sim.data.kitti.perceive import (
    FrameSelection as FrameSelection,
    perceive as perceive,
)
from genie_sim.data.trace import (
    Trace as Trace,
    TraceFrame as TraceFrame,
    write_trace as write_trace,
)

# An importer of recordings: tables, pictures, scans, places, what was there.
from genie_sim.base.import_report import ImportReport as ImportReport
from genie_sim.base.progress import Progress as Progress
from genie_sim.data.table_import import (
    Sensor as Sensor,
    cars_of_tables as cars_of_tables,
)
from genie_sim.data.intake import (
    ImportedCar as ImportedCar,
    traces as traces,
    write_cars as write_cars,
    write_told as write_told,
)
from genie_sim.data.reader_frames import (
    picture_frame as picture_frame,
    scan_frame as scan_frame,
    new_detection as new_detection,
    placed as placed,
)
from genie_sim.data.encoding import (
    Picture as Picture,
    picture_of as picture_of,
)
from genie_sim.data.truth import TruthObject as TruthObject
from genie_sim.base.paths import read_bytes as read_bytes
from genie_sim.data.kitti.number_files import (
    numbered_lines as numbered_lines,
    are_plausible as are_plausible,
)
from genie_sim.base.geometry import (
    Array as Array,
    Geodetic as Geodetic,
    rigid as rigid,
    transform as transform,
)
from genie_sim.data.geodesy import enu_SE3_enu as enu_SE3_enu

# Settings, units and errors, for all of them.
from genie_sim.base.marks import Bounds as Bounds, Share as Share
from genie_sim.base.units import (
    NS_PER_MS as NS_PER_MS,
    NS_PER_S as NS_PER_S,
)
from genie_sim.base.errors import (
    UserError as UserError,
    as_user_error as as_user_error,
    unknown as unknown,
)
