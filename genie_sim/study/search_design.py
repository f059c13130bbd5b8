"""What a search varies and what it aims at, read from a small YAML file."""

import importlib.util
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from genie_sim.analysis.registry import METRICS, unknown_metric
from genie_sim.base import files, settings
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.settings import Bounds, Key, Name, NotEmpty, SettingError
from genie_sim.scenario.yaml_input import parse, read_mapping
from genie_sim.study.design import (
    MAX_RUNS,
    Axis,
    Cases,
    Level,
    NumberRange,
    check_paths,
    listed,
    range_of,
)

_CONSTRAINT = re.compile(r"(\S.*?)\s*(<=|>=)\s*(-?\d*\.?\d+(?:[eE][+-]?\d+)?)\s*(%?)", re.ASCII)
_COLUMNS = (
    "design",
    "method",
    "tuned",
    "equal_to",
    "within_constraints",
    "number",
    "state",
    "reason",
)
ONE_DRIVE = "the drive of the scenario"

Settings = dict[str, Any]
Values = Mapping[str, Level]  # of the parameters that count at a point, by name
# A metric of a run, with placement and component where it has several: ``streaming_f1``,
# ``image_reuse/car``, ``lap_f1/all/lap 2``
Target = str


def metric_of(target: Target, field: str = "") -> str:
    """Its metric. Raises ``SettingError`` for the field where there is none of that name."""
    metric = target.partition("/")[0]
    if metric not in METRICS:
        raise SettingError(field, unknown_metric(metric))
    return metric


def target_of(metric: str, placement: str, component: str) -> Target:
    """The target that a row of metrics is about."""
    if component:
        return f"{metric}/{placement}/{component}"
    return metric if placement == "all" else f"{metric}/{placement}"


@dataclass(frozen=True)
class Point:
    """A method with a value for each parameter that counts. ``method`` is the name of a space, or
    empty for a method of the scenario as it is, which ``name`` then is the name of.
    """

    name: str
    method: str
    values: Values = field(compare=False)


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
        metric_of(match[1])
        return cls(match[1], match[2] == "<=", float(match[3]) / (100 if match[4] else 1))

    def shorten(self) -> str:
        """As it is written in a file."""
        return f"{self.target} {'<=' if self.at_most else '>='} {self.bound:g}"

    def excess(self, value: float) -> float:
        """How far a value is beyond the bound; at most 0 where it is kept."""
        return value - self.bound if self.at_most else self.bound - value


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
        if not self.targets:
            raise SettingError("", "must name a metric to maximize or to minimize")
        for name in ("maximize", "minimize"):
            for place, target in enumerate(getattr(self, name)):
                metric_of(target, f"{name}[{place}]")
                if self.targets.count(target) > 1:
                    raise SettingError("", f"the metric {target} comes twice")

    @property
    def targets(self) -> tuple[Target, ...]:
        """Those to maximize first: the first of all is what accuracy means in the answer."""
        return self.maximize + self.minimize

    @property
    def signs(self) -> list[int]:
        """What the value of each target is multiplied with, so that less is better."""
        return [-1] * len(self.maximize) + [1] * len(self.minimize)


DEFAULT_OBJECTIVES = Objectives(
    maximize=("streaming_f1",),
    minimize=("first_answer_p95", "bytes_up_per_frame", "accelerator_time/edge"),
)


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One thing that is searched: the settings it sets, and a ``range`` of numbers or a ``list``.

    Settings of the method itself begin with ``method.``; all others are paths of the scenario. A
    ``list`` without ``set`` names cases, each with settings of its own. With ``when`` it counts
    only where another parameter, which stands before it, has one of these values.
    """

    paths: Annotated[tuple[str, ...], Key("set")] = ()
    """Paths of the settings that it sets."""
    range: NumberRange | None = None
    """The numbers that may be tried."""
    cases: Annotated[tuple[Any, ...] | Cases | None, Key("list")] = None
    """The values, or named cases, that may be tried."""
    when: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    """The values of earlier parameters where this one counts; all where it names none."""

    @classmethod
    def expand(cls, data: object) -> object:
        """One path and single values for short."""
        data = listed(data, "set")
        if not isinstance(data, Mapping) or not isinstance(data.get("when"), Mapping):
            return data
        when = {
            name: values if isinstance(values, list | tuple) else (values,)
            for name, values in data["when"].items()
        }
        return {**data, "when": when}

    def __post_init__(self) -> None:
        ways = [name for name, way in (("range", self.range), ("list", self.cases)) if way]
        if len(ways) != 1:
            has = " and ".join(ways) or "none"
            raise SettingError("", f"must have either 'range' or 'list', has {has}")
        check_paths(self.paths, self.cases, "missing; say which setting")
        self.axis.levels()

    @property
    def axis(self) -> Axis:
        """The same as an axis of a sweep."""
        return Axis(paths=self.paths, random=self.range, cases=self.cases)

    @property
    def levels(self) -> list[Level]:
        """The values of a list, or the ends of a range."""
        if self.range is not None:
            return [self.range.low.number, self.range.high.number]
        return [level for level, _ in self.axis.levels()]

    def settings(self, value: Level) -> Settings:
        """The settings that follow from a value."""
        if self.range is not None:
            return self.axis.numeric(self.range, float(value))[1]
        return dict(self.axis.levels())[value]


@dataclass(frozen=True, kw_only=True)
class Space:
    """What is searched of one method: fixed settings, and parameters."""

    description: str = ""
    """What it is for."""
    method: str
    """The method, by name."""
    title: str | None = None
    """What tables and figures of a design call it; by default its own title."""
    settings: Annotated[Settings, Key("set")] = field(default_factory=dict)
    """Settings that are the same at all points, by path."""
    parameters: Annotated[dict[Name, Parameter], NotEmpty(), Key("space")]
    """What is searched, by name."""

    def __post_init__(self) -> None:
        before: dict[str, Parameter] = {}
        for name, parameter in self.parameters.items():
            if name in _COLUMNS or name in METRICS:
                text = "is a column of the tables; call the parameter otherwise"
                raise SettingError(f"space.{name}", text)
            for other, values in parameter.when.items():
                where = f"space.{name}.when"
                if other not in before:
                    raise SettingError(where, unknown("earlier parameter", other, before))
                if before[other].range is not None:
                    raise SettingError(where, f"{other} is a range; a condition needs a list")
                for value in values:
                    if value not in before[other].levels:
                        known = map(str, before[other].levels)
                        raise SettingError(where, unknown(other, value, known))
            before[name] = parameter

    def free(self, fixed: Settings) -> dict[str, Parameter]:
        """The parameters, without those whose settings are fixed already."""
        return {
            name: parameter
            for name, parameter in self.parameters.items()
            if not parameter.axis.settings_paths & fixed.keys()
        }

    def chosen(
        self, fixed: Settings, choose: Callable[[str, Parameter], Level | None]
    ) -> dict[str, Level]:
        """A value for each free parameter that counts, given those before it; ``None`` leaves it
        out.
        """
        known = {
            name: level
            for name, parameter in self.parameters.items()
            if parameter.range is None
            for level in parameter.levels
            if parameter.settings(level) and parameter.settings(level).items() <= fixed.items()
        }
        values: dict[str, Level] = {}
        for name, parameter in self.free(fixed).items():
            so_far = {**known, **values}
            if all(so_far.get(other) in allowed for other, allowed in parameter.when.items()):
                value = choose(name, parameter)
                if value is not None:
                    values[name] = value
        return values

    def samples(self, fixed: Settings) -> Iterator[tuple[str, Values]]:
        """Points that together use every value of every list and both ends of every range, each
        with the name of the parameter it is about.
        """
        for name, parameter in self.free(fixed).items():
            for level in parameter.levels:
                wanted = {**self._conditions(name), name: level}
                values = self.chosen(fixed, partial(_wanted, wanted))
                if name in values:
                    yield name, values

    def _conditions(self, name: str) -> dict[str, Level]:
        """Values of earlier parameters under which this one counts."""
        wanted: dict[str, Level] = {}
        for other, allowed in self.parameters[name].when.items():
            wanted |= {**self._conditions(other), other: allowed[0]}
        return wanted

    def column(self, name: str) -> str:
        """A parameter's column in tables: its name, and its unit in brackets."""
        unit = self.parameters[name].axis.unit
        return f"{name} [{unit}]" if unit else name

    def overrides(self, name: str, values: Values, fixed: Settings) -> list[str]:
        """The overrides, as on the command line, that make a point of this space.

        Parameters
        ----------
        name : str
            What tables call the method.
        values : mapping
            Of the parameters.
        fixed : dict
            Settings of the search; those of the space go before them.
        """
        method: Settings = {"name": name, "method": self.method}
        if self.title is not None:
            method["title"] = self.title
        scenario: Settings = {}
        of_values = [self.parameters[key].settings(value) for key, value in values.items()]
        for group in (fixed, self.settings, *of_values):
            for path, value in group.items():
                if path.startswith("method."):
                    method[path.removeprefix("method.")] = value
                else:
                    scenario[path] = value
        return as_overrides({"methods": [method], **scenario})


def _wanted(values: Values, name: str, _: Parameter) -> Level | None:
    """The value of a parameter; ``None`` where it has none."""
    return values.get(name)


def as_overrides(settings: Settings) -> list[str]:
    """``path=value`` texts. JSON is YAML, and says of a text that it is one."""
    return [f"{path}={json.dumps(value, ensure_ascii=False)}" for path, value in settings.items()]


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


class Part(NamedTuple):
    """The tuning set or the held-out set: drives, each run with all seeds."""

    drives: Mapping[str, Settings]
    seeds: tuple[int, ...]


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
    batch: Annotated[int, Bounds(minimum=1, maximum=1000)] = 10
    """So many designs are drawn together, and run side by side."""
    seed: Seed = 1
    """The seed by which they are drawn."""
    seeds: Seeding = Seeding()
    """The seeds of the runs."""
    drives: Drives | None = None
    """The drives of the runs; by default that of the scenario."""

    @classmethod
    def expand(cls, data: object) -> object:
        """One bound for short."""
        return listed(data, "subject_to")

    def __post_init__(self) -> None:
        if len(self.held_out.drives) < 2 and len(self.held_out.seeds) < 2:
            raise SettingError("seeds.held_out", "at least 2, or there are no intervals")
        for name, space in self.methods.items():
            if not space.free(self.settings):
                text = "has no points: 'set' fixes all of its settings"
                raise SettingError(f"methods.{name}.space", text)
        for path, place in (("seed", "seeds"), ("methods", "methods")):
            if path in self.settings:
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
        """Of the objectives, then of the constraints; each once."""
        of_constraints = [constraint.target for constraint in self.constraints]
        return list(dict.fromkeys([*self.objectives.targets, *of_constraints]))


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
    given = data.get("methods", ["genie"])
    known = given if isinstance(given, dict) else {}
    spaces = {
        Path(name).stem: known[name]
        if name in known
        else read_mapping(files.find(files.SPACE, name))
        for name in methods or given
    }
    return settings.read(SearchDesign, {**data, "methods": spaces}, lambda field: where)


def _data_of(path_or_name: str | Path) -> tuple[Path, dict[str, Any]]:
    """The data of a search; a scenario becomes one with its defaults."""
    searches, scenarios = files.available(files.SEARCH), files.available(files.SCENARIO)
    is_name = Path(path_or_name).name == str(path_or_name) and not Path(path_or_name).suffix
    if is_name and path_or_name not in {**searches, **scenarios}:
        raise UserError(unknown("search or scenario", str(path_or_name), {**searches, **scenarios}))
    kind = files.SCENARIO if is_name and path_or_name not in searches else files.SEARCH
    path = files.find(kind, path_or_name)
    data = read_mapping(path)
    if {"cars", "fleet", "convoy"} & data.keys():
        data = {"scenario": str(path_or_name), "set": {"record": ["held"]}}
    return path, {"name": path.stem, **data}


def fixed_settings(overrides: Sequence[str]) -> Settings:
    """``path=value`` texts as settings. Raises ``UserError``."""
    fixed = {}
    for text in overrides:
        path, equals, value = text.partition("=")
        if not equals or not path.strip():
            raise UserError(f"--set {text}: must be path=value, such as image_encoding=raw")
        fixed[path.strip()] = parse(value, f"--set {text}")
    return fixed
