"""A recorded link: rates and round trips as they were measured."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.links.recording import LinkRecording, StepFunction, read
from genie_sim.sim.link_model import LinkEnds, TimedTransmitter

if TYPE_CHECKING:
    from genie_sim.sim.network import Network


@dataclass(frozen=True)
class RecordedLink:
    """Links that replay recordings: `rate` of how many bits get through, `rtt` of round trips.

    Bits that are left at the end of a row are sent at the next row's rate; none are lost while it
    is 0. Every message takes half of the round trip at the time. The two recordings may be of
    different drives; then rates and round trips are not correlated as they would be.
    """

    rate: str | None = None
    """A recording with `up_bps`, `down_bps` or both, by name or path; `null`: the rates are
    constant."""

    rtt: str | None = "urban_n78_generated"
    """A recording with `rtt_ns`, by name or path; `null`: every message takes `delay`. The default
    is generated from the quantiles of CICV5G's urban drives on n78."""

    # Means over the UK's 5G networks [S: Ofcom, Mobile Matters 2023], as in the link nr5g.
    up_bps: int = 14_700_000
    """Rate to the edge where `rate` has no column `up_bps`."""

    down_bps: int = 129_900_000
    """Rate to the car where `rate` has no column `down_bps`."""

    delay_ns: int = 10 * NS_PER_MS
    """What every message takes where there is no `rtt`."""

    offset: Literal["per_car", "begin"] = "per_car"
    """Where in the recordings a car begins: at a place that is drawn for each car, in step for both
    directions and every edge; or for all cars at `begin`."""

    begin_ns: int = 0
    """Where in the recordings all cars begin, with `offset: begin`."""

    loop: bool = True
    """Whether the recordings begin again at their end; else their last row stays."""

    def recordings(self) -> Iterator[LinkRecording]:
        """The files that it replays. Raises ``UserError`` if they do not have what is needed."""
        if self.rate is not None:
            rate = read(self.rate)
            columns = [name for name in ("up_bps", "down_bps") if name in rate.columns]
            rate.check(*(columns or ["up_bps"]))
            for column in columns:
                rate.steps(column, self.loop)
            yield rate
        if self.rtt is not None:
            rtt = read(self.rtt)
            rtt.check("rtt_ns")
            yield rtt

    def check(self) -> None:
        """Raises ``UserError`` unless the recordings have what is needed."""
        list(self.recordings())

    def digests(self) -> Mapping[str, str]:
        """What decides the outcome: a digest of each file."""
        files = {"rate": self.rate, "rtt": self.rtt}
        read_files = {role: read(path) for role, path in files.items() if path is not None}
        return {f"{role} {file.path.stem}": file.digest for role, file in read_files.items()}

    def transmitter(self, network: "Network", ends: LinkEnds) -> "RecordedTransmitter":
        return RecordedTransmitter(self, network, ends)

    def steps(self, name: str | None, column: str, constant: int) -> StepFunction:
        """A recording's column over time; ``constant`` where it has none, or there is none."""
        recording = None if name is None else read(name)
        if recording is None or column not in recording.columns:
            return StepFunction([0], [constant], loops=True)
        return recording.steps(column, self.loop)

    def begin_in(self, steps: StepFunction, share: float) -> int:
        """Where in a recording a car begins [ns], whose draw is ``share``."""
        return self.begin_ns if self.offset == "begin" else int(share * steps.period_ns)


class RecordedTransmitter(TimedTransmitter):
    """One direction of a recorded link."""

    def __init__(self, link: RecordedLink, network: "Network", ends: LinkEnds) -> None:
        super().__init__(network, ends)
        column, constant_bps = ("up_bps", link.up_bps) if ends.up else ("down_bps", link.down_bps)
        self._rates = link.steps(link.rate, column, constant_bps)
        self._rtts = link.steps(link.rtt, "rtt_ns", 2 * link.delay_ns)
        name = ends.name if ends.car is None else ends.car  # both directions begin together
        share = network.draws("trace").uniform(name)
        self._rates_begin_ns = link.begin_in(self._rates, share)
        self._rtts_begin_ns = link.begin_in(self._rtts, share)

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        return self._rates.time_ns(self._rates_begin_ns + now_ns, size_bytes * 8 * NS_PER_S)

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        return self._rtts.at(self._rtts_begin_ns + now_ns) // 2
