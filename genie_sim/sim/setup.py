"""What a world is built from: the settings of a scenario under one method, and what they name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from genie_sim.core.messages import Frame
from genie_sim.sim.device import Device
from genie_sim.sim.encoding import ImageCodec
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.interface import NetworkInterface
from genie_sim.sim.link_model import LinkModel
from genie_sim.sim.places import Place
from genie_sim.sim.settings import Camera, Car, Edge, MethodSettings
from genie_sim.tracks.laws import DetectorLaws


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """One scenario under one method's settings.

    Parameters
    ----------
    seed : int
        Random streams are named by car, edge and link below it.
    settings : MethodSettings
        Those of the method.
    cars : sequence of Car
        Each starts at its route's ``start_ns``, the random part included.
    edges : sequence of Edge
        The edge servers.
    cameras : sequence of Camera
        The streams of cars that have none of their own.
    frames : mapping
        What the cameras take, by car and recording.
    devices : mapping
        The computers, by the names that cars and edges give them.
    links : mapping
        The link model of each car with an edge.
    edge_network : LinkModel
        That of the network between edges.
    laws : DetectorLaws
        The detectors' laws, as maps and consumers that weigh evidence take them to be.
    faults : sequence of TimedFault
        What goes wrong.
    codec : ImageCodec or None
        How pictures are sent; without one, as they are.
    places : mapping
        Where each car is at a time [ns]: east and north [m].
    interfaces : mapping
        The network interface of each car that has one of a known kind.
    warm_up_ns : int
        From when on it counts what hosts, links and queues do.
    is_one_world : bool
        Whether all cars are in one world at one time, or replay recordings at different times.
    """

    seed: int
    settings: MethodSettings
    cars: Sequence[Car]
    edges: Sequence[Edge]
    cameras: Sequence[Camera]
    frames: Mapping[str, Mapping[str, Sequence[Frame]]]
    devices: Mapping[str, Device]
    links: Mapping[str, LinkModel]
    edge_network: LinkModel
    laws: DetectorLaws
    faults: Sequence[TimedFault]
    codec: ImageCodec | None
    places: Mapping[str, Place]
    interfaces: Mapping[str, NetworkInterface]
    warm_up_ns: int
    is_one_world: bool

    @property
    def blind_edges(self) -> set[str | None]:
        """Edges that serve cars without cameras: no picture ever comes there, since such cars have
        edges of their own (``scenario.checks``).
        """
        return {car.edge for car in self.cars if not car.cameras}
