"""Losses in bursts: the model of Gilbert and Elliott with a good state, in which nothing is lost,
and a bad one, in which everything is (E. N. Gilbert, Capacity of a burst-noise channel, Bell System
Technical Journal 39, 1960).
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from genie_sim.base.settings import Bounds, Share


@dataclass(frozen=True, kw_only=True)
class BurstLoss:
    """Losses that come in bursts."""

    mean: Share
    """Mean share of what is lost, of segments or of messages."""

    burst: Annotated[float, Bounds(minimum=1)] = 1.0
    """Mean number of losses in a row. Independent losses have 1 / (1 - mean)."""

    per: Literal["segment", "message"] = "segment"
    """What is lost at a time: a segment of at most `mtu_payload` bytes, or a whole message. A
    message arrives if all of its segments do."""

    repair_ns: int | None = None
    """How much later a message arrives of which something was lost and is sent again, as with TCP;
    `null`: the message is lost, as with UDP."""

    def __post_init__(self) -> None:
        most = self.burst / (1 + self.burst)
        if self.mean > most:
            raise ValueError(
                f"mean: must be at most {most:g} with a burst of {self.burst:g}, not {self.mean:g}"
            )

    @property
    def begins(self) -> float:
        """Probability that a loss follows what was not lost."""
        return self.mean / ((1 - self.mean) * self.burst)


class LossProcess:
    """The losses of one direction of a link, one after the other."""

    def __init__(self, loss: BurstLoss, rng: np.random.Generator) -> None:
        self._begins = loss.begins
        self._ends = 1 / loss.burst
        self._rng = rng
        self._is_bad = bool(rng.random() < loss.mean)
        self._left = self._draw() if loss.mean else 0  # of the present state

    def hits(self, count: int) -> bool:
        """Whether any of the next ``count`` segments or messages is lost."""
        if not self._begins:
            return False
        is_hit = False
        while count > 0:
            if not self._left:
                self._is_bad = not self._is_bad
                self._left = self._draw()
            step = min(self._left, count)
            is_hit = is_hit or self._is_bad
            self._left -= step
            count -= step
        return is_hit

    def _draw(self) -> int:
        """How long the present state lasts: at least one."""
        return int(self._rng.geometric(self._ends if self._is_bad else self._begins))
