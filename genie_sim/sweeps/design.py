"""What a sweep varies, read from a small YAML file, and the points that follow from it.

Every combination of the ``grid`` and ``list`` axes is made; each combination is made once for every joint sample of
the ``random`` and ``latin_hypercube`` axes; and each point is run with every seed.
"""

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BeforeValidator, Field, model_validator

from genie_sim import files, units
from genie_sim.errors import short_repr
from genie_sim.scenario.fields import Model, Name, problem, validate
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.seeds import stream

SCENARIO = (
    "scenario"  # the one path of an axis that is no setting of a scenario but names another one
)
MOST_RUNS = 1_000_000
COLUMNS = (  # of the tables
    "point", "seed", "run_id", "metric", "method", "placement", "component", "value", "unit", "low", "high", "n", "runs"
)  # fmt: skip
PANELS = {  # the main metrics -> label of their panel in figures
    "image_reuse": "image reuse",
    "object_reuse": "object reuse",
    "confidence_boost": "confidence boost",
    "first_answer_mean": "first answer [ms]",
    "fresh_answer_mean": "fresh answer [ms]",
    "under_deadline_share": "answered in 33 ms",
    "fresh_answered_share": "with a fresh answer",
    "streaming_f1": "streaming F1",
    "ghost_share": "ghost share",
    "object_recall": "object recall",
}
LOGARITHMIC_FROM = 20.0  # a list that spans so much, largest to smallest
UNITS = {*units.DURATIONS, *units.SIZES, *units.RATES, *units.LENGTHS, *units.ANGLES, "entries"}
_QUANTITY = re.compile(
    r"([+-]?\d{1,15}(?:\.\d{1,15})?(?:[eE][+-]?\d{1,2})?)(?:\s*([^\s\d]\S*))?", re.ASCII
)

Value = TypeVar("Value")
Level = float | str  # the value of an axis at a point, as the tables show it


def _quantity(value: object) -> tuple[float, str] | None:
    """``"0.5 m"`` to ``(0.5, "m")``, 3 to ``(3.0, "")``; None for everything else."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), ""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    return (
        (float(match[1]), match[2] or "")
        if match and (match[2] is None or match[2] in UNITS)
        else None
    )


def _end(value: object) -> tuple[float, str]:
    quantity = _quantity(value)
    if quantity is None:
        raise ValueError(
            f"must be a number, or one with a unit such as '0.5 m', not {short_repr(value)}"
        )
    return quantity


class Span(Model):
    """Numbers from ``from`` to ``to``, both included, evenly spread on a linear or logarithmic scale."""

    low: Annotated[tuple[float, str], BeforeValidator(_end)] = Field(alias="from")
    high: Annotated[tuple[float, str], BeforeValidator(_end)] = Field(alias="to")
    scale: Literal["linear", "log"] = "linear"
    whole: bool = False

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.low[1] != self.high[1]:
            problem(
                "to",
                f"must have the unit of 'from', {self.low[1] or 'none'}, not {self.high[1] or 'none'}",
            )
        if not self.low[0] < self.high[0]:
            problem("to", "must be more than 'from'")
        if self.scale == "log" and self.low[0] <= 0:
            problem("from", "must be more than zero on a logarithmic scale")
        if self.whole and not (self.low[0].is_integer() and self.high[0].is_integer()):
            problem("whole", "needs whole numbers in 'from' and 'to'")
        return self

    @property
    def unit(self) -> str:
        """Of both ends, and so of every value; may be empty."""
        return self.low[1]

    def at(self, share: float) -> float:
        """The value at a share of the way, to six digits; whole numbers have equal shares of it."""
        low, high = self.low[0], self.high[0] + self.whole
        value = low * (high / low) ** share if self.scale == "log" else low + (high - low) * share
        return float(min(int(value), self.high[0])) if self.whole else float(f"{value:.6g}")


class Grid(Span):
    """So many ``points``, both ends among them."""

    points: Annotated[int, Field(ge=2, le=MOST_RUNS)]

    def values(self) -> list[float]:
        """Evenly spaced, rising."""
        exact = self.model_copy(update={"whole": False})
        values = [exact.at(index / (self.points - 1)) for index in range(self.points)]
        return [float(round(value)) for value in values] if self.whole else values


def _paths(value: object) -> object:
    return (
        (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list) else value
    )


class Axis(Model):
    """One thing that is varied: the settings it sets, and one of the four ways to vary it.

    Several settings get the same value. A ``list`` without ``set`` names cases, each with settings of its own.
    """

    paths: Annotated[tuple[str, ...], BeforeValidator(_paths)] = Field(default=(), alias="set")
    grid: Grid | None = None
    cases: list[Any] | dict[str, dict[str, Any]] | None = Field(default=None, alias="list")
    random: Span | None = None
    latin_hypercube: Span | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        ways = {
            "grid": self.grid,
            "list": self.cases,
            "random": self.random,
            "latin_hypercube": self.latin_hypercube,
        }
        given = [name for name, way in ways.items() if way is not None]
        if len(given) != 1:
            problem(
                "",
                f"must have exactly one of {', '.join(ways)}, has {' and '.join(given) or 'none'}",
            )
        if isinstance(self.cases, dict) == bool(self.paths):
            problem(
                "set",
                "is not for named cases" if self.paths else "missing; say which setting is varied",
            )
        if self.cases is not None and not self.cases:
            problem("list", "must not be empty")
        if self.span is None or self.span is self.grid:
            twice = _twice(level for level, _ in self.levels())
            if twice is not None:
                problem(given[0], f"the value {short_repr(twice)} comes twice")
        return self

    @property
    def span(self) -> Span | None:
        """Of numbers; None for a list."""
        return self.grid or self.random or self.latin_hypercube

    @property
    def sampled(self) -> bool:
        """Drawn, not crossed."""
        return self.random is not None or self.latin_hypercube is not None

    @property
    def unit(self) -> str:
        """Of its values, if they are numbers with one."""
        if self.span is not None:
            return self.span.unit
        quantities = self._quantities()
        return quantities[0][1] if quantities else ""

    @property
    def settings_paths(self) -> set[str]:
        """Every path that it sets."""
        named = self.cases.values() if isinstance(self.cases, dict) else ()
        return {*self.paths, *(path for settings in named for path in settings)}

    def levels(self) -> list[tuple[Level, dict[str, Any]]]:
        """The values of a crossed axis and the settings of each."""
        if self.grid is not None:
            return [self._numeric(self.grid, value) for value in self.grid.values()]
        if isinstance(self.cases, dict):
            return list(self.cases.items())
        listed = self.cases or []
        quantities = self._quantities()
        texts = [value if isinstance(value, str) else _text(value) for value in listed]
        names: Sequence[Level] = [number for number, _ in quantities] if quantities else texts
        return [
            (name, dict.fromkeys(self.paths, value))
            for name, value in zip(names, listed, strict=True)
        ]

    def samples(self, name: str, count: int, seed: int) -> list[tuple[Level, dict[str, Any]]]:
        """``count`` values of a sampled axis, drawn from the random stream of the axis' name.

        ``random``: independent, so more samples keep the earlier ones. ``latin_hypercube``: one in each of ``count``
        equal parts of the span.
        """
        rng = stream(seed, "sweep", name)
        span = self.random or self.latin_hypercube
        assert span is not None
        shares = (
            rng.random(count)
            if self.random is not None
            else (rng.permutation(count) + rng.random(count)) / count
        )
        return [self._numeric(span, span.at(float(share))) for share in shares]

    def _numeric(self, span: Span, value: float) -> tuple[Level, dict[str, Any]]:
        number = int(value) if value.is_integer() else value
        text = str(number) if span.whole else f"{number:g}"
        return value, dict.fromkeys(self.paths, f"{text} {span.unit}" if span.unit else number)

    def _quantities(self) -> list[tuple[float, str]] | None:
        """A list's numbers and their one unit; None for a list of other things."""
        if not isinstance(self.cases, list):
            return None
        quantities = [
            quantity for value in self.cases if (quantity := _quantity(value)) is not None
        ]
        same = len(quantities) == len(self.cases) and len({unit for _, unit in quantities}) == 1
        return quantities if same else None


def _twice(values: Iterable[Value]) -> Value | None:
    return next((value for value, times in Counter(values).items() if times > 1), None)


def _text(value: object) -> str:
    """JSON is YAML, and says of a text that it is one."""
    return json.dumps(value, ensure_ascii=False)


def _seeds(value: object) -> object:
    """``5`` for short: the seeds 1 to 5."""
    if isinstance(value, int) and not isinstance(value, bool):
        if not 1 <= value <= MOST_RUNS:
            raise ValueError(f"must be a list, or how many: at least 1, not {value}")
        return tuple(range(1, value + 1))
    return tuple(value) if isinstance(value, list) else value


class Design(Model):
    """A sweep: a scenario with fixed settings, axes and seeds."""

    name: Name
    description: str = ""
    scenario: str
    settings: dict[str, Any] = Field(default={}, alias="set")
    seeds: Annotated[tuple[Annotated[int, Field(ge=0)], ...], BeforeValidator(_seeds), Field(min_length=1)] = (
        1, 2, 3, 4, 5,
    )  # fmt: skip
    samples: Annotated[int, Field(ge=1, le=MOST_RUNS)] | None = None
    sample_seed: Annotated[int, Field(ge=0)] = 1
    axes: Annotated[dict[Name, Axis], Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        twice = _twice(self.seeds)
        if twice is not None:
            problem("seeds", f"the seed {twice} comes twice")
        sampled = [name for name, axis in self.axes.items() if axis.sampled]
        if sampled and self.samples is None:
            problem("samples", f"missing; axis {sampled[0]!r} needs to know how many")
        if not sampled and self.samples is not None:
            problem(
                "samples", "has no effect without an axis that is 'random' or 'latin_hypercube'"
            )
        set_by = dict.fromkeys(self.settings, "'set'")
        for name, axis in self.axes.items():
            if name in COLUMNS:
                problem(f"axes.{name}", "is a column of the table already; call the axis otherwise")
            for path in sorted(axis.settings_paths):
                for earlier, who in set_by.items():
                    if who != f"axis {name!r}" and (
                        earlier == path or earlier.startswith((f"{path}.", f"{path}["))
                    ):
                        problem(f"axes.{name}.set", f"{path} would undo {earlier}, set by {who}")
                set_by[path] = f"axis {name!r}"
        if "seed" in set_by:
            problem("seeds", f"say which seeds are run; {set_by['seed']} must not")
        if self.runs > MOST_RUNS:
            problem("axes", f"make {self.runs:,} runs; at most {MOST_RUNS:,}")
        return self

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

    def points(self) -> "Iterator[Point]":
        """All points, the last crossed axis and the samples changing fastest."""
        fixed = dict(self.settings)
        crossed = {name: axis.levels() for name, axis in self.axes.items() if not axis.sampled}
        sampled = {name: axis for name, axis in self.axes.items() if axis.sampled}
        drawn = {
            name: axis.samples(name, self.samples or 0, self.sample_seed)
            for name, axis in sampled.items()
        }
        for combination in itertools.product(*crossed.values()):
            for sample in zip(*drawn.values(), strict=True) if drawn else [()]:
                chosen = dict(zip((*crossed, *drawn), (*combination, *sample), strict=True))
                settings = fixed | {
                    path: value for name in self.axes for path, value in chosen[name][1].items()
                }
                scenario = settings.pop(SCENARIO, self.scenario)
                overrides = tuple(f"{path}={_text(value)}" for path, value in settings.items())
                yield Point(tuple(chosen[name][0] for name in self.axes), str(scenario), overrides)


@dataclass(frozen=True, slots=True)
class Point:
    """One combination: the values of the axes, in their order, and the scenario and overrides that follow, which are
    as on the command line."""

    levels: tuple[Level, ...]
    scenario: str
    overrides: tuple[str, ...]


def spans_much(numbers: Sequence[float]) -> bool:
    """Whether a list of values is better drawn on a logarithmic axis."""
    return min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def load_design(path_or_name: str | Path) -> Design:
    """A sweep file, by path or by name. Raises ``UserError``."""
    path = files.find(files.SWEEP, path_or_name)
    return read_design({"name": path.stem, **read_mapping(path)}, str(path))


def read_design(data: Mapping[str, Any], where: str) -> Design:
    """A sweep as in YAML; ``where`` it comes from is in front of what is wrong with it. Raises ``UserError``."""
    return validate(Design, data, lambda field: where)
