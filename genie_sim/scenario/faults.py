"""The ``faults:`` of a scenario: what goes wrong where, and when."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from genie_sim import plugins
from genie_sim.errors import short_repr
from genie_sim.faults import FAULTS, MUST_HAVE
from genie_sim.plugins import Choice
from genie_sim.scenario.fields import Duration, Model, PositiveDuration, problem
from genie_sim.scenario.plain import OWN_CLASS_SCHEMA, PlugIn
from genie_sim.sim.fault import TimedFault


class FaultEntry(Model):
    """A fault and when it happens: once from ``begin_ns`` to ``end_ns`` (``None``: for as long as this kind of fault
    takes, or to the run's end); or, from ``begin_ns`` on, again and again with exponential times of these means."""

    fault: Choice
    begin_ns: Duration | None = Field(default=None, alias="begin")
    end_ns: Duration | None = Field(default=None, alias="end")
    mean_time_between_ns: PositiveDuration | None = Field(default=None, alias="mean_time_between")
    mean_duration_ns: PositiveDuration | None = Field(default=None, alias="mean_duration")

    @model_validator(mode="after")
    def _has_times(self) -> Self:
        if (self.mean_time_between_ns is None) != (self.mean_duration_ns is None):
            problem("mean_duration", "goes with 'mean_time_between', and that with it")
        if self.mean_time_between_ns is None and self.begin_ns is None:
            problem("begin", "missing; or give 'mean_time_between' and 'mean_duration'")
        if self.mean_time_between_ns is not None and self.end_ns is not None:
            problem("end", "a fault that happens again and again has a 'mean_duration' instead")
        if self.end_ns is not None and self.begin_ns is not None and self.end_ns <= self.begin_ns:
            problem("end", "must be after 'begin'")
        return self

    @property
    def target(self) -> Any:
        return self.fault.parameters.get("target")


_TIMES = tuple(name for name in FaultEntry.yaml_names() if name != "fault")
_PLUG_IN = PlugIn("fault", FAULTS, key="fault", beside=_TIMES)


def _read(value: object) -> object:
    """``{fault: outage, target: car1, begin: 3 s, end: 5 s}``: the times, and the arguments of the fault."""
    if isinstance(value, FaultEntry):
        return value
    if not isinstance(value, Mapping):
        problem(
            "",
            f"must be a mapping such as {{fault: outage, target: car1, begin: 3 s}}, not {short_repr(value)}",
        )
    if "fault" not in value:
        problem("fault", "missing")
    times = {key: item for key, item in value.items() if key in _TIMES}
    return {
        "fault": _PLUG_IN.read({key: item for key, item in value.items() if key not in _TIMES}),
        **times,
    }


def _write(entry: FaultEntry) -> dict[str, Any]:
    written = _PLUG_IN.write(entry.fault)
    assert isinstance(written, dict), "every fault has a target"
    times = entry.model_dump(mode="json", by_alias=True, exclude={"fault"}, exclude_none=True)
    return {**written, **times}


FaultField = Annotated[
    FaultEntry,
    BeforeValidator(_read),
    PlainSerializer(_write, when_used="json"),
    WithJsonSchema(
        {
            "type": "object",
            "properties": {"fault": {"anyOf": [{"enum": list(FAULTS)}, OWN_CLASS_SCHEMA]}},
            "required": ["fault"],
        }
    ),
]


def check_faults(
    faults: Sequence[FaultEntry],
    edge_of: Mapping[str, str | None],
    edges: Collection[str],
    own: bool = False,
) -> Iterator[tuple[str, str]]:
    """What is wrong with the faults: (field, text). ``edge_of`` names every car with its edge.

    The faults of one kind are looked at together, by the ``check`` of their class if it has one. Code of the user's
    ``own`` is not run to read a scenario, only to run it.
    """
    for kind in dict.fromkeys(
        entry.fault.name for entry in faults if own or entry.fault.name in FAULTS
    ):
        check = getattr(plugins.resolve("fault", kind, FAULTS, MUST_HAVE), "check", None)
        places = [place for place, entry in enumerate(faults) if entry.fault.name == kind]
        if check is not None:
            for place, field, text in check(
                [timed(faults[place], place) for place in places], edge_of, edges
            ):
                yield f"faults[{places[place]}].{field}", text


def timed(entry: FaultEntry, place: int) -> TimedFault:
    """A fault with its times. ``place`` among the scenario's faults names its random stream. Raises ``UserError``."""
    fault = plugins.make("fault", entry.fault, FAULTS, MUST_HAVE)
    begin_ns, end_ns = entry.begin_ns or 0, entry.end_ns
    duration_ns = getattr(fault, "duration_ns", None)
    if end_ns is None and duration_ns is not None:
        end_ns = begin_ns + duration_ns
    name = f"fault {place}"
    return TimedFault(
        fault, name, begin_ns, end_ns, entry.mean_time_between_ns, entry.mean_duration_ns or 0
    )
