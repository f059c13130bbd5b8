"""The space of a method: parameters, each with the settings that it sets."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from genie_sim.errors import unknown
from genie_sim.settings import Key, Name, NotEmpty, SettingError
from genie_sim.study.design import Axis, Cases, Level, NumberRange, check_paths, listed

# columns of the tables of a search
TABLE_COLUMNS = ("design", "method", "point", "state", "metric", "title", "runs", "settings")

Values = Mapping[str, Level]  # of the parameters that count at a point, by name


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
    def settings_paths(self) -> set[str]:
        """Every path that it sets."""
        return self.axis.settings_paths

    @property
    def levels(self) -> list[Level]:
        """The values of a list."""
        return [level for level, _ in self.axis.levels()]

    def settings(self, value: Level) -> dict[str, Any]:
        """The settings that follow from a value."""
        if self.range is not None:
            return self.axis.numeric(self.range, float(value))[1]
        return dict(self.axis.levels())[value]

    def rounded(self, value: float) -> float:
        """A drawn number as it is set: to six digits, within the range."""
        assert self.range is not None
        low, high = self.range.low.number, self.range.high.number
        return min(max(float(f"{value:.6g}"), low), high)


@dataclass(frozen=True, kw_only=True)
class Space:
    """What is searched of one method: fixed settings, and parameters."""

    description: str = ""
    """What it is for."""
    method: str
    """The method, by name."""
    title: str | None = None
    """What tables and figures call it; by default its own title."""
    settings: Annotated[dict[str, Any], Key("set")] = field(default_factory=dict)
    """Settings that are the same at all points, by path."""
    parameters: Annotated[dict[Name, Parameter], NotEmpty(), Key("space")]
    """What is searched, by name."""

    def __post_init__(self) -> None:
        before: dict[str, Parameter] = {}
        for name, parameter in self.parameters.items():
            if name in TABLE_COLUMNS:
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

    def free(self, fixed: Mapping[str, Any]) -> dict[str, Parameter]:
        """The parameters, without those whose settings are fixed already."""
        return {
            name: parameter
            for name, parameter in self.parameters.items()
            if not parameter.settings_paths & fixed.keys()
        }

    def known(self, fixed: Mapping[str, Any]) -> Values:
        """The values of those lists whose settings are fixed, for the conditions of others."""
        return {
            name: level
            for name, parameter in self.parameters.items()
            if parameter.cases is not None
            for level in parameter.levels
            if parameter.settings(level).items() <= fixed.items() and parameter.settings(level)
        }

    def overrides(self, name: str, values: Values, settings: Mapping[str, Any]) -> tuple[str, ...]:
        """The overrides, as on the command line, that make a point of this space.

        Parameters
        ----------
        name : str
            What tables call the method.
        values : mapping
            Of the parameters.
        settings : mapping
            Fixed settings of the search, below those of the space.
        """
        method: dict[str, Any] = {"name": name, "method": self.method}
        if self.title is not None:
            method["title"] = self.title
        scenario: dict[str, Any] = {}
        of_values = [self.parameters[key].settings(value) for key, value in values.items()]
        for group in (settings, self.settings, *of_values):
            for path, value in group.items():
                is_own, own = path.startswith("method."), path.removeprefix("method.")
                (method if is_own else scenario)[own] = value
        return (
            f"methods={as_json([method])}",
            *(f"{path}={as_json(value)}" for path, value in scenario.items()),
        )

    def samples(self, fixed: Mapping[str, Any]) -> Iterator[tuple[str, Values]]:
        """Points that together use every value of every list and both ends of every range, each
        with the name of the parameter it is about.
        """
        free, known = self.free(fixed), self.known(fixed)
        for name, parameter in free.items():
            base = _base(free, name)
            if not is_active(parameter, {**known, **base}):
                continue
            for value in _extremes(parameter):
                yield name, {**base, name: value}

    def unit(self, name: str) -> str:
        """Of a parameter's values; may be empty."""
        return self.parameters[name].axis.unit


def is_active(parameter: Parameter, values: Values) -> bool:
    """Whether a parameter counts, given the values of those before it."""
    return all(values.get(name) in allowed for name, allowed in parameter.when.items())


def _extremes(parameter: Parameter) -> Sequence[Level]:
    if parameter.range is not None:
        return parameter.range.low.number, parameter.range.high.number
    return parameter.levels


def _base(free: Mapping[str, Parameter], name: str) -> dict[str, Level]:
    """Values under which a parameter counts: those that its conditions name."""
    values: dict[str, Level] = {}
    for other, allowed in free[name].when.items():
        if other in free:
            values = {**_base(free, other), **values, other: allowed[0]}
    return values


def as_json(value: object) -> str:
    """JSON is YAML, and says of a text that it is one."""
    return json.dumps(value, ensure_ascii=False)
