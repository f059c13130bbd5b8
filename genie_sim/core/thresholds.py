"""C_T, the confidence from which on an object may leave a Genie (Section III-D)."""

import bisect
import math

from genie_sim.core.rules import Percentile


class Threshold:
    """A fixed C_T. ``value`` is what holds now."""

    def __init__(self, value: float) -> None:
        self.value = value

    def added(self, confidence: float) -> None:
        """The map stores a new object."""

    def changed(self, before: float, after: float) -> None:
        """The confidence of a stored object changes."""

    def removed(self, confidence: float) -> None:
        """The map holds an object no longer."""


class PercentileOfStored(Threshold):
    """C_T is a percentile, by nearest rank, of the confidences that the map holds now; 1 while it
    holds none.
    """

    def __init__(self, percent: float) -> None:
        super().__init__(1.0)
        self._percent = percent
        self._ranked: list[float] = []

    def added(self, confidence: float) -> None:
        bisect.insort(self._ranked, confidence)
        self._set_value()

    def changed(self, before: float, after: float) -> None:
        del self._ranked[bisect.bisect_left(self._ranked, before)]
        bisect.insort(self._ranked, after)
        self._set_value()

    def removed(self, confidence: float) -> None:
        del self._ranked[bisect.bisect_left(self._ranked, confidence)]
        self._set_value()

    def _set_value(self) -> None:
        rank = math.ceil(self._percent * len(self._ranked) / 100)
        self.value = self._ranked[rank - 1] if self._ranked else 1.0


def threshold_of(setting: float | Percentile) -> Threshold:
    """The C_T that a setting chooses."""
    if isinstance(setting, Percentile):
        return PercentileOfStored(setting.percentile)
    return Threshold(setting)
