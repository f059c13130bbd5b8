"""What a sweep varies, read from a small YAML file, and the points that follow from it.

Every combination of the ``grid`` and ``list`` axes is made; each combination is made once for every
joint sample of the ``latin_hypercube`` axes; and each point is run with every seed.
"""

import hashlib
import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeVar

from genie_sim.base import files, settings, units
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.marks import Bounds, Key, Name, NotEmpty
from genie_sim.base.paths import read_text
from genie_sim.base.seeds import stream
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import plain_data
from genie_sim.scenario.scenario import Scenario
from genie_sim.scenario.yaml_input import inline, parse, read_mapping
from genie_sim.version import VERSION

MAX_NAME = 80  # characters of a folder of a sweep without a file, before the digest
MAX_SCENARIO = 70  # of a scenario's name, in the folder of its seeds
# the one path of an axis that is no setting of a scenario but names another one
SCENARIO = "scenario"
MAX_RUNS = 1_000_000
COLUMNS = (  # of the tables
    "point",
    "seed",
    "run_id",
    "metric",
    "method",
    "placement",
    "component",
    "value",
    "unit",
    "low",
    "high",
    "n",
    "range_low",
    "range_high",
    "runs",
)
QUANTITIES = (units.DURATION, units.SIZE, units.RATE, units.LENGTH, units.ANGLE)
UNITS = {*(unit for quantity in QUANTITIES for unit in quantity.units), "entries"}
_QUANTITY = re.compile(
    r"([+-]?\d{1,15}(?:\.\d{1,15})?(?:[eE][+-]?\d{1,2})?)(?:\s*([^\s\d]\S*))?", re.ASCII
)

Value = TypeVar("Value")
Level = float | str  # the value of an axis at a point, as the tables show it


@dataclass(frozen=True)
class Amount:
    """A number with any unit that settings have, or none: ``0.5 m``, ``3``."""

    number: float
    unit: str = ""

    @classmethod
    def expand(cls, value: object) -> "Amount":
        """``"0.5 m"``, or a number alone. Raises ``SettingError``."""
        quantity = cls.in_value(value)
        if quantity is None:
            text = f"must be a number, or one with a unit such as '0.5 m', not {short_repr(value)}"
            raise SettingError("", text)
        return quantity

    @classmethod
    def in_value(cls, value: object) -> "Amount | None":
        """The number in a value of a list; None where it is something else."""
        if isinstance(value, Amount):
            return value
        if isinstance(value, int | float) and not isinstance(value, bool):
            return cls(float(value)) if math.isfinite(value) else None
        match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
        if match is None or (match[2] is not None and match[2] not in UNITS):
            return None
        return cls(float(match[1]), match[2] or "")

    def shorten(self) -> float | str:
        """As it is written in a file."""
        return f"{self.number:.15g} {self.unit}" if self.unit else self.number


@dataclass(frozen=True, kw_only=True)
class NumberRange:
    """Numbers from ``from`` to ``to``, both included, evenly spread on a linear or logarithmic
    scale.
    """

    low: Annotated[Amount, Key("from")]
    """The smallest."""
    high: Annotated[Amount, Key("to")]
    """The largest, in the same unit."""
    scale: Literal["linear", "log"] = "linear"
    """Whether equal steps are equal differences or equal ratios."""

    def __post_init__(self) -> None:
        if self.low.unit != self.high.unit:
            units_text = f"{self.low.unit or 'none'}, not {self.high.unit or 'none'}"
            raise SettingError("to", f"must have the unit of 'from', {units_text}")
        if not self.low.number < self.high.number:
            raise SettingError("to", "must be more than 'from'")
        if self.scale == "log" and self.low.number <= 0:
            raise SettingError("from", "must be more than zero on a logarithmic scale")

    @property
    def unit(self) -> str:
        """Of both ends, and so of every value; may be empty."""
        return self.low.unit

    def at(self, share: float) -> float:
        """The value at a share of the way, to six digits."""
        low, high = self.low.number, self.high.number
        value = low * (high / low) ** share if self.scale == "log" else low + (high - low) * share
        return float(f"{value:.6g}")


@dataclass(frozen=True, kw_only=True)
class NumberGrid(NumberRange):
    """So many ``points``, both ends among them."""

    points: Annotated[int, Bounds(minimum=2, maximum=MAX_RUNS)]
    """How many numbers, both ends among them."""

    def values(self) -> list[float]:
        """Evenly spaced, rising."""
        return [self.at(index / (self.points - 1)) for index in range(self.points)]


Cases = dict[str, dict[str, Any]]  # settings of each case, by its name


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One thing that is varied: the settings it sets, and one of the three ways to vary it.

    Several settings get the same value. A ``list`` without ``set`` names cases, each with settings
    of its own.
    """

    paths: Annotated[tuple[str, ...], Key("set")] = ()
    """Paths of the settings that it sets."""
    grid: NumberGrid | None = None
    """Evenly spaced numbers."""
    cases: Annotated[tuple[Any, ...] | Cases | None, Key("list")] = None
    """Values, or named cases."""
    latin_hypercube: NumberRange | None = None
    """Numbers drawn one from each of equal parts of the span."""

    @classmethod
    def expand(cls, data: object) -> object:
        """One path for short."""
        if isinstance(data, Mapping) and isinstance(data.get("set"), str):
            return {**data, "set": (data["set"],)}
        return data

    def __post_init__(self) -> None:
        ways = {"grid": self.grid, "list": self.cases, "latin_hypercube": self.latin_hypercube}
        kinds = [name for name, way in ways.items() if way is not None]
        if len(kinds) != 1:
            has = " and ".join(kinds) or "none"
            raise SettingError("", f"must have exactly one of {', '.join(ways)}, has {has}")
        if isinstance(self.cases, dict) == bool(self.paths):  # named cases bring their own
            missing = "missing; say which setting is varied"
            raise SettingError("set", "is not for named cases" if self.paths else missing)
        if self.cases is not None and not self.cases:
            raise SettingError("list", "must not be empty")
        if not self.sampled:
            twice = _twice(level for level, _ in self.levels())
            if twice is not None:
                raise SettingError(kinds[0], f"the value {short_repr(twice)} comes twice")

    @property
    def span(self) -> NumberRange | None:
        """Of numbers; None for a list."""
        return self.grid or self.latin_hypercube

    @property
    def sampled(self) -> bool:
        """Drawn, not crossed."""
        return self.latin_hypercube is not None

    @property
    def unit(self) -> str:
        """Of its values, if they are numbers with one."""
        if self.span is not None:
            return self.span.unit
        quantities = self._quantities()
        return quantities[0].unit if quantities else ""

    @property
    def settings_paths(self) -> set[str]:
        """Every path that it sets."""
        cases = self.cases.values() if isinstance(self.cases, dict) else ()
        return {*self.paths, *(path for settings in cases for path in settings)}

    def levels(self) -> list[tuple[Level, dict[str, Any]]]:
        """The values of a crossed axis and the settings of each."""
        if self.grid is not None:
            return [self.numeric(self.grid, value) for value in self.grid.values()]
        if isinstance(self.cases, dict):
            return list(self.cases.items())
        values = self.cases or ()
        quantities = self._quantities()
        texts = [value if isinstance(value, str) else inline(value) for value in values]
        numbers = [quantity.number for quantity in quantities or ()]
        names: Sequence[Level] = numbers or texts
        return [
            (name, dict.fromkeys(self.paths, value))
            for name, value in zip(names, values, strict=True)
        ]

    def samples(self, name: str, count: int, seed: int) -> list[tuple[Level, dict[str, Any]]]:
        """``count`` values of a sampled axis, one in each of ``count`` equal parts of its span,
        drawn from the random stream of the axis' name.
        """
        rng = stream(seed, "sweep", name)
        span = self.latin_hypercube
        assert span is not None
        shares = (rng.permutation(count) + rng.random(count)) / count
        return [self.numeric(span, span.at(float(share))) for share in shares]

    def numeric(self, span: NumberRange, value: float) -> tuple[Level, dict[str, Any]]:
        """A number of a span, and the settings that follow from it."""
        number = int(value) if value.is_integer() else value
        return value, dict.fromkeys(self.paths, f"{number:g} {span.unit}" if span.unit else number)

    def _quantities(self) -> list[Amount] | None:
        """A list's numbers, all of one unit; None for a list of other things."""
        if self.cases is None or isinstance(self.cases, dict):
            return None
        values = [Amount.in_value(value) for value in self.cases]
        quantities = [quantity for quantity in values if quantity is not None]
        is_uniform = len(quantities) == len(values) and len({item.unit for item in quantities}) == 1
        return quantities if is_uniform else None


def _twice(values: Iterable[Value]) -> Value | None:
    return next((value for value, times in Counter(values).items() if times > 1), None)


@dataclass(frozen=True, kw_only=True)
class Design:
    """A sweep: a scenario with fixed settings, axes and seeds. Without axes it is a run with
    several seeds.
    """

    name: Name
    """Of its folder of results; by default that of its file."""
    description: str = ""
    """What it is for."""
    scenario: str
    """The scenario that is varied, by name or path."""
    settings: Annotated[dict[str, Any], Key("set")] = field(default_factory=dict)
    """Settings that are the same at all points, by path."""
    seeds: Annotated[tuple[Annotated[int, Bounds(minimum=0)], ...], NotEmpty()] = (1, 2, 3, 4, 5)
    """Each point is run with every one of them; ``5`` for short: the seeds 1 to 5."""
    samples: Annotated[int, Bounds(minimum=1, maximum=MAX_RUNS)] | None = None
    """How many values sampled axes draw."""
    sample_seed: Annotated[int, Bounds(minimum=0)] = 1
    """The seed by which they draw."""
    axes: dict[Name, Axis] = field(default_factory=dict)
    """What is varied, by name."""

    @classmethod
    def expand(cls, data: object) -> object:
        """A number of seeds for short. Raises ``SettingError``."""
        count = data.get("seeds") if isinstance(data, Mapping) else None
        if not isinstance(data, Mapping) or not isinstance(count, int) or isinstance(count, bool):
            return data
        if not 1 <= count <= MAX_RUNS:
            text = f"must be a list, or how many: 1 to {MAX_RUNS:,}, not {count:,}"
            raise SettingError("seeds", text)
        return {**data, "seeds": tuple(range(1, count + 1))}

    def __post_init__(self) -> None:
        twice = _twice(self.seeds)
        if twice is not None:
            raise SettingError("seeds", f"the seed {twice} comes twice")
        sampled = [name for name, axis in self.axes.items() if axis.sampled]
        if sampled and self.samples is None:
            raise SettingError("samples", f"missing; axis {sampled[0]!r} needs to know how many")
        if not sampled and self.samples is not None:
            text = "has no effect without an axis that is a 'latin_hypercube'"
            raise SettingError("samples", text)
        self._check_axes()
        if self.runs > MAX_RUNS:
            raise SettingError("axes", f"make {self.runs:,} runs; at most {MAX_RUNS:,}")

    def _check_axes(self) -> None:
        """No axis is called like a column, and none undoes what another sets."""
        set_by = dict.fromkeys(self.settings, "'set'")
        for name, axis in self.axes.items():
            if name in COLUMNS:
                text = "is a column of the table already; call the axis otherwise"
                raise SettingError(f"axes.{name}", text)
            for path in sorted(axis.settings_paths):
                for earlier, owner in set_by.items():
                    if owner != f"axis {name!r}" and (
                        earlier == path or earlier.startswith((f"{path}.", f"{path}["))
                    ):
                        text = f"{path} would undo {earlier}, set by {owner}"
                        raise SettingError(f"axes.{name}.set", text)
                set_by[path] = f"axis {name!r}"
        if "seed" in set_by:
            raise SettingError("seeds", f"say which seeds are run; {set_by['seed']} must not")

    @property
    def runs(self) -> int:
        """How many runs the points and seeds make."""
        return (
            math.prod(len(self.axes[name].levels()) for name in self.crossed)
            * (self.samples or 1)
            * len(self.seeds)
        )

    @property
    def crossed(self) -> list[str]:
        """The axes of which every combination is made."""
        return [name for name, axis in self.axes.items() if not axis.sampled]

    @property
    def columns(self) -> dict[str, str]:
        """The column of each axis in the tables: its name, and its unit in brackets."""
        return {
            name: f"{name} [{axis.unit}]" if axis.unit else name for name, axis in self.axes.items()
        }

    def points(self) -> "Iterator[SweepPoint]":
        """All points, the last crossed axis and the samples changing fastest."""
        fixed = dict(self.settings)
        crossed = {name: axis.levels() for name, axis in self.axes.items() if not axis.sampled}
        sampled = {name: axis for name, axis in self.axes.items() if axis.sampled}
        samples = {
            name: axis.samples(name, self.samples or 0, self.sample_seed)
            for name, axis in sampled.items()
        }
        for combination in itertools.product(*crossed.values()):
            for sample in zip(*samples.values(), strict=True) if samples else [()]:
                values = dict(zip((*crossed, *samples), (*combination, *sample), strict=True))
                settings = fixed | {
                    path: value for name in self.axes for path, value in values[name][1].items()
                }
                scenario = settings.pop(SCENARIO, self.scenario)
                overrides = tuple(f"{path}={inline(value)}" for path, value in settings.items())
                yield SweepPoint(
                    tuple(values[name][0] for name in self.axes), str(scenario), overrides
                )


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """One combination: the values of the axes, in their order, and the scenario and overrides that
    follow, which are as on the command line.
    """

    levels: tuple[Level, ...]
    scenario: str
    overrides: tuple[str, ...]


def named_axes(axes: Mapping[str, Any]) -> dict[str, Any]:
    """Axes as in a file. A list stands for an axis along the setting that its name says, a path;
    it is called by the last word of the path, or by all of them where that name is taken.
    """
    words = {path: re.findall(r"\w+", path) for path, axis in axes.items() if _is_list(axis)}
    lasts = [of_path[-1] for of_path in words.values() if of_path]
    reserved = {*COLUMNS, *(axes.keys() - words.keys())}
    axes_by_name = {}
    for path, axis in axes.items():
        if not words.get(path):
            axes_by_name[path] = axis
            continue
        last = words[path][-1]
        is_free = last not in reserved and lasts.count(last) == 1
        name = last if is_free else "_".join(words[path])
        axes_by_name[name] = {"set": path, "list": list(axis)}
    return axes_by_name


def sweep_of(
    scenario: str, axes: Mapping[str, Any], methods: Sequence[str], more: Mapping[str, Any]
) -> dict[str, Any]:
    """A sweep of a scenario along axes, as in a file, with ``more`` of its fields. Its name, and so
    its folder, is that of all sweeps that differ in nothing but the values of the axes, samples and
    seeds. Raises ``UserError``.
    """
    path = files.find(files.SCENARIO, scenario)
    if not axes:
        raise UserError("axes: expected at least one, such as {'genie.passes': [1, 2]}")
    axes_by_name = named_axes(axes)
    paths = [
        axis.get("set") if isinstance(axis, Mapping) else axis for axis in axes_by_name.values()
    ]
    identity = [read_text(path), paths, dict(more.get("set", {})), list(methods), VERSION]
    digest = hashlib.sha256(json.dumps(identity, default=str).encode()).hexdigest()[:8]
    name = "-".join((path.stem, *axes_by_name))[:MAX_NAME]
    described = {"name": f"{name}-{digest}", "scenario": scenario, **more, "axes": axes_by_name}
    return {key: value for key, value in described.items() if value}


def design_of(scenario: Scenario, seeds: int | Sequence[int]) -> Design:
    """A run with several seeds, or so many: 5 are the seeds 1 to 5. Its name, and so its folder, is
    that of all runs that differ in nothing but the seed. Raises ``UserError``.
    """
    facts = {**plain_data(scenario), "seed": None, "genie_sim": VERSION}
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]
    data = {
        "name": f"{scenario.name[:MAX_SCENARIO]}-{digest}-seeds",
        "scenario": scenario.name,
        "seeds": seeds if isinstance(seeds, int) else list(seeds),
    }
    return read_design(data, scenario.name)


def _is_list(axis: object) -> bool:
    return isinstance(axis, Iterable) and not isinstance(axis, str | Mapping)


def fixed_settings(overrides: Sequence[str]) -> dict[str, Any]:
    """``path=value`` texts as settings. Raises ``UserError``."""
    fixed = {}
    for text in overrides:
        path, equals, value = text.partition("=")
        if not equals or not path.strip():
            raise UserError(f"--set {text}: must be path=value, such as image_encoding=raw")
        fixed[path.strip()] = parse(value, f"--set {text}")
    return fixed


def refuse_scenario(name: str | Path) -> NoReturn:
    """Raises ``UserError`` for a scenario where a sweep is expected."""
    raise UserError(
        f"{name} is a scenario: say what varies, such as --axis fleet.cars=10,20, or run it "
        f"with several seeds: genie-sim run {name} --seeds 5"
    )


def load_design(
    path_or_name: str | Path,
    settings: Mapping[str, Any] | None = None,
    more: Mapping[str, Any] | None = None,
) -> Design:
    """A sweep file, by path or by name, with further fixed ``settings``, and with ``more`` of its
    fields otherwise, where they are not ``None``. Raises ``UserError``.
    """
    is_sweep = path_or_name in files.available(files.SWEEP)
    if not is_sweep and path_or_name in files.available(files.SCENARIO):
        refuse_scenario(path_or_name)
    path = files.find(files.SWEEP, path_or_name)
    data = {"name": path.stem, **read_mapping(path)}
    if data.keys() & {"cars", "fleet"}:
        refuse_scenario(path_or_name)
    data.update({key: value for key, value in (more or {}).items() if value is not None})
    fixed = data.get("set") or {}
    if settings and isinstance(fixed, Mapping):
        data["set"] = {**fixed, **settings}
    return read_design(data, str(path))


def read_design(data: Mapping[str, Any], where: str) -> Design:
    """A sweep as in YAML; ``where`` it comes from is in front of what is wrong with it. Raises
    ``UserError``.
    """
    return settings.read(Design, data, lambda field: where)
