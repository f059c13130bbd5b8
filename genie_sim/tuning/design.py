"""What a search varies and what it aims at, read from a small YAML file."""

import importlib.util
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from genie_sim import files, settings
from genie_sim.analysis.registry import METRICS, title_of
from genie_sim.analysis.statistics import NO_SHARES
from genie_sim.errors import UserError, short_repr, unknown
from genie_sim.scenario.yaml_input import parse, read_mapping
from genie_sim.settings import Bounds, Key, Name, NotEmpty, SettingError
from genie_sim.study.design import MAX_RUNS, listed, range_of
from genie_sim.tuning.space import Space

# a metric, and where there are several: of which placement and component
_TARGET = re.compile(r"([A-Za-z_]\w*)(?:/(\w*)(?:/([\w./>-]+(?: [\w./>-]+)*))?)?", re.ASCII)
_CONSTRAINT = re.compile(r"(\S.*?)\s*(<=|>=)\s*(-?\d*\.?\d+(?:[eE][+-]?\d+)?)\s*(%?)", re.ASCII)
ONE_DRIVE = "the drive of the scenario"


@dataclass(frozen=True)
class Target:
    """One metric of a run: of which placement, and of which component."""

    metric: str
    placement: str = "all"
    component: str = ""

    @classmethod
    def expand(cls, value: object) -> "Target":
        """``streaming_f1``, ``image_reuse/car`` or ``lap_f1/all/lap 2``. Raises
        ``SettingError``.
        """
        match = _TARGET.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            text = f"must be a metric such as 'streaming_f1', not {short_repr(value)}"
            raise SettingError("", text)
        if match[1] not in METRICS:
            raise SettingError("", unknown("metric", match[1], METRICS))
        return cls(match[1], match[2] or "all", match[3] or "")

    def shorten(self) -> str:
        """As it is written in a file."""
        return self.text

    @property
    def text(self) -> str:
        """As it is written in a file."""
        if self.component:
            return f"{self.metric}/{self.placement}/{self.component}"
        return self.metric if self.placement == "all" else f"{self.metric}/{self.placement}"

    @property
    def is_share(self) -> bool:
        """Whether its values are from 0 to 1."""
        return METRICS[self.metric].unit == "%" and not self.metric.startswith(NO_SHARES)

    @property
    def title(self) -> str:
        """The metric's title, with placement and component where it has them."""
        more = [name for name in (self.placement, self.component) if name not in ("", "all")]
        return f"{title_of(self.metric)} ({', '.join(more)})" if more else title_of(self.metric)


class Objective(NamedTuple):
    """A metric that is made as large or as small as possible."""

    target: Target
    maximized: bool

    @property
    def sign(self) -> int:
        """What a value is multiplied with, so that less is better."""
        return -1 if self.maximized else 1


@dataclass(frozen=True)
class Constraint:
    """A bound that the mean of a metric must keep."""

    target: Target
    at_most: bool
    bound: float

    @classmethod
    def expand(cls, value: object) -> "Constraint":
        """``ghost_share <= 0.3`` or ``ghost_share <= 30 %``. Raises ``SettingError``."""
        match = _CONSTRAINT.fullmatch(value.strip()) if isinstance(value, str) else None
        if match is None:
            text = f"must be such as 'ghost_share <= 0.3', not {short_repr(value)}"
            raise SettingError("", text)
        bound = float(match[3]) / (100 if match[4] else 1)
        return cls(Target.expand(match[1]), match[2] == "<=", bound)

    def shorten(self) -> str:
        """As it is written in a file."""
        return self.text

    def excess(self, value: float) -> float:
        """How far a value is beyond the bound; at most 0 where it is kept."""
        return value - self.bound if self.at_most else self.bound - value

    @property
    def text(self) -> str:
        """As it is written in a file."""
        return f"{self.target.text} {'<=' if self.at_most else '>='} {self.bound:g}"


@dataclass(frozen=True, kw_only=True)
class Objectives:
    """The metrics that a search makes as large or as small as possible."""

    maximize: tuple[Target, ...] = ()
    """The larger the better; the first of them is what accuracy means in the answer."""
    minimize: tuple[Target, ...] = ()
    """The smaller the better."""

    @classmethod
    def expand(cls, data: object) -> object:
        """One metric for short."""
        return listed(data, "maximize", "minimize")

    def __post_init__(self) -> None:
        targets = [*self.maximize, *self.minimize]
        if not targets:
            raise SettingError("", "must name a metric to maximize or to minimize")
        for target in targets:
            if targets.count(target) > 1:
                raise SettingError("", f"the metric {target.text} comes twice")

    @property
    def all(self) -> list[Objective]:
        """Those to maximize first: the first of all is what accuracy means in the answer."""
        return [
            *(Objective(target, True) for target in self.maximize),
            *(Objective(target, False) for target in self.minimize),
        ]


DEFAULT_OBJECTIVES = Objectives(
    maximize=(Target("streaming_f1"),),
    minimize=(
        Target("first_answer_p95"),
        Target("bytes_up_per_frame"),
        Target("accelerator_time", "edge"),
    ),
)

Seed = Annotated[int, Bounds(minimum=0)]
Seeds = (
    Annotated[int, Bounds(minimum=1, maximum=MAX_RUNS)] | Annotated[tuple[Seed, ...], NotEmpty()]
)


@dataclass(frozen=True, kw_only=True)
class Seeding:
    """The seeds that the search sees, and those of its report."""

    tuning: Seeds = 5
    """Those that the search sees; ``5`` for short: the seeds 1 to 5."""
    held_out: Seeds = 5
    """Those of its report; ``5`` for short: the five seeds after the largest tuning seed."""

    def __post_init__(self) -> None:
        for name in ("tuning", "held_out"):
            seeds = getattr(self, name)
            if not isinstance(seeds, int) and len(set(seeds)) < len(seeds):
                raise SettingError(name, "a seed comes twice")
        shared = sorted(set(self.of_tuning) & set(self.of_held_out))
        if shared:
            text = f"seed {shared[0]} is a tuning seed, too; the two must be apart"
            raise SettingError("held_out", text)

    @property
    def of_tuning(self) -> tuple[int, ...]:
        """Those that the search sees."""
        return range_of(self.tuning) if isinstance(self.tuning, int) else self.tuning

    @property
    def of_held_out(self) -> tuple[int, ...]:
        """Those of its report."""
        if not isinstance(self.held_out, int):
            return self.held_out
        return range_of(self.held_out, first=max(self.of_tuning) + 1)


Settings = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Drives:
    """Named settings, such as another recording each: those the search sees, and those of its
    report.
    """

    tuning: Annotated[dict[str, Settings], NotEmpty()]
    """Those that the search sees."""
    held_out: Annotated[dict[str, Settings], NotEmpty()]
    """Those of its report."""

    def __post_init__(self) -> None:
        for name, settings_of_drive in self.held_out.items():
            if name in self.tuning or settings_of_drive in self.tuning.values():
                text = "is a tuning drive, too; the two must be apart"
                raise SettingError(f"held_out.{name}", text)


class Case(NamedTuple):
    """One run's place within a part: its drive and its seed."""

    drive: str
    seed: int


class Part(NamedTuple):
    """The tuning set or the held-out set: drives, each run with all seeds."""

    drives: Mapping[str, Settings]
    seeds: tuple[int, ...]

    @property
    def cases(self) -> list[Case]:
        """All runs of one design; those of the first seeds come first."""
        return [Case(drive, seed) for seed in self.seeds for drive in self.drives]


@dataclass(frozen=True, kw_only=True)
class SearchDesign:
    """A search: a scenario, a space for each method, objectives, and two sets of seeds and
    drives.
    """

    name: Name
    """Of its folder of results; by default that of its file."""
    description: str = ""
    """What it is for."""
    scenario: str
    """The scenario in which designs are tried, by name or path."""
    settings: Annotated[Settings, Key("set")] = field(default_factory=dict)
    """Settings that are the same for all designs, by path."""
    methods: Annotated[dict[Name, Space], NotEmpty()]
    """What is searched of each method."""
    objectives: Objectives = DEFAULT_OBJECTIVES
    """What is made as large or as small as possible."""
    constraints: Annotated[tuple[Constraint, ...], Key("subject_to")] = ()
    """Bounds that metrics must keep."""
    points: Annotated[int, Bounds(minimum=1, maximum=MAX_RUNS)] = 200
    """How many designs are tried of each method."""
    early: Annotated[int, Bounds(minimum=0)] = 2
    """After so many runs of a design it may be given up."""
    batch: Annotated[int, Bounds(minimum=1, maximum=1000)] = 10
    """So many designs are drawn together."""
    sampler: Literal["tpe", "nsga2", "random"] = "tpe"
    """Optuna's sampler that draws them."""
    seed: Seed = 1
    """The seed by which it draws."""
    seeds: Seeding = Seeding()
    """The seeds of the runs."""
    drives: Drives | None = None
    """The drives of the runs; by default that of the scenario."""

    @classmethod
    def expand(cls, data: object) -> object:
        """One bound for short."""
        return listed(data, "subject_to")

    def __post_init__(self) -> None:
        if len(self.held_out.drives) < 2 and len(self.seeds.of_held_out) < 2:
            raise SettingError("seeds.held_out", "at least 2, or there are no intervals")
        for name, space in self.methods.items():
            if not space.free(self.settings):
                text = "has no points: 'set' fixes all of its settings"
                raise SettingError(f"methods.{name}.space", text)
        for path in ("seed", "methods"):
            if path in self.settings:
                place = "methods" if path == "methods" else "seeds"
                raise SettingError(f"set.{path}", f"belongs in '{place}'")

    @property
    def tuning(self) -> Part:
        """What the search sees."""
        drives = {ONE_DRIVE: {}} if self.drives is None else self.drives.tuning
        return Part(drives, self.seeds.of_tuning)

    @property
    def held_out(self) -> Part:
        """What only the report is made of."""
        drives = {ONE_DRIVE: {}} if self.drives is None else self.drives.held_out
        return Part(drives, self.seeds.of_held_out)

    @property
    def targets(self) -> list[Target]:
        """Of the objectives, then of the constraints."""
        return [
            *(objective.target for objective in self.objectives.all),
            *(constraint.target for constraint in self.constraints),
        ]

    def identity(self) -> dict[str, Any]:
        """What decides which points are tried: all but the number of points and the held-out
        set.
        """
        plain: dict[str, Any] = settings.plain_data(self)
        del plain["points"], plain["description"]
        plain["seeds"] = list(self.tuning.seeds)
        plain["drives"] = dict(self.tuning.drives)
        return plain


def fixed_settings(overrides: Sequence[str]) -> dict[str, Any]:
    """``path=value`` texts as settings. Raises ``UserError``."""
    fixed = {}
    for text in overrides:
        path, equals, value = text.partition("=")
        if not equals or not path.strip():
            raise UserError(f"--set {text}: must be path=value, such as image_encoding=raw")
        fixed[path.strip()] = parse(value, f"--set {text}")
    return fixed


def load(
    source: str | Path | Mapping[str, Any],
    methods: Sequence[str] = (),
    changes: Mapping[str, Any] | None = None,
) -> SearchDesign:
    """A search file, by path or by name, or a scenario, searched with the shipped spaces.

    Parameters
    ----------
    source : str, Path or mapping
        A search, as a file, by name or as data; else a scenario.
    methods : sequence of str
        Which methods are searched: those of the file, or spaces by name or path; by default all of
        the file, and ``genie`` for a scenario.
    changes : mapping, optional
        Fields of the file to change, such as ``{"points": 50}``; those below ``set`` are added.

    Raises
    ------
    UserError
        In one line.
    """
    if importlib.util.find_spec("optuna") is None:
        raise UserError("search: Optuna is not installed: pip install 'genie-sim[search]'")
    if isinstance(source, Mapping):
        where, data = "search", {"name": "search", **source}
    else:
        path, data = _data_of(source)
        where = str(path)
    for key, value in (changes or {}).items():
        data[key] = {**data.get(key, {}), **value} if key == "set" else value
    listed = data.get("methods", ["genie"])
    known = listed if isinstance(listed, dict) else {}
    names = methods or list(listed)
    spaces = {}
    for name in names:
        space = known.get(name)
        spaces[Path(name).stem] = _space_data(name) if space is None else space
    return read_search({**data, "methods": spaces}, where)


def _data_of(path_or_name: str | Path) -> tuple[Path, dict[str, Any]]:
    """The data of a search; a scenario becomes one with its defaults."""
    is_name = isinstance(path_or_name, str) and path_or_name not in files.available(files.SEARCH)
    try:
        path = files.find(files.SCENARIO if is_name else files.SEARCH, path_or_name)
    except UserError:
        names = {**files.available(files.SEARCH), **files.available(files.SCENARIO)}
        if not is_name or len(Path(path_or_name).parts) > 1 or Path(path_or_name).suffix:
            raise
        raise UserError(unknown("search or scenario", path_or_name, names)) from None
    data = {"name": path.stem, **read_mapping(path)}
    if {"cars", "fleet", "convoy"} & data.keys():
        where = str(path) if Path(path_or_name).suffix else str(path_or_name)
        data = {"name": path.stem, "scenario": where, "set": {"record": ["held"]}}
    return path, data


def _space_data(name: str) -> dict[str, Any]:
    """The shipped space of a method, or one in a file."""
    return read_mapping(files.find(files.SPACE, name))


def read_search(data: Mapping[str, Any], where: str) -> SearchDesign:
    """A search as in YAML; ``where`` it comes from is in front of what is wrong with it. Raises
    ``UserError``.
    """
    return settings.read(SearchDesign, data, lambda field: where)
