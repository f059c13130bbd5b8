"""Every metric: its title, unit and meaning, and whether more or less of it is better.

Whatever shows a metric to people, on the terminal, in tables, figures and pages, takes its words
from here. Files and the library name metrics by their ids, the keys of ``METRICS``.
"""

from collections.abc import Sequence
from typing import NamedTuple

from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.text import number_text

DEADLINE_MS = 33.0  # Section V-B of the paper: 30 frames per second
RECENT_MS = 100.0  # a look is recent that is no older: the time between two frames of a camera
RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
WINDOW_REQUESTS = 50  # the paper's error bars of reuse
ZERO_DELAY = "zero_delay"  # as a component: of the detector's own answers without any delay
COMPONENT_TITLES = {ZERO_DELAY: "zero-delay detector"}
LOGARITHMIC_FROM = 20.0  # a list of numbers that spans so much, largest to smallest
UNKNOWN = "-"  # the text of a value that is not defined
LOWER, HIGHER = "lower", "higher"

_FIRST = "from when a frame reaches the queue of its first ROS node to its first answer"
_FRESH = "from when a frame reaches the queue of its first ROS node to its fresh result"
_IN_TIME = f"within {DEADLINE_MS:g} ms"
_VIEW_AGE = (
    "from the newest frame of a frame's view that a detector had looked at when this one came to"
    " this one, where looks are paced"
)
_LOOK_AGE = "from the newest frame in which a detector saw any of a first answer to its own frame"
_PER_S = "per second until the last answer"
_ENERGY = "In brackets: with every power at the lower and the upper end of its range."
_FAULT_PHASE = "before, during or after the first fault that is no hand-over (the component)"
_ATTACKED = "per car since the first attack, at attackers, receivers or others (the component)"
_PROXY = "against the detector's own answer to the same frame (a proxy for the truth)"


class MetricInfo(NamedTuple):
    """What people read of a metric.

    Parameters
    ----------
    title : str
        Its name, the same wherever it is shown.
    unit : str
        As it is shown: ``%`` for shares, which are from 0 to 1 in files; empty without a unit.
    better : str
        ``lower`` or ``higher``; empty where neither is better.
    meaning : str
        What it measures, in one sentence.
    """

    title: str
    unit: str
    better: str
    meaning: str

    @property
    def label(self) -> str:
        """The title with the unit: ``first answer, mean [ms]``."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def factor(self) -> int:
        """What a value in a file is multiplied with to be shown in the unit."""
        return 100 if self.unit == "%" else 1


METRICS: dict[str, MetricInfo] = {
    "first_answer_mean": MetricInfo("first answer, mean", "ms", LOWER, f"Mean time {_FIRST}."),
    "first_answer_p50": MetricInfo("first answer, median", "ms", LOWER, f"Median time {_FIRST}."),
    "first_answer_p95": MetricInfo(
        "first answer, p95", "ms", LOWER, f"95th percentile of the time {_FIRST}."
    ),
    "first_answer_p99": MetricInfo(
        "first answer, p99", "ms", LOWER, f"99th percentile of the time {_FIRST}."
    ),
    "under_deadline_share": MetricInfo(
        f"first answer {_IN_TIME}",
        "%",
        HIGHER,
        f"Share of all published frames with a first answer {_IN_TIME}.",
    ),
    "under_deadline_share_of_answered": MetricInfo(
        f"first answer {_IN_TIME}, of answered frames",
        "%",
        HIGHER,
        f"Share of the answered frames with a first answer {_IN_TIME}.",
    ),
    "first_answer_part": MetricInfo(
        "part of the first answer", "ms", LOWER, f"Mean time that a part takes {_FIRST}."
    ),
    "fresh_answer_mean": MetricInfo("fresh result, mean", "ms", LOWER, f"Mean time {_FRESH}."),
    "fresh_answer_p50": MetricInfo("fresh result, median", "ms", LOWER, f"Median time {_FRESH}."),
    "fresh_answer_p95": MetricInfo(
        "fresh result, p95", "ms", LOWER, f"95th percentile of the time {_FRESH}."
    ),
    "fresh_answer_p99": MetricInfo(
        "fresh result, p99", "ms", LOWER, f"99th percentile of the time {_FRESH}."
    ),
    "fresh_under_deadline_share": MetricInfo(
        f"fresh result {_IN_TIME}",
        "%",
        HIGHER,
        f"Share of all published frames with a fresh result {_IN_TIME}.",
    ),
    "fresh_answer_part": MetricInfo(
        "part of the fresh result", "ms", LOWER, f"Mean time that a part takes {_FRESH}."
    ),
    "answered_share": MetricInfo(
        "frames answered", "%", HIGHER, "Share of all published frames with any answer."
    ),
    "fresh_answered_share": MetricInfo(
        "frames with a fresh result",
        "%",
        HIGHER,
        "Share of all published frames for which a detector looked at this very frame.",
    ),
    "recent_share": MetricInfo(
        "frames with a recent result",
        "%",
        HIGHER,
        f"Share of all published frames with an answer from a look at most {RECENT_MS:g} ms older.",
    ),
    "look_age_mean": MetricInfo("age of look, mean", "ms", LOWER, f"Mean time {_LOOK_AGE}."),
    "look_age_p50": MetricInfo("age of look, median", "ms", LOWER, f"Median time {_LOOK_AGE}."),
    "look_age_p95": MetricInfo(
        "age of look, p95", "ms", LOWER, f"95th percentile of the time {_LOOK_AGE}."
    ),
    "look_age_p99": MetricInfo(
        "age of look, p99", "ms", LOWER, f"99th percentile of the time {_LOOK_AGE}."
    ),
    "looks_own_share": MetricInfo(
        "looks by the car's detector",
        "%",
        "",
        "Share of the published frames that the car's own detector looked at, where looks are"
        " paced.",
    ),
    "looks_sent_share": MetricInfo(
        "looks sent up",
        "%",
        "",
        "Share of the published frames that went up to be looked at by the edge.",
    ),
    "looks_answered_share": MetricInfo(
        "looks answered", "%", HIGHER, "Share of the frames sent up that were answered in time."
    ),
    "looks_stale_share": MetricInfo(
        "looks answered too late",
        "%",
        LOWER,
        "Share of the frames sent up whose answer came too late to count.",
    ),
    "looks_overtaken_share": MetricInfo(
        "looks lost, overtaken",
        "%",
        LOWER,
        "Share of the frames sent up that were lost: a later one was answered first.",
    ),
    "looks_timed_out_share": MetricInfo(
        "looks lost, timed out",
        "%",
        LOWER,
        "Share of the frames sent up that were given up: no answer came in time.",
    ),
    "looks_in_flight_share": MetricInfo(
        "looks in flight",
        "%",
        "",
        "Share of the frames sent up that were neither answered nor given up when the run ended.",
    ),
    "look_round_trip_mean": MetricInfo(
        "round trip of a look, mean",
        "ms",
        LOWER,
        "Mean time from when a frame went up until its answer came, of those that got one before"
        " they were given up.",
    ),
    "view_age_mean": MetricInfo("age of view, mean", "ms", LOWER, f"Mean time {_VIEW_AGE}."),
    "view_age_p50": MetricInfo("age of view, median", "ms", LOWER, f"Median time {_VIEW_AGE}."),
    "view_age_p95": MetricInfo(
        "age of view, p95", "ms", LOWER, f"95th percentile of the time {_VIEW_AGE}."
    ),
    "view_age_p99": MetricInfo(
        "age of view, p99", "ms", LOWER, f"99th percentile of the time {_VIEW_AGE}."
    ),
    "shared_share": MetricInfo(
        "objects that another car saw",
        "%",
        "",
        "Share of the held objects that another car saw last, where looks are paced.",
    ),
    "shared_right_share": MetricInfo(
        "right among objects that another car saw",
        "%",
        HIGHER,
        "Share of the held objects that another car saw last which are in view at that instant.",
    ),
    "empty_answer_share": MetricInfo(
        "frames with an empty first answer",
        "%",
        "",
        "Share of all published frames whose first answer holds no object.",
    ),
    "dropped_share": MetricInfo(
        "frames dropped",
        "%",
        LOWER,
        "Share of all published frames that a queue or a link dropped.",
    ),
    "in_flight_share": MetricInfo(
        "frames in flight", "%", "", "Share of all published frames still unanswered at the end."
    ),
    "fresh_answer_throughput": MetricInfo(
        "throughput of fresh results", "1/s", HIGHER, "Frames that got a fresh result, per second."
    ),
    "frames_published": MetricInfo(
        "published frames", "frames", "", "Frames that cameras published."
    ),
    "frames_answered": MetricInfo("answered frames", "frames", HIGHER, "Frames with any answer."),
    "frames_dropped": MetricInfo(
        "dropped frames", "frames", LOWER, "Frames that a queue or a link dropped."
    ),
    "frames_in_flight": MetricInfo(
        "frames in flight", "frames", "", "Frames still unanswered at the end."
    ),
    "improvement_first_answer": MetricInfo(
        "improvement of the mean first answer",
        "%",
        HIGHER,
        "1 - mean first answer of the method / that of the baseline.",
    ),
    "improvement_fresh_answer": MetricInfo(
        "improvement of the mean fresh result",
        "%",
        HIGHER,
        "1 - mean fresh result of the method / that of the baseline.",
    ),
    "streaming_f1": MetricInfo(
        "streaming F1",
        "%",
        HIGHER,
        "F1 of the objects that the consumer holds at each instant, against those in view then.",
    ),
    "object_precision": MetricInfo(
        "streaming precision",
        "%",
        HIGHER,
        "Share of the held objects that are in view at that instant.",
    ),
    "object_recall": MetricInfo(
        "recall of visible objects",
        "%",
        HIGHER,
        "Share of the objects in view that the consumer holds at that instant.",
    ),
    "object_recall_static": MetricInfo(
        "recall of static objects", "%", HIGHER, "Recall of the visible objects that stand still."
    ),
    "object_recall_moving": MetricInfo(
        "recall of moving objects", "%", HIGHER, "Recall of the visible objects that move."
    ),
    "lap_recall": MetricInfo(
        "recall in a lap", "%", HIGHER, "Recall of visible objects in one lap of the cars' routes."
    ),
    "lap_f1": MetricInfo(
        "streaming F1 in a lap", "%", HIGHER, "Streaming F1 in one lap of the cars' routes."
    ),
    "fault_answered_share": MetricInfo(
        "frames answered around a fault",
        "%",
        HIGHER,
        f"Share of the frames with any answer, {_FAULT_PHASE}.",
    ),
    "fault_fresh_share": MetricInfo(
        "frames with a fresh result around a fault",
        "%",
        HIGHER,
        f"Share of the frames with a fresh result, {_FAULT_PHASE}.",
    ),
    "fault_latency": MetricInfo(
        "first answer around a fault, mean",
        "ms",
        LOWER,
        f"Mean time from a frame's stamp to its first answer, {_FAULT_PHASE}.",
    ),
    "fault_look_age": MetricInfo(
        "age of look around a fault, mean",
        "ms",
        LOWER,
        f"Mean time {_LOOK_AGE}, {_FAULT_PHASE}.",
    ),
    "fault_recall": MetricInfo(
        "recall of visible objects around a fault",
        "%",
        HIGHER,
        f"Share of the visible objects that consumers hold, {_FAULT_PHASE}.",
    ),
    "fault_ghosts": MetricInfo(
        "ghosts around a fault",
        "%",
        LOWER,
        f"Share of the held objects that are not there, {_FAULT_PHASE}.",
    ),
    "fault_recovery": MetricInfo(
        "recovery after a fault",
        "s",
        LOWER,
        "From the end of the first fault to the first half second with 95 % of the share of fresh "
        "results before it.",
    ),
    "poisoned_objects": MetricInfo(
        "poisoned objects held",
        "objects",
        LOWER,
        f"Ghosts where attackers added an object: mean number, {_ATTACKED}.",
    ),
    "suppressed_objects": MetricInfo(
        "suppressed objects",
        "objects",
        LOWER,
        f"Missed objects that attackers left out: mean number, {_ATTACKED}.",
    ),
    "poison_spread": MetricInfo(
        "cars reached by poison",
        "%",
        LOWER,
        "Share of the cars that do not attack which hold poisoned objects for a second or longer.",
    ),
    "poison_exposure": MetricInfo(
        "longest exposure to poison",
        "s",
        LOWER,
        "The longest time for which a car that does not attack holds any poisoned object.",
    ),
    "poison_life": MetricInfo(
        "life of poison",
        "s",
        LOWER,
        "Mean time from the last forged message of an object until no other car holds it.",
    ),
    "ghost_share": MetricInfo(
        "false objects held (ghosts)",
        "%",
        LOWER,
        "Share of the held objects without a true object of their class within 2 m.",
    ),
    "ghost_share_moved_away": MetricInfo(
        "ghosts: moved away", "%", LOWER, "Share of the held objects that were there and left."
    ),
    "ghost_share_never_there": MetricInfo(
        "ghosts: never there", "%", LOWER, "Share of the held objects that never were there."
    ),
    "ghost_share_duplicate": MetricInfo(
        "ghosts: duplicates", "%", LOWER, "Share of the held objects that are held twice."
    ),
    "gospa": MetricInfo(
        "GOSPA", "m", LOWER, "Mean GOSPA distance from the held objects to those in view."
    ),
    "held_age": MetricInfo(
        "age of held objects", "s", LOWER, "Mean time since the held objects were detected."
    ),
    "place_error": MetricInfo(
        "position error", "m", LOWER, "Mean distance of the right held objects to the true ones."
    ),
    **{
        f"{answer}_proxy_{measure}": MetricInfo(
            f"proxy {measure_title}, {answer_title}",
            "%",
            HIGHER,
            f"{measure_title[0].upper() + measure_title[1:]} of the {answer_title}s, {_PROXY}.",
        )
        for answer, answer_title in (("first", "first answer"), ("result", "result"))
        for measure, measure_title in (
            ("precision", "precision"),
            ("recall", "recall"),
            ("f1", "F1"),
        )
    },
    "wrong_hit_share": MetricInfo(
        "wrong cache hits",
        "%",
        LOWER,
        f"Share of the cache hits with an F1 below {RIGHT_F1:.0%} {_PROXY}.",
    ),
    "image_reuse": MetricInfo(
        "image reuse",
        "%",
        HIGHER,
        "Hits / requests of the message caches, asked by their own clients, mean over Genies.",
    ),
    "image_reuse_pooled": MetricInfo(
        "image reuse, pooled", "%", HIGHER, "Hits / requests of all message caches together."
    ),
    "image_reuse_with_neighbours": MetricInfo(
        "image reuse with neighbours",
        "%",
        HIGHER,
        "Image reuse in which the requests of other edges count, too.",
    ),
    "coalesced_share": MetricInfo(
        "coalesced requests",
        "%",
        "",
        "Share of the clients' requests that wait for the answer to an equal pending one.",
    ),
    "object_reuse": MetricInfo(
        "object reuse",
        "%",
        HIGHER,
        "Object look-ups answered by an object with C >= C_T, mean over Genies.",
    ),
    "object_reuse_pooled": MetricInfo(
        "object reuse, pooled",
        "%",
        HIGHER,
        "Object reuse over the look-ups of all Genies together.",
    ),
    "object_reuse_sighting": MetricInfo(
        "object reuse, sightings", "%", HIGHER, "Object reuse in look-ups for detected objects."
    ),
    "object_reuse_boost": MetricInfo(
        "object reuse, boosts", "%", HIGHER, "Object reuse in look-ups for confidence boosts."
    ),
    "confidence_boost": MetricInfo(
        "confidence boost", "", HIGHER, "Mean of C(new) - C(old) over the object maps' updates."
    ),
    "stored_images": MetricInfo(
        "stored images per Genie",
        "",
        "",
        "Entries of a message cache at the end, mean over Genies.",
    ),
    "stored_objects": MetricInfo(
        "stored objects per Genie", "", "", "Objects in a map at the end, mean over Genies."
    ),
    "utilization": MetricInfo(
        "utilization", "%", LOWER, "Share of the time in which a device or link works."
    ),
    "queue_mean": MetricInfo(
        "queue length, mean", "messages", LOWER, "Mean number of messages that wait."
    ),
    "queue_max": MetricInfo(
        "queue length, maximum", "messages", LOWER, "The most messages that wait at a time."
    ),
    "throughput": MetricInfo("throughput", "1/s", "", "Messages completed per second."),
    "completed": MetricInfo(
        "messages completed", "messages", "", "Messages completed until the end."
    ),
    "dropped": MetricInfo("messages dropped", "messages", LOWER, "Messages dropped until the end."),
    "bytes_up_per_frame": MetricInfo(
        "sent up per frame", "B", LOWER, "Bytes that cars sent to their edges per published frame."
    ),
    "bytes_down_per_frame": MetricInfo(
        "sent down per frame", "B", LOWER, "Bytes that edges sent to cars per published frame."
    ),
    "bytes_up_rate": MetricInfo(
        "sent up per second", "B/s", LOWER, f"Bytes that all cars sent to their edges {_PER_S}."
    ),
    "bytes_down_rate": MetricInfo(
        "sent down per second", "B/s", LOWER, f"Bytes that edges sent to all cars {_PER_S}."
    ),
    "accelerator_time": MetricInfo(
        "accelerator time", "s", LOWER, "Time that accelerators worked, summed over them."
    ),
    "cpu_time": MetricInfo("CPU time", "s", LOWER, "Time that CPU cores worked, summed over them."),
    "batch_size": MetricInfo(
        "pictures per batch", "pictures", "", "Mean number of pictures that were detected at once."
    ),
    "energy_per_frame": MetricInfo(
        "energy per frame", "J", LOWER, f"Energy per published frame. {_ENERGY}"
    ),
    "energy_active_per_frame": MetricInfo(
        "energy per frame without idle",
        "J",
        LOWER,
        "Energy per published frame beyond what the computers and ports take when idle.",
    ),
    "energy_per_fresh": MetricInfo(
        "energy per fresh result", "J", LOWER, f"Energy per frame with a fresh result. {_ENERGY}"
    ),
    "energy_per_right": MetricInfo(
        "energy per right object",
        "J",
        LOWER,
        f"Energy per right object that a consumer holds at a frame of its first camera. {_ENERGY}",
    ),
    "bytes": MetricInfo("bytes carried", "B", "", "Bytes that a link carried until the end."),
}


def title_of(metric: str) -> str:
    """A metric's title; the id of one that is not registered."""
    return METRICS[metric].title if metric in METRICS else metric


def component_title(component: str, methods: Sequence[MethodInfo] = ()) -> str:
    """The title of a metric's component: a method, a resource, or the zero-delay detector."""
    titles = COMPONENT_TITLES | {method.name: method.title for method in methods}
    return titles.get(component, component)


def value_text(metric: Metric | None, unit: bool = True, interval: bool = False) -> str:
    """A metric's value to three digits.

    Parameters
    ----------
    metric : Metric or None
        ``None``, or a metric whose value is ``None``, is not defined.
    unit : bool
        Whether its unit follows.
    interval : bool
        Whether its interval follows in brackets, where it has one.
    """
    if metric is None or metric.value is None:
        return UNKNOWN
    info = METRICS[metric.metric]
    text = number_text(info.factor * metric.value)
    if unit:
        text = f"{text} {info.unit}".rstrip()
    if interval and metric.low is not None and metric.high is not None:
        low, high = (number_text(info.factor * end) for end in (metric.low, metric.high))
        text = f"{text} ({low} to {high})"
    return text


def spans_much(numbers: Sequence[float]) -> bool:
    """Whether a list of numbers is better drawn on a logarithmic axis."""
    return bool(numbers) and min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def is_drawn_logarithmically(metric: str, numbers: Sequence[float]) -> bool:
    """Whether an axis of a metric is logarithmic with these values on it; one of shares never
    is.
    """
    return METRICS[metric].unit != "%" and spans_much(numbers)
