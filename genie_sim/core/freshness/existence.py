"""``existence``: tracks, each with the probability that the object is still there.

Preset ``ipda``: the integrated probabilistic data association filter of Musicki, Evans and Stankovic (IEEE Transactions
on Automatic Control 39(6), 1994), where an object that was in view and not found is evidence against it. Preset
``autoware``: the rule of autowarefoundation/autoware_universe, ``perception/autoware_multi_object_tracker``.
"""

import math
from typing import Any, Literal

from genie_sim.core.freshness.never import probability
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.tracking import COAST_NS, VEHICLE
from genie_sim.messages import Header

MOVING, PARKED, UNKNOWN = 0.87, 0.9998, 0.97  # survival in one second: halved in 5 s, 1 h, 23 s
LOG_MOVING, LOG_PARKED, LOG_UNKNOWN = math.log(MOVING), math.log(PARKED), math.log(UNKNOWN)
HALF_LIFE_S = 0.5  # Autoware's, without a sighting
GONE = 0.05
AUTOWARE_LEAST, AUTOWARE_MOST = 0.1, 0.999


class Existence(Tracks):
    """Serves what exists with a probability of at least ``p_min`` and has C >= C_T.

    With ``measured`` the detector's laws are measured on the recordings of the scenario, else assumed.
    """

    def __init__(
        self,
        preset: Literal["ipda", "autoware"] = "ipda",
        p_min: float = 0.5,
        coast_ns: int = COAST_NS,
        measured: bool = True,
    ) -> None:
        super().__init__(coast_ns)
        probability(p_min=p_min)
        if preset not in ("ipda", "autoware"):
            raise ValueError(f"preset: must be 'ipda' or 'autoware', not {preset!r}")
        self.p_min = p_min
        self.measured = measured and preset == "ipda"
        self._ipda = preset == "ipda"

    def expires_ns(self, one: Any) -> int | None:
        """When the probability will have sunk to 5 %, or a moving object has coasted long enough."""
        coasted_ns = super().expires_ns(one)
        over = math.log(max(one.existence, GONE) / GONE)
        gone_ns: int = one.checked_ns + round(over / -one.log_survival * 1e9)
        return gone_ns if coasted_ns is None else min(gone_ns, coasted_ns)

    def existence(self, one: Any, now_ns: int) -> float:
        p: float = one.existence
        dt_ns = now_ns - one.checked_ns
        return p * math.exp(one.log_survival * dt_ns * 1e-9) if dt_ns > 0 else p

    def seen(self, one: Any, score: float, header: Header) -> None:
        p = self._predicted(one, header.stamp_ns)
        one.log_survival = self._log_survival(one)
        if one.sightings == 1:
            one.existence = (
                self.laws.first(score)
                if self._ipda
                else min(max(score, AUTOWARE_LEAST), AUTOWARE_MOST)
            )
            return
        ratio = self.laws.ratio(score) if self._ipda else 0.9 * score / 0.2
        one.existence = p * ratio / (1.0 - p + p * ratio)
        if not self._ipda:
            one.existence = min(one.existence, AUTOWARE_MOST)

    def unseen(self, one: Any, range_m: float, header: Header) -> None:
        if self._ipda:
            p = self._predicted(one, header.stamp_ns)
            found = self.laws.found(one.kind is VEHICLE, range_m)
            one.existence = p * (1.0 - found) / (1.0 - p * found)

    def _predicted(self, one: Any, stamp_ns: int) -> float:
        """The probability before a look is counted, which is from now on the last. A late look ages nothing."""
        p = self.existence(one, stamp_ns)
        one.checked_ns = max(one.checked_ns, stamp_ns)
        return p

    def _log_survival(self, one: Any) -> float:
        """Per second."""
        if not self._ipda:
            return -math.log(2.0) / HALF_LIFE_S
        if one.moving:
            return LOG_MOVING
        return LOG_PARKED if one.parked else LOG_UNKNOWN


class Recommended(Existence):
    """Looks counted once, tracks, existence with measured laws, answers out of the map: serves what exists with a
    probability of at least ``p_min``, whatever C is."""

    by_existence = True

    def __init__(self, p_min: float = 0.8, coast_ns: int = COAST_NS, measured: bool = True) -> None:
        super().__init__("ipda", p_min, coast_ns, measured)
