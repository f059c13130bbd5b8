"""A scenario: who drives where with which computers, links and readings of the paper.

``reading`` reads it from YAML, and ``checks`` has what must hold beyond each setting. In Python
names carry units (``start_ns``), in YAML values do (``start: 3 s``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, get_args

from genie_sim.base import plugins, units
from genie_sim.base.contracts import require
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.marks import Bounds, Name, NotEmpty, Short
from genie_sim.base.plugins import Choice
from genie_sim.base.seeds import stream
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import (
    NamedPlugIn,
    PlugIn,
    from_plain,
    merged,
    named_plug_ins,
    names_of,
)
from genie_sim.data.frame_source import FrameSource
from genie_sim.data.sources import SOURCES
from genie_sim.scenario.faults import FaultEntry
from genie_sim.scenario.fleet import Fleet
from genie_sim.scenario.methods import METHOD, MethodEntry
from genie_sim.scenario.overrides import Override
from genie_sim.scenario.power import InterfaceName
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.yaml_input import dump
from genie_sim.sim import method as methods
from genie_sim.sim.link_model import LINK
from genie_sim.sim.method import Method
from genie_sim.sim.settings import (
    FOUR_CAMERAS,
    Camera,
    Car,
    Edge,
    MethodSettings,
)

Record = Literal[
    "lookups",
    "looks",
    "resources",
    "poses",
    "objects",
    "answers",
    "held",
    "held_objects",
    "steps",
]
RECORDS: tuple[Record, ...] = get_args(Record)
DETECTOR = PlugIn("detector", {})
METRIC = PlugIn("metric", {}, ("of", "title", "view"))
FRAME_SOURCE = PlugIn("frame source", SOURCES, ("open",), key="source", default="recorded")
USUAL_TRACE = Choice("recorded", {"trace": "kitti_0005"})
USUAL_METHODS = tuple(from_plain(MethodEntry, name) for name in methods.DEFAULT_METHODS)


class ReadFrom(NamedTuple):
    """Where the settings of a scenario come from, for mistakes that show when files are open. (Of
    others ``reading`` says which override makes them: one of another field, perhaps.)
    """

    file: str = "scenario"
    overrides: tuple[Override, ...] = ()

    def of(self, path: str) -> str:
        """The override that set what is at ``path``, else the file."""
        texts = (override.text for override in self.overrides if override.sets(path))
        return next(texts, self.file)


class NamedLink(NamedTuple):
    """A link, the path of the setting that names it, and whether it lies between edges."""

    path: str
    choice: Choice
    between_edges: bool = False


@dataclass(frozen=True, kw_only=True)
class Scenario(MethodSettings):
    """Everything that decides the outcome of a run, but for the files it names."""

    name: Name
    """The name of the results; by default that of the file."""

    description: str = ""
    """A sentence for whoever reads the results."""

    seed: Annotated[int, Bounds(minimum=0)] = 1
    """Seed of all streams of random numbers. The same seed gives the same bytes."""

    methods: Annotated[tuple[Annotated[MethodEntry, Short(plug_in=METHOD)], ...], NotEmpty()] = (
        USUAL_METHODS
    )
    """The methods to compare, in this order, each on the same random numbers. A method's name, or a
    mapping with `name`, `method`, `title`, the method's own arguments, and what differs for this
    entry of the scenario's settings, such as `genie` or `model`."""

    perception: Annotated[Choice, FRAME_SOURCE] = USUAL_TRACE
    """Where frames and detections come from."""

    origin: tuple[float, float, float] | None = None
    """Latitude [deg], longitude [deg] and altitude [m] of the map's origin; by default that of the
    first trace. Cars on two drives share one map."""

    cameras: Annotated[tuple[Camera, ...], NotEmpty()] = FOUR_CAMERAS
    """The streams of every car. By default the paper's four, KITTI's two colour and two grey
    cameras, 25 ms apart, for which the two recorded ones stand; real ones are those that the
    recording has: `02` and `03`, and `00` and `01` where it was made with them."""

    start_jitter_ns: int = 100 * units.NS_PER_MS
    """Every car starts up to this much later, drawn uniformly. Assumed; it keeps cars from running
    in step."""

    warm_up_ns: int = 0
    """How long caches and maps fill before anything counts: frames that are taken earlier are
    simulated, but in no table and no metric."""

    edges: tuple[Edge, ...] = ()
    """The edge servers."""

    cars: tuple[Car, ...] = ()
    """The cars; instead of them, a `fleet`."""

    fleet: Fleet | None = None
    """Cars that are alike, in a town, instead of `cars` and `edges`."""

    interface: InterfaceName = "auto"
    """The network interface of cars, for the energy that it takes: by default the one that fits
    their link. `none` does not count it."""

    faults: tuple[FaultEntry, ...] = ()
    """What goes wrong, and when."""

    judged: Literal["first", "all"] = "first"
    """At which frames of a car what it holds is judged, each time within the frame's field of view:
    those of its first stream, or of all, such as four cameras that look all around it."""

    record: tuple[Record, ...] = RECORDS
    """The tables written beside `frames`. Look-ups take the most space. For a fleet, only the
    resources of edges are written; `held_objects` needs `held`."""

    metrics: tuple[Annotated[str, METRIC], ...] = ()
    """Metrics of your own, beside all others: classes, each `package.module:Class`."""

    # What follows is no setting; it is filled in when the scenario is read and checked.
    read_from: ReadFrom = field(
        default=ReadFrom(), compare=False, repr=False, metadata={"setting": False}
    )
    # of each device that is named here
    profiles: Mapping[str, DeviceProfile] = field(
        default_factory=dict, compare=False, repr=False, metadata={"setting": False}
    )
    # whose recordings the cars replay, each its own, on one clock; None where they are of none
    sequence: str | None = field(
        default=None, compare=False, repr=False, metadata={"setting": False}
    )

    @classmethod
    def expand(cls, value: object) -> object:
        """Raises ``SettingError`` for what is no scenario, or one without cars."""
        if not isinstance(value, Mapping):
            return value
        if "axes" in value:
            raise SettingError("axes", "belongs to a sweep, which 'genie-sim sweep' runs")
        if value.get("fleet") is None and "cars" not in value:
            raise SettingError("cars", "missing")
        return value

    @property
    def source(self) -> FrameSource | None:
        """The frame source, ``None`` for one of the user's own, whose code is not run to check a
        scenario.
        """
        if plugins.is_own(self.perception.name):
            return None
        source: FrameSource = FRAME_SOURCE.make(self.perception)
        return source

    @cached_property
    def method_settings(self) -> Mapping[str, MethodSettings]:
        """Each method's settings by the name of its entry: the scenario's with those that the entry
        has otherwise. Raises ``SettingError``.
        """
        usual = MethodSettings(**{name: getattr(self, name) for name in names_of(MethodSettings)})
        settings = {}
        for index, entry in enumerate(self.methods):
            try:
                settings[entry.name] = merged(usual, entry.settings) if entry.settings else usual
            except SettingError as error:
                raise error.below(index).below("methods") from error
        return settings

    @property
    def is_one_world(self) -> bool:
        """Whether all cars are in one world at one time, and do not replay one recording at
        different times.
        """
        return self.sequence is not None or (self.source is not None and self.source.is_one_world)

    def error_at(self, path: str, text: str) -> UserError:
        """That ``text`` is wrong with the setting at ``path``, where it only shows once files are
        open: it begins with the override that set it, else the file.
        """
        return UserError(f"{self.read_from.of(path)}: {path}: {text}")

    def cameras_of(self, car: Car) -> Sequence[Camera]:
        """A car's own cameras, or the scenario's."""
        return car.streams(self.cameras)

    def start_ns(self, car: Car) -> int:
        """When a car starts: at its route's start, and up to ``start_jitter`` later, drawn for
        every car.
        """
        jitter_ns = self.start_jitter_ns
        late_ns = int(stream(self.seed, car.name, "start").integers(jitter_ns)) if jitter_ns else 0
        return car.route.start_ns + late_ns

    def links(self) -> "list[NamedLink]":
        """Every link that is named here."""
        named = [
            NamedLink(f"cars[{index}].link", car.link)
            for index, car in enumerate(self.cars)
            if car.link is not None
        ]
        if self.fleet is not None:
            named.append(NamedLink("fleet.link", self.fleet.link))
        for index, entry in enumerate(self.methods):
            where = f"methods[{index}]." if "edge_network" in entry.settings else ""
            choice = self.method_settings[entry.name].edge_network
            named.append(NamedLink(f"{where}edge_network", choice, between_edges=True))
        return named

    def own_plugins(self) -> list[NamedPlugIn]:
        """The classes of the user's own that are named here, wherever."""
        named = list(named_plug_ins(self))
        for index, entry in enumerate(self.methods):
            if entry.settings:
                named += named_plug_ins(self.method_settings[entry.name], f"methods[{index}]")
        detector = self.perception.parameters.get("detector")
        if detector is not None:
            choice = Choice(str(detector))
            named.append(NamedPlugIn("perception.detector", DETECTOR, choice, name_alone=True))
        return [plug_in for plug_in in named if plugins.is_own(plug_in.choice.name)]

    def own_classes(self) -> dict[str, tuple[str, str]]:
        """The kind and the name of each class of the user's own, by both in one text."""
        return {
            f"{mark.what} {choice.name}": (mark.what, choice.name)
            for _, mark, choice, _ in self.own_plugins()
        }

    def own_code_digests(self) -> dict[str, str]:
        """sha256 of the module of each class of the user's own: its code decides the outcome."""
        return {
            title: plugins.code_digest(what, name)
            for title, (what, name) in self.own_classes().items()
        }

    def link_digests(self) -> dict[str, str]:
        """Digests of the files that decide what links do. Runs code of the user's own; raises
        ``UserError``.
        """
        digests: dict[str, str] = {}
        for path, choice, _ in self.links():
            told: Any = getattr(LINK.make(choice), "digests", dict)()
            is_text = isinstance(told, Mapping) and all(
                isinstance(text, str) for item in told.items() for text in item
            )
            what = f"link model {choice.name!r}: digests()"
            require(is_text, what, told, "a mapping from name to text")
            for name, digest in told.items():
                is_free = digests.get(f"link {name}", digest) == digest
                is_free = is_free and not plugins.is_own(choice.name)
                digests[f"link {name if is_free else f'{path}: {name}'}"] = digest
        return digests

    def new_methods(self) -> dict[str, Method]:
        """The method of each entry, by its name, to ask what it is. Raises ``UserError``."""
        new = {}
        for index, entry in enumerate(self.methods):
            path = f"methods[{index}]"
            with as_user_error(f"{self.read_from.of(path)}: {path}", UserError):
                new[entry.name] = entry.new()
        return new


def as_yaml(written: Mapping[str, Any]) -> str:
    """A scenario's plain data in YAML, its name and its methods first."""
    first = {key: written[key] for key in ("name", "description", "seed", "methods")}
    return dump({**first, **written})
