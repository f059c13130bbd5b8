"""The ``faults:`` of a scenario: what goes wrong where, and when."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from genie_sim.base.contracts import WHOLE, is_whole, require
from genie_sim.base.errors import short_repr
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import PlugIn, written
from genie_sim.base.units import NS_PER_MS, duration_text
from genie_sim.sim.fault import FAULT_PARTS, FAULTS, FaultTimes, TimedFault

# From one beginning of a fault to the next, on average. Every beginning is an event and a row of a
# table: in microseconds a second would have a million of them.
SHORTEST_NS = NS_PER_MS

FAULT = PlugIn("fault", FAULTS, FAULT_PARTS, key="fault", beside=(FaultTimes,))


@dataclass(frozen=True, kw_only=True)
class FaultEntry(FaultTimes):
    """A fault and when it happens. In YAML its own settings stand beside the times."""

    fault: Annotated[Choice, FAULT]
    """The kind of fault, or a class of your own."""

    def __post_init__(self) -> None:
        again = self.mean_time_between_ns is not None
        if again != (self.mean_duration_ns is not None):
            text = "'mean_time_between' and 'mean_duration' must be given together"
            raise SettingError("mean_duration", text)
        if not again and self.begin_ns is None:
            text = "missing; or give 'mean_time_between' and 'mean_duration'"
            raise SettingError("begin", text)
        if again and (self.mean_time_between_ns or 0) + (self.mean_duration_ns or 0) < SHORTEST_NS:
            shortest = duration_text(SHORTEST_NS)
            given = duration_text(self.mean_time_between_ns or 0)
            text = f"must be at least {shortest} together with 'mean_duration', but is {given}"
            raise SettingError("mean_time_between", text)
        if again and self.end_ns is not None:
            text = "a fault that happens again and again has a 'mean_duration' instead"
            raise SettingError("end", text)
        if self.end_ns is not None and self.begin_ns is not None and self.end_ns <= self.begin_ns:
            raise SettingError("end", "must be after 'begin'")

    @classmethod
    def expand(cls, value: object) -> object:
        """Takes the settings of the fault out of ``{fault: outage, target: car1, begin: 3 s}``."""
        if not isinstance(value, Mapping):
            example = "{fault: outage, target: car1, begin: 3 s}"
            text = f"must be a mapping such as {example}, not {short_repr(value)}"
            raise SettingError("", text)
        if "fault" not in value:
            raise SettingError("fault", "missing")
        beside = FAULT.keys_beside
        times = {key: item for key, item in value.items() if key in beside}
        others = {key: item for key, item in value.items() if key not in beside}
        return {"fault": FAULT.read(others), **times}

    def shorten(self) -> object:
        """The settings of the fault beside its times."""
        fault = FAULT.written(self.fault)
        if isinstance(fault, str):  # one of the user's own, with its defaults alone
            fault = {FAULT.key: fault}
        times = written(FaultTimes, vars(self))
        return {**fault, **{key: item for key, item in times.items() if item is not None}}

    @property
    def target(self) -> Any:
        """What the fault befalls, as its settings say."""
        return self.fault.parameters.get("target")


def check_faults(
    faults: Sequence[FaultEntry],
    edge_of: Mapping[str, str | None],
    edges: Collection[str],
    own: bool = False,
) -> Iterator[tuple[str, str]]:
    """What is wrong with the faults: (field, text).

    The faults of one kind are checked together, by the ``check`` of their class if it has one.

    Parameters
    ----------
    faults : sequence of FaultEntry
        All faults of a scenario.
    edge_of : mapping
        Every car with its edge.
    edges : collection of str
        The edges.
    own : bool
        Whether to check faults of the user's own, too: their code runs only where a scenario does.
    """
    names = [entry.fault.name for entry in faults if own or entry.fault.name in FAULTS]
    for kind in dict.fromkeys(names):
        check = getattr(FAULT.resolve(kind), "check", None)
        places = [place for place, entry in enumerate(faults) if entry.fault.name == kind]
        if check is not None:
            for place, field, text in check(
                timed([faults[place] for place in places]), edge_of, edges
            ):
                yield f"faults[{places[place]}].{field}", text


def timed(entries: Iterable[FaultEntry]) -> list[TimedFault]:
    """Faults with their times. The random stream of each is named by its kind, its target and its
    number among those that share both. Raises ``UserError``.
    """
    numbers: Counter[str] = Counter()
    faults: list[TimedFault] = []
    for entry in entries:
        alike = f"fault {entry.fault.name} {entry.target}"
        numbers[alike] += 1
        faults.append(_timed(entry, f"{alike} {numbers[alike]}"))
    return faults


def _timed(entry: FaultEntry, name: str) -> TimedFault:
    fault = FAULT.make(entry.fault)
    begin_ns, end_ns = entry.begin_ns or 0, entry.end_ns
    duration_ns = getattr(fault, "duration_ns", None)
    holds = duration_ns is None or is_whole(duration_ns)
    require(holds, f"fault {entry.fault.name!r}: duration_ns", duration_ns, WHOLE)
    if end_ns is None and duration_ns is not None:
        end_ns = begin_ns + duration_ns
    return TimedFault(
        fault=fault,
        name=name,
        kind=entry.fault.name,
        begin_ns=begin_ns,
        end_ns=end_ns,
        mean_time_between_ns=entry.mean_time_between_ns,
        mean_duration_ns=entry.mean_duration_ns or 0,
    )
