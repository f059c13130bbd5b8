"""Ways to read the paper where it leaves something open: what each sets, means by its metrics, and
why. A reading is an overlay of settings on the shipped scenarios, which are the main reading.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.settings import Key, SettingError, Text, plain_data, read
from genie_sim.paper.definitions import CHOICES, Definitions
from genie_sim.scenario.yaml_input import read_mapping

FOLDER = Path(__file__).with_name("readings")
MAIN = "bench"  # what the shipped scenarios are
NAMES = (MAIN, "two_passes", "street")  # in the order in which they are shown


@dataclass(frozen=True)
class SettingChoice:
    """Settings that a reading changes, what the paper says of them, and why they follow from it."""

    settings: Annotated[tuple[Text, ...], Key("set")]
    quote: Text
    why: Text


@dataclass(frozen=True)
class Definition:
    """What a reading means by a metric: a name in ``CHOICES``, in words, what the paper says,
    and why.
    """

    definition: Text
    says: Text
    quote: Text
    why: Text


@dataclass(frozen=True)
class Metrics:
    """What a reading means by each metric; ``None``: what the main reading means."""

    time: Definition | None = None
    image_reuse: Definition | None = None
    error_bars: Definition | None = None
    boost: Definition | None = None

    @property
    def defined(self) -> Mapping[str, Definition]:
        """The definition of each metric that the reading defines."""
        definitions = {metric: getattr(self, metric) for metric in CHOICES}
        return {
            metric: definition
            for metric, definition in definitions.items()
            if definition is not None
        }


@dataclass(frozen=True)
class Reading:
    """One file of ``readings/``. ``known``: of its outcomes, when it was written. ``retrodicted``:
    whether they were in sight when it was chosen, so that nothing that holds is a prediction.
    ``fitted``: what it takes from the calibration.
    """

    name: str
    title: Text
    why: Text
    known: Text
    retrodicted: bool
    fitted: tuple[Literal["overlap", "gate_m"], ...]
    choices: tuple[SettingChoice, ...]
    metrics: Metrics = Metrics()
    path: Path = field(default=Path(), metadata={"setting": False})

    def __post_init__(self) -> None:
        for metric, defined in self.metrics.defined.items():
            if defined.definition not in CHOICES[metric]:
                raise SettingError(
                    f"metrics.{metric}.definition",
                    unknown("definition", defined.definition, CHOICES[metric]),
                )

    @property
    def is_main(self) -> bool:
        return self.path == FOLDER / f"{MAIN}.yaml"

    @cached_property
    def definitions(self) -> Definitions:
        """What it means by the metrics."""
        chosen: dict[str, Any] = {
            metric: defined.definition for metric, defined in self.all_metrics.items()
        }
        return Definitions(**chosen)

    @property
    def all_metrics(self) -> Mapping[str, Definition]:
        """The definition of every metric, its own or the main reading's."""
        main = {} if self.is_main else load_reading(MAIN).metrics.defined
        return {**main, **self.metrics.defined}

    @property
    def title_of_column(self) -> str:
        """Its name, and whether what holds under it was known before."""
        return f"{self.name}, retrodicted" if self.retrodicted else self.name

    def settings(self, calibrated: Iterable[str]) -> tuple[str, ...]:
        """Settings of its runs: what it takes of those that were fitted, and what it sets; none of
        the main reading, which the scenarios are.
        """
        if self.is_main:
            return ()
        fitted = (setting for setting in calibrated if setting.partition("=")[0] in self.fitted)
        return *fitted, *(setting for choice in self.choices for setting in choice.settings)

    def as_json(self) -> dict[str, Any]:
        """For ``readings.json``: each metric as the reading means it."""
        metrics = {metric: plain_data(defined) for metric, defined in self.all_metrics.items()}
        return {**plain_data(self), "metrics": metrics}


def load_readings(name: str | None = None, names: Sequence[str] = NAMES) -> list[Reading]:
    """Some readings that come with the project, or the named one. Raises ``UserError``."""
    return [load_reading(path_or_name) for path_or_name in (names if name is None else [name])]


def load_reading(name: str) -> Reading:
    """A reading by its name, or one's own by its path. Raises ``UserError``."""
    path = Path(name) if name.endswith(".yaml") else FOLDER / f"{name}.yaml"
    if path.parent == FOLDER and name not in NAMES:
        raise UserError(f"{unknown('reading', name, NAMES)}, or the path of a .yaml file")
    data = read_mapping(path) | {"name": path.stem}
    return replace(read(Reading, data, lambda _: str(path)), path=path)
