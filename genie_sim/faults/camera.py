"""Cameras that fail."""

from dataclasses import dataclass

from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class CameraFault(Fault):
    """The cameras of the car ``target`` show nothing: their frames are dropped."""

    target: str
    """The car."""

    befalls = "car"
    dropped_by = "camera"

    def strike(self, network: Network) -> Strike:
        senses, failing = network.senses(self.target), (lambda image: None, self.dropped_by)
        senses.append(failing)
        yield
        senses.remove(failing)
