"""``existence``: tracks, each with the probability that the object is still there.

Preset ``ipda``: the integrated probabilistic data association filter of Musicki, Evans and
Stankovic (IEEE Transactions on Automatic Control 39(6), 1994), where an object that was in view and
not found is evidence against it. Preset ``autoware``: the rule of
autowarefoundation/autoware_universe, ``perception/autoware_multi_object_tracker``.
"""

import math
from typing import Any, Literal

from genie_sim.core.freshness.never import probability
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.messages import Header
from genie_sim.core.tracking import COAST_NS, VEHICLE

MOVING, PARKED, UNKNOWN = 0.87, 0.9998, 0.97  # survival in one second: halved in 5 s, 1 h, 23 s
LOG_MOVING, LOG_PARKED, LOG_UNKNOWN = math.log(MOVING), math.log(PARKED), math.log(UNKNOWN)
HALF_LIFE_S = 0.5  # Autoware's, without a sighting
GONE = 0.05
AUTOWARE_MIN, AUTOWARE_MAX = 0.1, 0.999


class Existence(Tracks):
    """Serves what exists with a probability of at least ``p_min`` and has C >= C_T.

    Parameters
    ----------
    preset : str
        The recursion of IPDA, or Autoware's rule.
    p_min : float
        Lowest probability of existence at which an object is served.
    coast_ns : int
        How long a track is predicted without a sighting.
    measured : bool
        Whether detection probability and score distributions are those that were measured for the
        detector on other drives, or assumed.
    tau_ns : int
        Looks within this time are no independent evidence, because cameras that look at nearly the
        same instant make the same mistakes: the likelihood ratio of a look is raised to the power
        of its distance in time from the one before, over this; 0 counts every look whole.
    """

    def __init__(
        self,
        preset: Literal["ipda", "autoware"] = "ipda",
        p_min: float = 0.5,
        coast_ns: int = COAST_NS,
        measured: bool = True,
        tau_ns: int = 0,
    ) -> None:
        super().__init__(coast_ns)
        self._tau_ns = tau_ns
        probability(p_min=p_min)
        if preset not in ("ipda", "autoware"):
            raise ValueError(f"preset: must be 'ipda' or 'autoware', not {preset!r}")
        self.p_min = p_min
        self.measured = measured and preset == "ipda"
        self._ipda = preset == "ipda"

    def expires_ns(self, track: Any) -> int | None:
        """When the probability will have sunk to 5 %, or a moving object coasted long enough."""
        coasted_ns = super().expires_ns(track)
        over = math.log(max(track.existence, GONE) / GONE)
        gone_ns: int = track.checked_ns + round(over / -track.log_survival * 1e9)
        return gone_ns if coasted_ns is None else min(gone_ns, coasted_ns)

    def existence(self, track: Any, now_ns: int) -> float:
        p: float = track.existence
        dt_ns = now_ns - track.checked_ns
        return p * math.exp(track.log_survival * dt_ns * 1e-9) if dt_ns > 0 else p

    def seen(self, track: Any, score: float, header: Header) -> None:
        weight = self._weight(track, header.stamp_ns)
        p = self._predicted(track, header.stamp_ns)
        track.log_survival = self._log_survival(track)
        if track.sightings == 1:
            track.existence = (
                self.laws.first(score)
                if self._ipda
                else min(max(score, AUTOWARE_MIN), AUTOWARE_MAX)
            )
            return
        ratio = self.laws.ratio(score) ** weight if self._ipda else 0.9 * score / 0.2
        track.existence = p * ratio / (1.0 - p + p * ratio)
        if not self._ipda:
            track.existence = min(track.existence, AUTOWARE_MAX)

    def unseen(self, track: Any, range_m: float, header: Header) -> None:
        if self._ipda:
            weight = self._weight(track, header.stamp_ns)
            p = self._predicted(track, header.stamp_ns)
            found = self.laws.found(track.kind is VEHICLE, range_m)
            if weight == 1.0:
                track.existence = p * (1.0 - found) / (1.0 - p * found)
            else:
                ratio = (1.0 - found) ** weight
                track.existence = p * ratio / (1.0 - p + p * ratio)

    def _weight(self, track: Any, stamp_ns: int) -> float:
        """How much of a look is news after the one before it, from 0 to 1."""
        if not self._tau_ns:
            return 1.0
        weight: float = min(1.0, abs(stamp_ns - track.checked_ns) / self._tau_ns)
        return weight

    def _predicted(self, track: Any, stamp_ns: int) -> float:
        """The probability before a look is counted, which is from now on the last. A late look ages
        nothing.
        """
        p = self.existence(track, stamp_ns)
        track.checked_ns = max(track.checked_ns, stamp_ns)
        return p

    def _log_survival(self, track: Any) -> float:
        """Per second."""
        if not self._ipda:
            return -math.log(2.0) / HALF_LIFE_S
        if track.moving:
            return LOG_MOVING
        return LOG_PARKED if track.parked else LOG_UNKNOWN


class MeasuredExistence(Existence):
    """Looks counted once, tracks, existence with measured laws, answers out of the map: serves what
    exists with a probability of at least ``p_min``, whatever C is.

    Parameters
    ----------
    p_min : float
        Lowest probability of existence at which an object is served.
    coast_ns : int
        How long a track is predicted without a sighting.
    measured : bool
        Whether detection probability and score distributions are those that were measured for the
        detector on other drives, or assumed.
    tau_ns : int
        Looks within this time are no independent evidence; see ``Existence``.
    """

    by_existence = True

    def __init__(
        self,
        p_min: float = 0.8,
        coast_ns: int = COAST_NS,
        measured: bool = True,
        tau_ns: int = 0,
    ) -> None:
        super().__init__("ipda", p_min, coast_ns=coast_ns, measured=measured, tau_ns=tau_ns)
