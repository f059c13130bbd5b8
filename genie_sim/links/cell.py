"""A radio cell: one antenna at each edge, whose capacity is shared by the cars that send."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import simpy

from genie_sim.base.marks import Bounds, Count
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.links.path_loss import StreetCanyon
from genie_sim.sim.clock import Occupancy, Steps
from genie_sim.sim.link_model import LinkEnds, Transmitter
from genie_sim.sim.network import Network

PLACES_NS = 100 * NS_PER_MS  # how often the rates follow the cars' places
# A message whose car has no coverage for so long is lost: 3GPP's T310, after which a radio link has
# failed, at its usual 1 s (TS 38.331).
FAILURE_NS = NS_PER_S
THERMAL_NOISE_DBM = -174.0  # of 1 Hz at room temperature
# 3GPP TR 36.942, annex A.2: a link reaches the share ``alpha`` of Shannon's bound, at most so many
# bit/s/Hz in each layer, and nothing below this ratio of signal to interference and noise.
ALPHA_UP, MAX_UP = 0.4, 2.0
ALPHA_DOWN, MAX_DOWN = 0.6, 4.4
MIN_SINR = 0.1  # -10 dB
PART_HZ = 360_000  # the least part of the band: a resource block of 12 times 30 kHz (TS 38.211)
MHZ = 10**6


@dataclass(frozen=True)
class Band:
    """One direction of a cell."""

    bandwidth_hz: Annotated[int, Bounds(above=0)]
    """Its bandwidth."""

    layers: Count = 2
    """Spatial layers that a car sends or receives at once."""


@dataclass(frozen=True)
class NoiseFigure:
    """How much noise a receiver adds."""

    up_db: float = 5.0
    """That of the antenna's receiver. Assumed."""

    down_db: float = 9.0
    """That of a car's receiver. Assumed."""


@dataclass(frozen=True)
class Power:
    """With how much power is sent."""

    up_dbm: float = 23.0
    """By a car: power class 3 of 3GPP TS 38.101."""

    down_dbm: float = 44.0
    """By the antenna: that of a micro cell in 3GPP TR 38.901, table 7.8-1."""


@dataclass
class RadioCell:
    """A radio cell at every edge. Its cars share each direction: of n that send now, each has the
    n-th part of the time (proportional fairness with full buffers).

    The rate of a car alone follows from its path loss to the edge's antenna, and is bounded by that
    of the best modulation. Where the power does not suffice for the whole band, it goes into the
    part that it suffices for; so a rate never falls with the bandwidth. Links with equal settings
    share the cells.
    """

    up: Band = Band(25 * MHZ)
    """From the cars to the edge."""

    down: Band = Band(75 * MHZ)
    """From the edge to the cars."""

    carrier_hz: Annotated[int, Bounds(above=0)] = 3500 * MHZ
    """The carrier's frequency."""

    path_loss: Literal["umi", "none"] = "umi"
    """`umi` is the street canyon of 3GPP TR 38.901, and needs the edges' places (`edges[].at`);
    with `none` every car has the rate of the best modulation, wherever it is."""

    shadowing: bool = True
    """Whether some places are shadowed more than others: a field over the ground that is the same
    for all cars."""

    noise_figure: NoiseFigure = NoiseFigure()
    """How much noise the receivers add."""

    power: Power = Power()
    """With how much power is sent."""

    interference_margin_db: Annotated[float, Bounds(minimum=0)] = 3.0
    """How much other cells raise the noise. Assumed."""

    delay_ns: int = 10 * NS_PER_MS
    """From the last bit sent until the message arrives. Assumed."""

    def __post_init__(self) -> None:
        self._losses: dict[str, StreetCanyon] = {}  # by the edge
        self._directions: dict[tuple[str, bool], CellDirection] = {}  # of each up and down

    @property
    def needs_sites(self) -> bool:
        """Whether every edge must have a place."""
        return self.path_loss != "none"

    needs_cars = True  # it cannot be the network between edges

    def transmitter(self, network: Network, ends: LinkEnds) -> "CellTransmitter":
        if not self._directions:
            for edge in network.edges:
                self._add_cell(network, edge)
        direction, loss = self._directions[ends.edge, ends.up], self._losses.get(ends.edge)
        return CellTransmitter(network, ends, cell=self, direction=direction, loss=loss)

    def _add_cell(self, network: Network, edge: str) -> None:
        """The cell of an edge: one direction up and one down."""
        site = network.site(edge) if self.needs_sites else None
        if site is not None:
            self._losses[edge] = StreetCanyon(
                network, edge, site, carrier_hz=self.carrier_hz, shadowing=self.shadowing
            )
        for up in (True, False):
            name = f"{edge}.cell_{'up' if up else 'down'}"
            direction = CellDirection(network, name, follows_places=self.needs_sites)
            self._directions[edge, up] = direction
            network.add_resource(direction)

    def sinr_db(self, up: bool, loss_db: float) -> float:
        """Signal to interference and noise at a path loss, with the power over the whole band."""
        band = self.up if up else self.down
        sent_dbm = self.power.up_dbm if up else self.power.down_dbm
        figure_db = self.noise_figure.up_db if up else self.noise_figure.down_db
        noise_dbm = THERMAL_NOISE_DBM + 10 * math.log10(band.bandwidth_hz) + figure_db
        return sent_dbm - loss_db - noise_dbm - self.interference_margin_db

    def rate_bps(self, up: bool, loss_db: float | None = None) -> int:
        """The rate of a car that sends alone, at a path loss; without one that of the best
        modulation.
        """
        band = self.up if up else self.down
        alpha, most = (ALPHA_UP, MAX_UP) if up else (ALPHA_DOWN, MAX_DOWN)
        efficiency, used_hz = most, float(band.bandwidth_hz)
        if loss_db is not None:
            sinr = 10 ** (self.sinr_db(up, loss_db) / 10)
            enough_hz = band.bandwidth_hz * sinr / MIN_SINR  # the power suffices for so much
            if enough_hz < PART_HZ:
                return 0
            used_hz = min(used_hz, enough_hz)
            efficiency = min(alpha * math.log2(1 + max(sinr, MIN_SINR)), most)
        return int(used_hz * band.layers * efficiency)


class CellTransmitter(Transmitter):
    """One direction of one car's link.

    Parameters
    ----------
    network : Network
        Where the link is.
    ends : LinkEnds
        Which direction of which car's link.
    cell : RadioCell
        How fast it would be alone.
    direction : CellDirection
        The direction of the cell that it shares.
    loss : StreetCanyon or None
        The path loss to the edge; ``None``: there is none.
    """

    def __init__(
        self,
        network: Network,
        ends: LinkEnds,
        *,
        cell: RadioCell,
        direction: "CellDirection",
        loss: StreetCanyon | None,
    ) -> None:
        super().__init__(network, ends)
        self._network = network
        self._ends = ends
        self._cell = cell
        self._direction = direction
        self._loss = loss
        self._done: simpy.Event | None = None  # happens when the present message has left
        self._is_available = True
        self._is_lost = False

    def alone_bps(self) -> int:
        """The rate that it would have alone, where its car is now."""
        car, up = self._ends.car, self._ends.up
        assert car is not None, "a cell has cars"
        if self._loss is None:
            return self._cell.rate_bps(up)
        return self._cell.rate_bps(up, self._loss.db(*self._network.place(car)))

    def transmit(self, size_bytes: int) -> simpy.Event:
        self._is_lost = False
        if not self._is_available:  # lost by what took the link away
            return self.clock.timeout(0)
        self._done = self.clock.event()
        self._direction.begin(self, size_bytes)
        return self._done

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        return None if self._is_lost else self._cell.delay_ns

    def set_available(self, is_available: bool) -> None:
        """Bits that were still to be sent when the link is taken away take nothing of the cell."""
        self._is_available = is_available
        if not is_available and self._done is not None:
            self._direction.give_up(self)
            self.end()

    def end(self, is_lost: bool = False) -> None:
        """The transmission is over."""
        done, self._done = self._done, None
        self._is_lost = is_lost
        assert done is not None, "a message is being sent"
        done.succeed()


@dataclass(slots=True, eq=False)
class Transmission:
    """A message that is being sent: the bits left, in 10^-9 bit, and the rate that it would have
    alone.
    """

    transmitter: CellTransmitter
    size_bytes: int
    left: int
    rate_bps: int
    uncovered_ns: int | None = None  # since when it has no coverage


class CellDirection:
    """One direction of a cell. Everything is counted in whole numbers, so that a car alone takes
    exactly as long as on a wire of its rate.
    """

    kind = "cell"
    capacity = 1

    def __init__(self, network: Network, name: str, *, follows_places: bool) -> None:
        self.clock = network.clock
        self.name = name
        self.completed = 0
        self.drops = 0  # by lack of coverage
        self.sent_bytes = 0
        self._follows_places = follows_places
        self._transmissions: list[Transmission] = []
        self.occupancy = Occupancy(self.clock)  # of the cars that send
        self._active = 0  # how many of them have a rate
        self._since_ns = 0  # until when sent bits are subtracted
        self._busy_ns = 0
        self._next_end: simpy.Event | None = None  # of a transmission, as planned now
        self._is_following = False

    @property
    def queued(self) -> int:
        """How many cars send now."""
        return len(self._transmissions)

    @property
    def busy_ns(self) -> int:
        """How long somebody has been sending until now."""
        return self._busy_ns + (self.clock.now - self._since_ns if self._active else 0)

    def begin(self, transmitter: CellTransmitter, size_bytes: int) -> None:
        """A transmitter has a message."""
        self._advance()
        rate_bps = transmitter.alone_bps()
        uncovered_ns = None if rate_bps else self.clock.now
        self._transmissions.append(
            Transmission(
                transmitter,
                size_bytes,
                left=size_bytes * 8 * NS_PER_S,
                rate_bps=rate_bps,
                uncovered_ns=uncovered_ns,
            )
        )
        self.occupancy.enter()
        self._replan()
        if self._follows_places and not self._is_following:
            self._is_following = True
            self.clock.process(self._follow())

    def give_up(self, transmitter: CellTransmitter) -> None:
        """A transmitter's link is taken away."""
        self._advance()
        (transmission,) = (item for item in self._transmissions if item.transmitter is transmitter)
        self._transmissions.remove(transmission)
        self.occupancy.leave()
        self._replan()

    def _advance(self) -> None:
        """Subtracts what was sent since the last time."""
        elapsed_ns = self.clock.now - self._since_ns
        self._since_ns = self.clock.now
        if not self._active or not elapsed_ns:
            return
        self._busy_ns += elapsed_ns
        for transmission in self._transmissions:
            transmission.left -= transmission.rate_bps * elapsed_ns // self._active

    def _replan(self) -> None:
        """Schedules the next end of a transmission."""
        self._next_end = None
        active = [item for item in self._transmissions if item.rate_bps]
        self._active = count = len(active)
        if active:
            next_ns = min(
                -(-max(transmission.left, 0) * count // transmission.rate_bps)
                for transmission in active
            )
            self._next_end = self.clock.timeout(next_ns)
            self._next_end.callbacks.append(self._end_next)

    def _end_next(self, event: simpy.Event) -> None:
        if event is not self._next_end:
            return
        self._advance()
        complete = [transmission for transmission in self._transmissions if transmission.left <= 0]
        self._transmissions = [
            transmission for transmission in self._transmissions if transmission.left > 0
        ]
        self.occupancy.leave(len(complete))
        self._replan()
        for transmission in complete:
            self.completed += 1
            self.sent_bytes += transmission.size_bytes
            transmission.transmitter.end()

    def _follow(self) -> Steps:
        """The rates follow the places of the cars, as long as somebody sends."""
        while True:
            yield self.clock.timeout(PLACES_NS)
            if not self._transmissions:
                self._is_following = False
                return
            self._update_rates()
            self._give_up_failed()

    def _update_rates(self) -> None:
        now_ns = self.clock.now
        rates_bps = [transmission.transmitter.alone_bps() for transmission in self._transmissions]
        if rates_bps == [transmission.rate_bps for transmission in self._transmissions]:
            return
        self._advance()
        for transmission, rate_bps in zip(self._transmissions, rates_bps, strict=True):
            transmission.rate_bps = rate_bps
            if rate_bps:
                transmission.uncovered_ns = None
            elif transmission.uncovered_ns is None:
                transmission.uncovered_ns = now_ns
        self._replan()

    def _give_up_failed(self) -> None:
        """What has had no coverage for too long is lost."""
        failures = [
            transmission
            for transmission in self._transmissions
            if _has_failed(transmission, self.clock.now)
        ]
        for transmission in failures:
            self._transmissions.remove(transmission)
            self.occupancy.leave()
            self.drops += 1
        for transmission in failures:
            transmission.transmitter.end(is_lost=True)


def _has_failed(transmission: Transmission, now_ns: int) -> bool:
    return (
        transmission.uncovered_ns is not None and now_ns - transmission.uncovered_ns >= FAILURE_NS
    )
