"""What an attached Genie is told: which topics it takes over and how. Passed to its process as JSON."""

import json
from collections.abc import Callable, Hashable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from pydantic import TypeAdapter

from genie_sim import plugins
from genie_sim.core.freshness import FRESHNESS, MUST_HAVE
from genie_sim.core.genies import make_genie
from genie_sim.core.rules import GenieRules
from genie_sim.core.similarity import SIMILARITIES
from genie_sim.errors import UserError, unknown
from genie_sim.messages import Forgotten, Observation
from genie_sim.ros.codec import Codec, WireType
from genie_sim.ros.gateway import LOCAL, REMOTE, Gateway, Links
from genie_sim.ros.message import RosMessage
from genie_sim.scenario.genie import read_genie

# Where a robot is at stake: equal bytes only, and nothing that the node says is withheld. A scenario's settings win.
DEFAULTS: dict[str, Any] = {"similarity": "exact", "fresh_objects": "all"}
ROLES = ("car", "edge")


@dataclass(frozen=True)
class Plan:
    """``requests`` and ``answers`` are T_S and T_P as far as the Genie takes them over; ``types`` what is known.

    ``settings`` are a scenario's ``genie:`` mapping. ``pose_topic`` (PoseStamped or Odometry) says where the camera
    is, ``horizontal_fov_rad`` how wide it sees. Links: this Genie listens at ``host:port`` and connects to
    ``name@host:port``; ``key_file`` proves who it is (``genie-sim keys``). ``record`` names a file for every look-up,
    one JSON object a line.
    """

    node: str
    name: str
    role: str
    requests: tuple[str, ...]
    answers: tuple[str, ...]
    types: dict[str, WireType] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    pose_topic: str | None = None
    horizontal_fov_rad: float = 0.0
    listen: str | None = None
    connect: tuple[str, ...] = ()
    key_file: str | None = None
    record: str | None = None

    def to_json(self) -> str:
        return TypeAdapter(Plan).dump_json(self).decode()

    @classmethod
    def from_json(cls, text: str) -> "Plan":
        return TypeAdapter(Plan).validate_json(text)


def checked_settings(settings: Mapping[str, Any], pose_topic: str | None) -> GenieRules:
    """The settings of a Genie in real ROS. Raises UserError naming the field."""
    genie = read_genie({**DEFAULTS, **settings})
    if genie.similarity.name == "pose_grid" and pose_topic is None:
        raise UserError(
            "genie: similarity: pose_grid needs to know where the camera is: name a pose topic"
        )
    freshness = genie.object_map.freshness.name
    if plugins.resolve("freshness policy", freshness, FRESHNESS, MUST_HAVE).tracks:
        known = ", ".join(name for name, policy in FRESHNESS.items() if not policy.tracks)
        raise UserError(
            f"genie: object_map.freshness: {freshness!r} tracks, which ROS messages cannot carry; {known}"
        )
    return genie


def check(plan: Plan) -> None:
    """Raises UserError for what can be known to be wrong before anything is touched."""
    checked_settings(plan.settings, plan.pose_topic)
    if plan.role not in ROLES:
        raise UserError(unknown("role", plan.role, ROLES))
    if (plan.listen or plan.connect) and plan.key_file is None:
        raise UserError(
            "link: a link to another Genie needs a key file: genie-sim keys peer NAME --role ROLE"
        )
    if plan.listen and plan.role == "car":
        raise UserError("link: a car connects to its edge and does not listen")


def make_gateway(
    plan: Plan, publish: Callable[[str, RosMessage], None], observe: Callable[[Observation, int], None], links: Links,
    object_codec: Codec | None,
) -> Gateway:  # fmt: skip
    """The Genie of a plan, in its gateway. ``object_codec`` makes answers out of map objects, if answers hold any."""
    settings = checked_settings(plan.settings, plan.pose_topic)
    middleware: dict[str, Any] = {"suffixes": (LOCAL, REMOTE), "map_answer": None}
    if settings.similarity.name == "pose_grid":
        middleware["key"] = _posed(SIMILARITIES["pose_grid"](**settings.similarity.parameters).key)
    if object_codec is not None and plan.pose_topic is not None:
        middleware["map_answer"] = lambda header, objects: RosMessage(
            header, b"", object_codec, objects=tuple(objects), source="map"
        )
    alone = not plan.connect and plan.role == "car"
    genie = make_genie(
        settings,
        plan.name,
        plan.requests,
        plan.answers,
        on_edge=plan.role == "edge",
        alone=alone,
        **middleware,
    )
    if middleware["map_answer"] is None and genie.rules.miss_policy == "immediate":
        genie.rules = replace(
            genie.rules, miss_policy="blocking"
        )  # there is no map to answer from meanwhile
    return Gateway(genie, plan.role, plan.requests, plan.answers, publish, observe, links)


class Recorder:
    """Writes every record as a line of JSON."""

    def __init__(self, path: str | None) -> None:
        self._file = open(path, "a", buffering=1, encoding="utf-8") if path else None  # noqa: PTH123, SIM115

    def __call__(self, record: Observation, now_ns: int) -> None:
        if self._file is not None:
            line = {"t_ns": now_ns, "record": type(record).__name__, **asdict(record)}
            if not isinstance(record, Forgotten):
                line["header"] = record.header._asdict()
            self._file.write(json.dumps(line) + "\n")


def _posed(key: Callable[[Any], Hashable]) -> Callable[[RosMessage], Hashable]:
    """A message whose camera pose is unknown equals no other."""
    return lambda message: ("no pose", message.header) if message.pose is None else key(message)
