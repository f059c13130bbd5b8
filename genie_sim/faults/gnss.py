"""Wrong positions: a car's satellite navigation is off."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Message
from genie_sim.sim.bends import Bend, shifted
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network

STEPS = 20  # of the noise, in each of its correlation times


class PositionError:
    """East and north by which a position is off: a constant bias in a random direction, and a
    Gauss-Markov process in each direction. It depends on the time alone.

    Parameters
    ----------
    rng : Generator
        Draws the direction and the noise.
    bias_m : float
        The length of the bias.
    noise_m : float
        The standard deviation of the noise in each direction.
    correlation_ns : int
        The time in which its correlation falls to 1 / e.
    """

    def __init__(
        self, rng: np.random.Generator, *, bias_m: float, noise_m: float, correlation_ns: int
    ) -> None:
        angle_rad = rng.uniform(0, 2 * math.pi)
        self._bias_m = np.array([math.cos(angle_rad), math.sin(angle_rad)]) * bias_m
        self._rng = rng
        self._noise_m = noise_m
        self._step_ns = max(1, correlation_ns // STEPS)
        self._correlation = math.exp(-1 / STEPS)
        self._walk = [rng.standard_normal(2)]

    def at(self, now_ns: int) -> tuple[float, float]:
        """The error at a time [m]."""
        step, rest_ns = divmod(now_ns, self._step_ns)
        while len(self._walk) < step + 2:
            innovation = math.sqrt(1 - self._correlation**2) * self._rng.standard_normal(2)
            self._walk.append(self._correlation * self._walk[-1] + innovation)
        before, after = self._walk[step : step + 2]
        noise = before + (after - before) * (rest_ns / self._step_ns)
        east_m, north_m = self._bias_m + self._noise_m * noise
        return float(east_m), float(north_m)


@dataclass(frozen=True)
class Gnss(Fault):
    """The car ``target`` takes itself to be elsewhere. What it tells others is displaced, and so is
    to it what others tell; what it sees itself is where it should be, as the car drives in a frame
    of its own.
    """

    target: str
    """The car."""

    bias_m: float = 2.0
    """How far its position is off, in a direction that is drawn. Urban multipath: 5 to 10 m; with
    satellite-based augmentation 1 m. Assumed."""

    noise_m: float = 0.1
    """Standard deviation of the noise besides, to the east and to the north. Assumed."""

    correlation_ns: int = 20 * NS_PER_S
    """Correlation time of the noise. Urban multipath: 10 to 30 s. Assumed."""

    befalls = "car"

    def strike(self, network: Network) -> Strike:
        (rng,) = network.stream("gnss", self.target).spawn(1)  # no other fault draws from it
        error = PositionError(
            rng, bias_m=self.bias_m, noise_m=self.noise_m, correlation_ns=self.correlation_ns
        )
        outward, inward = (partial(_displaced, network, error, sign) for sign in (1, -1))
        bend = Bend(inward, outward)
        network.bend(self.target, bend)
        yield
        network.unbend(self.target, bend)


def _displaced(
    network: Network, error: PositionError, sign: int, message: Message, host: str
) -> Message:
    east_m, north_m = error.at(network.clock.now)
    return shifted(message, sign * east_m, sign * north_m)
