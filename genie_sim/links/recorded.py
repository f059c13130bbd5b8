"""A recorded link: rates and round trips as they were measured."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.links.recording import LinkRecording, StepFunction, read
from genie_sim.sim.link_model import LinkEnds, TimedSender

if TYPE_CHECKING:
    from genie_sim.sim.network import Network

PlaceInRecording = Callable[[int], int]  # the recording's time by the run's [ns]


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

    offset: Literal["per_car", "position", "begin"] = "per_car"
    """Where in the recordings a car begins: at a place that is drawn for each car, in step for both
    directions and every edge; at the row whose position (`east_m`, `north_m`) is nearest to the
    car's, at any time; or for all cars at `begin`."""

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
        for recording in self.recordings():
            if self.offset == "position":
                recording.check("east_m", "north_m")

    def digests(self) -> Mapping[str, str]:
        """What decides the outcome: a digest of each file."""
        files = {"rate": self.rate, "rtt": self.rtt}
        read_files = {role: read(path) for role, path in files.items() if path is not None}
        return {f"{role} {file.path.stem}": file.digest for role, file in read_files.items()}

    def sender(self, network: "Network", ends: LinkEnds) -> "RecordedSender":
        column, constant_bps = ("up_bps", self.up_bps) if ends.up else ("down_bps", self.down_bps)
        rate = None if self.rate is None else read(self.rate)
        if rate is not None and column in rate.columns:
            rates = rate.steps(column, self.loop)
            rates_at = self._position(network, ends, rate, rates.period_ns)
        else:
            rates, rates_at = _constant(constant_bps)
        if self.rtt is not None:
            rtt = read(self.rtt)
            rtts = rtt.steps("rtt_ns", self.loop)
            rtts_at = self._position(network, ends, rtt, rtts.period_ns)
        else:
            rtts, rtts_at = _constant(2 * self.delay_ns)
        return RecordedSender(
            network, ends, rates=rates, rates_at=rates_at, rtts=rtts, rtts_at=rtts_at
        )

    def _position(
        self, network: "Network", ends: LinkEnds, recording: LinkRecording, period_ns: int
    ) -> PlaceInRecording:
        """Where in a recording a link is at a time [ns]."""
        if self.offset == "begin":
            return lambda now_ns: now_ns + self.begin_ns
        if self.offset == "position" and ends.car is not None:
            return _nearest(recording, network, ends.car)
        name = ends.name if ends.car is None else ends.car  # both directions begin together
        offset_ns = int(network.draws("trace").uniform(name) * period_ns)
        return lambda now_ns: now_ns + offset_ns


def _constant(value: int) -> tuple[StepFunction, PlaceInRecording]:
    """A quantity that no recording has, as steps, and the same time in them."""
    return StepFunction([0], [value], loops=True), lambda now_ns: now_ns


def _nearest(recording: LinkRecording, network: "Network", car: str) -> PlaceInRecording:
    """The time of the row that is nearest to where the car is."""
    east_m, north_m = (np.array(recording.columns[name]) for name in ("east_m", "north_m"))

    def at_ns(now_ns: int) -> int:
        car_east_m, car_north_m = network.place(car)
        row = int(np.argmin((east_m - car_east_m) ** 2 + (north_m - car_north_m) ** 2))
        t_ns: int = recording.columns["t_ns"][row]
        return t_ns

    return at_ns


class RecordedSender(TimedSender):
    """One direction of a recorded link.

    Parameters
    ----------
    network : Network
        Where the link is.
    ends : LinkEnds
        Which direction of which link.
    rates, rtts : StepFunction
        The rate [bit/s] and the round trip [ns] over the recordings' time.
    rates_at, rtts_at : callable
        Where in the recordings it is at a time [ns].
    """

    def __init__(
        self,
        network: "Network",
        ends: LinkEnds,
        *,
        rates: StepFunction,
        rates_at: PlaceInRecording,
        rtts: StepFunction,
        rtts_at: PlaceInRecording,
    ) -> None:
        super().__init__(network, ends)
        self._rates, self._rates_at = rates, rates_at
        self._rtts, self._rtts_at = rtts, rtts_at

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        return self._rates.time_ns(self._rates_at(now_ns), size_bytes * 8 * NS_PER_S)

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        return self._rtts.at(self._rtts_at(now_ns)) // 2
