"""Losses in bursts: the model of Gilbert and Elliott with a good state, in which nothing is lost,
and a bad one, in which everything is (E. N. Gilbert, Capacity of a burst-noise channel, Bell System
Technical Journal 39, 1960).
"""

from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from genie_sim.base.marks import Bounds, Share
from genie_sim.base.setting_errors import SettingError


@dataclass(frozen=True, kw_only=True)
class BurstLoss:
    """Losses of segments that come in bursts. A message arrives if all of its segments do."""

    mean: Share
    """Mean share of segments that are lost."""

    burst: Annotated[float, Bounds(minimum=1)] = 1.0
    """Mean number of losses in a row. Independent losses have 1 / (1 - mean). A link with a rate
    loses segments for the time of so many of them, whether any are sent then or not, so bursts come
    at the same time under every method."""

    def __post_init__(self) -> None:
        most = self.burst / (1 + self.burst)
        if self.mean > most:
            text = f"must be at most {most:g} with a burst of {self.burst:g}, not {self.mean:g}"
            raise SettingError("mean", text)

    @property
    def begin_probability(self) -> float:
        """Probability that a loss follows what was not lost."""
        return self.mean / ((1 - self.mean) * self.burst)


class LossProcess:
    """The losses of one direction of a link, step by step: good and bad states by turns.

    Parameters
    ----------
    loss : BurstLoss
        How many losses there are, and how many in a row.
    rng : Generator
        Draws how many steps each state lasts.
    """

    def __init__(self, loss: BurstLoss, rng: np.random.Generator) -> None:
        self._begins = loss.begin_probability
        self._ends = 1 / loss.burst
        self._rng = rng
        self._bursts: deque[tuple[int, int]] = deque()  # from which step until which
        self._until = 0  # all bursts are known that begin before this step
        if loss.mean and rng.random() < loss.mean:
            self._add_burst(0)

    def pass_steps(self, first: int, count: int) -> bool:
        """Goes on by ``count`` steps from ``first`` on, and forgets those before; whether any of
        them is bad.
        """
        if not self._begins:
            return False
        end = first + count
        while self._until < end:
            self._add_burst(self._until + int(self._rng.geometric(self._begins)))
            if self._until <= first:
                self._bursts.pop()  # a link that was silent for long needs no list of them
        while self._bursts and self._bursts[0][1] <= first:
            self._bursts.popleft()
        return any(begin < end for begin, _ in self._bursts)

    def _add_burst(self, begin: int) -> None:
        """The next burst begins at this step, and lasts for at least one."""
        self._until = begin + int(self._rng.geometric(self._ends))
        self._bursts.append((begin, self._until))
