"""The plan of an attached Genie: which topics it takes over and how. Its process reads JSON."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import from_plain
from genie_sim.core.genies import make_genie, rules_on_car, rules_on_edge
from genie_sim.core.messages import Observation
from genie_sim.core.rules import GenieRules
from genie_sim.recommended.method import Recommended
from genie_sim.recommended.shared_tracks import SharingRules
from genie_sim_ros.codec import Codec, WireType
from genie_sim_ros.gateway import LOCAL, REMOTE, AnyGenie, Gateway, Peer, PeerLinks
from genie_sim_ros.keys import check_keys
from genie_sim_ros.looks import EdgeRelay
from genie_sim_ros.message import RosMessage

# For the safety of the robot: equal bytes only, and nothing that the node says is withheld. The
# user's settings come first.
DEFAULTS: dict[str, Any] = {"similarity": "exact", "fresh_objects": "all"}
ROLES = ("car", "edge")
# a name without a dot: no public authority, which Zenoh trusts as well, certifies one
NAME = re.compile("[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
_ADDRESS = re.compile(r"[^\s#?/;]*:[0-9]{1,5}", re.ASCII)
MAX_PORT = 65535


@dataclass(frozen=True)
class AttachPlan:
    """What an attached Genie needs to know.

    Parameters
    ----------
    node : str
        The node in front of which the Genie stands.
    name, role : str
        What other Genies call this one; ``car`` or ``edge``.
    requests, answers : tuple of str
        The topics of T_S and T_P that the Genie takes over.
    types : dict
        The types of these topics, as far as they are known.
    settings : dict
        A scenario's ``genie:`` mapping.
    pose_topic : str, optional
        Says where the camera is (PoseStamped or Odometry).
    horizontal_fov_rad : float
        How wide the camera sees.
    listen : str, optional
        ``host:port`` at which other Genies connect.
    cars, edges : tuple of str
        The names of the Genies that may connect there.
    connect : tuple of str
        ``name@host:port`` of the edges to connect to.
    keys : str, optional
        A folder with the key that shows who this Genie is.
    record : str, optional
        A file for every look-up, one JSON object a line.
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
    cars: tuple[str, ...] = ()
    edges: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    keys: str | None = None
    record: str | None = None

    def to_json(self) -> str:
        """What ``from_json`` reads."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "AttachPlan":
        """The plan that ``to_json`` wrote."""
        data = json.loads(text)
        data["types"] = {topic: WireType(*parts) for topic, parts in data["types"].items()}
        for key in ("requests", "answers", "cars", "edges", "connect"):
            data[key] = tuple(data[key])
        return cls(**data)

    def has_links(self) -> bool:
        """Whether it is linked to other Genies."""
        return self.listen is not None or bool(self.connect)

    def peers(self) -> dict[str, Peer]:
        """The Genies that it may be linked to, by name."""
        dialled = [address.partition("@")[0] for address in self.connect]
        cars = {name: Peer(name, "car") for name in self.cars}
        return cars | {name: Peer(name, "edge") for name in (*dialled, *self.edges)}


def checked_settings(
    settings: Mapping[str, Any] | str, pose_topic: str | None
) -> GenieRules | Recommended:
    """The settings of a Genie in real ROS: the paper's, or with ``method: recommended`` those of
    that method. Raises UserError naming the field.
    """
    if settings == "recommended":
        settings = {"method": settings}
    given = {} if isinstance(settings, str) else dict(settings)
    method = given.pop("method", "genie")
    if method not in ("genie", "recommended"):
        raise UserError(f"genie: method: {unknown('method', method, ('genie', 'recommended'))}")
    try:
        if method == "recommended":
            return _paced(from_plain(Recommended, given), pose_topic)
        expanded: Any = GenieRules.expand(settings if isinstance(settings, str) else given)
        genie = from_plain(GenieRules, {**DEFAULTS, **expanded})
    except SettingError as error:
        raise UserError(str(error.below("genie"))) from error
    if genie.similarity.name == "pose_grid" and pose_topic is None:
        raise UserError(
            "genie: similarity: pose_grid needs to know where the camera is: name a pose topic"
        )
    return genie


def _paced(settings: Recommended, pose_topic: str | None) -> Recommended:
    """The settings of a Genie that paces its looks. Raises UserError."""
    if pose_topic is None:
        raise UserError("genie: recommended: needs to know where the camera is: name a pose topic")
    if isinstance(settings.sharing, SharingRules):
        raise UserError("genie: sharing: ROS messages cannot carry tracks; write null")
    return settings


def check(plan: AttachPlan) -> None:
    """Raises UserError for what is wrong with a plan, before anything is touched."""
    genie = checked_settings(plan.settings, plan.pose_topic)
    if isinstance(genie, Recommended):
        for name, topics in (("inputs", plan.requests), ("answers", plan.answers)):
            if len(topics) != 1:
                raise UserError(
                    f"genie: recommended: {plan.node} has {len(topics)} {name}"
                    f" ({', '.join(topics)}); choose one by --request and --leave"
                )
    if plan.role not in ROLES:
        raise UserError(unknown("role", plan.role, ROLES))
    _check_links(plan)


def _check_links(plan: AttachPlan) -> None:
    """Raises UserError for addresses, names or keys that make no link."""
    if plan.role == "car" and (plan.listen or plan.cars or plan.edges):
        raise UserError("link: a car connects to its edge and does not listen")
    if plan.listen is None and (plan.cars or plan.edges):
        raise UserError("link: --car and --edge name who may connect; say where: --listen")
    if plan.listen is not None and not plan.peers():
        raise UserError("link: --listen: nobody may connect; name those who may: --car, --edge")
    if not plan.has_links():
        return
    for text in plan.connect:
        if "@" not in text:
            raise UserError(
                f"link: {short_repr(text)} does not say whom to connect to; write name@host:port"
            )
    dialled = [text.partition("@")[2] for text in plan.connect]
    for address in dialled if plan.listen is None else [plan.listen, *dialled]:
        if _ADDRESS.fullmatch(address) is None or int(address.rpartition(":")[2]) > MAX_PORT:
            raise UserError(f"link: {short_repr(address)} is no address; write host:port")
    peers = plan.peers()
    for name in (plan.name, *peers):
        if NAME.fullmatch(name) is None:
            raise UserError(
                f"link: {short_repr(name)} is no name of a Genie: "
                "up to 64 letters, digits, '_' and '-'"
            )
    for name in plan.cars:
        if peers[name].role == "edge":
            raise UserError(f"link: {name} cannot be a car and an edge")
    if plan.name in peers:
        raise UserError(f"link: this Genie and another one are both called {plan.name}")
    if plan.keys is None:
        raise UserError("link: a link to another Genie needs a folder of keys: --keys")
    check_keys(Path(plan.keys), plan.name)


def make_gateway(
    plan: AttachPlan,
    *,
    publish: Callable[[str, RosMessage], None],
    observe: Callable[[Observation, int], None],
    links: PeerLinks,
    object_codec: Codec | None,
) -> Gateway:
    """The Genie of a plan, in its gateway.

    Parameters
    ----------
    plan : AttachPlan
        What the Genie needs to know.
    publish : callable
        Gets a topic and a message for the own ROS network.
    observe : callable
        Gets every record, and its time [ns].
    links : PeerLinks
        Other Genies.
    object_codec : Codec, optional
        Makes answers out of map objects; ``None`` if no answer holds objects.
    """
    settings = checked_settings(plan.settings, plan.pose_topic)
    middleware: dict[str, Any] = {"suffixes": (LOCAL, REMOTE), "make_answer": None}
    rules = GenieRules() if isinstance(settings, Recommended) else settings
    if object_codec is not None and plan.pose_topic is not None:
        middleware["make_answer"] = lambda header, objects: RosMessage(
            header, b"", object_codec, objects=tuple(objects), source="map"
        )
    return Gateway(
        _genie_of(plan, settings, middleware),
        rules=rules,
        role=plan.role,
        requests=plan.requests,
        answers=plan.answers,
        publish=publish,
        observe=observe,
        links=links,
    )


def _genie_of(
    plan: AttachPlan, settings: GenieRules | Recommended, middleware: dict[str, Any]
) -> AnyGenie:
    """The Genie of a plan. Raises UserError where its node gives no objects, which looks need."""
    if isinstance(settings, Recommended):
        suffixes: tuple[str, str] = middleware["suffixes"]
        if plan.role == "edge":
            return EdgeRelay(plan.name, plan.requests, plan.answers, suffixes=suffixes)
        if middleware["make_answer"] is None:
            raise UserError(f"genie: recommended: {', '.join(plan.answers)} carries no objects")
        return settings.car_genie(
            plan.name,
            plan.requests,
            plan.answers,
            has_edge=bool(plan.connect),
            object_map=settings.new_map(),
            make_answer=middleware["make_answer"],
            suffixes=suffixes,
        )
    if plan.role == "edge":
        rules = rules_on_edge(settings)
    else:
        rules = rules_on_car(settings, alone=not plan.connect)
    if middleware["make_answer"] is None and rules.miss_policy == "immediate":
        # there is no map to answer from meanwhile
        rules = replace(rules, miss_policy="blocking")
    return make_genie(rules, plan.name, plan.requests, plan.answers, **middleware)


class Recorder:
    """Writes every record as a line of JSON."""

    def __init__(self, path: str | None) -> None:
        self._file = open(path, "a", buffering=1, encoding="utf-8") if path else None  # noqa: PTH123, SIM115

    def __call__(self, record: Observation, now_ns: int) -> None:
        if self._file is not None:
            line = {"t_ns": now_ns, "record": type(record).__name__, **asdict(record)}
            header = getattr(record, "header", None)
            if header is not None:
                line["header"] = header._asdict()
            self._file.write(json.dumps(line) + "\n")
