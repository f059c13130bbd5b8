"""Ways to read the paper where it leaves something open: what each sets, means by its metrics, and why."""

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from genie_sim.errors import UserError, unknown
from genie_sim.paper.definitions import DEFINITIONS
from genie_sim.scenario.fields import Listed, Model, problem, validate
from genie_sim.scenario.yaml_input import read_mapping

FOLDER = Path(__file__).with_name("readings")
DEFAULT = "default"
NAMES = (DEFAULT, "two_passes", "bench")  # in the order in which they are shown

Text = Annotated[str, Field(min_length=1)]
Texts = Annotated[tuple[Text, ...], Listed]


class Choice(Model):
    """Settings that a reading changes, what the paper says of them, and why they follow from it."""

    settings: Texts = Field(alias="set")
    quote: Text
    why: Text


class Definition(Model):
    """What a reading means by a metric: a name in ``DEFINITIONS``, in words, what the paper says, and why."""

    definition: Text
    says: Text
    quote: Text
    why: Text


class Metrics(Model):
    """What a reading means by each metric; ``None``: what the default reading means."""

    time: Definition | None = None
    image_reuse: Definition | None = None
    error_bars: Definition | None = None
    boost: Definition | None = None


class Reading(Model):
    """One file of ``readings/``. ``known``: of its outcomes, when it was written. ``fitted``: what it takes from the
    calibration."""

    name: str
    path: Path
    title: Text
    why: Text
    known: Text
    fitted: Annotated[tuple[Literal["overlap", "gate_m"], ...], Listed]
    choices: Annotated[tuple[Choice, ...], Listed]
    metrics: Metrics = Metrics()

    @model_validator(mode="after")
    def _definitions_exist(self) -> "Reading":
        for metric, definition in self.definitions.items():
            if definition not in DEFINITIONS[metric]:
                problem(
                    f"metrics.{metric}.definition",
                    unknown("definition", definition, DEFINITIONS[metric]),
                )
        return self

    @cached_property
    def definitions(self) -> dict[str, str]:
        """The definition of each metric that is not the default's."""
        given = ((metric, getattr(self.metrics, metric)) for metric in DEFINITIONS)
        return {metric: one.definition for metric, one in given if one is not None}

    @property
    def means_others(self) -> bool:
        """Whether some metric is not what the default means by it."""
        return any(
            DEFINITIONS[metric][definition] for metric, definition in self.definitions.items()
        )

    def settings(self, calibrated: Iterable[str]) -> tuple[str, ...]:
        """Settings of its runs: what it takes of those that were fitted, and what it sets."""
        fitted = (setting for setting in calibrated if setting.partition("=")[0] in self.fitted)
        return *fitted, *(setting for choice in self.choices for setting in choice.settings)

    def as_json(self) -> dict[str, Any]:
        """For ``readings.json``: each metric as the reading means it."""
        said = load_reading(DEFAULT).metrics.model_dump() | self.metrics.model_dump(
            exclude_none=True
        )
        return {**self.model_dump(by_alias=True, exclude={"path"}), "metrics": said}


def load_readings(name: str | None = None) -> list[Reading]:
    """All readings that come with the project, or the named one. Raises ``UserError``."""
    return [load_reading(one) for one in (NAMES if name is None else [name])]


def load_reading(name: str) -> Reading:
    """A reading by its name, or one's own by its path. Raises ``UserError``."""
    path = Path(name) if name.endswith(".yaml") else FOLDER / f"{name}.yaml"
    if path.parent == FOLDER and name not in NAMES:
        raise UserError(f"{unknown('reading', name, NAMES)}, or the path of a .yaml file")
    return validate(
        Reading, read_mapping(path) | {"name": path.stem, "path": path}, lambda _: str(path)
    )
