"""How likely an object still exists: the integrated probabilistic data association filter of
Musicki, Evans and Stankovic (IEEE Transactions on Automatic Control 39(6), 1994), where an object
that was in view and not found is evidence against it.
"""

import math

from genie_sim.core.messages import Header
from genie_sim.tracks.laws import ASSUMED, DetectorLaws
from genie_sim.tracks.track import COAST_NS, VEHICLE, Track

# Assumed: with which probability an object survives a second at which nobody looks. That of one
# that moves is halved in 5 s, of one that is parked in 1 h, of others in 23 s.
LOG_MOVING, LOG_PARKED, LOG_UNKNOWN = math.log(0.87), math.log(0.9998), math.log(0.97)
GONE = 0.05  # assumed: a track that exists with this probability is forgotten


class ExistenceFilter:
    """What looks say about tracks: how likely each exists, and when it is forgotten.

    Parameters
    ----------
    p_min : float
        Lowest probability of existence at which an object is believed in, 0 to 1.
    tau_ns : int
        Looks within this time [ns] are no independent evidence, because cameras that look at nearly
        the same instant make the same mistakes: the likelihood ratio of a look is raised to the
        power of its distance in time from the one before, over this; 0 weighs every look in full.
    laws : DetectorLaws
        What the detectors are like.
    """

    def __init__(self, p_min: float = 0.8, tau_ns: int = 0, laws: DetectorLaws = ASSUMED) -> None:
        self.p_min = p_min
        self._tau_ns = tau_ns
        self._laws = laws

    def expires_ns(self, track: Track) -> int:
        """When to take out a track that nobody sees again: its probability will have sunk to
        ``GONE``, or it moves and was predicted for long enough.
        """
        over = math.log(max(track.existence, GONE) / GONE)
        gone_ns = track.checked_ns + round(over / -track.log_survival * 1e9)
        return min(gone_ns, track.seen_ns + COAST_NS) if track.moving else gone_ns

    def probability(self, track: Track, now_ns: int) -> float:
        """How likely a track exists at a time [ns]."""
        p = track.existence
        dt_ns = now_ns - track.checked_ns
        return p * math.exp(track.log_survival * dt_ns * 1e-9) if dt_ns > 0 else p

    def confirm(self, track: Track, score: float, header: Header) -> None:
        """A detector found the object, new or not, in the frame with this header."""
        weight = self._weight(track, header.stamp_ns)
        p = self._age(track, header.stamp_ns)
        track.log_survival = _log_survival(track)
        if track.sightings == 1:
            track.existence = self._laws.first(score)
            return
        track.existence = _updated(p, self._laws.ratio(score) ** weight)

    def doubt(self, track: Track, range_m: float, header: Header) -> None:
        """A detector looked at the object, so far away, and did not find it."""
        weight = self._weight(track, header.stamp_ns)
        p = self._age(track, header.stamp_ns)
        detection = self._laws.detection(track.kind is VEHICLE, range_m)
        if weight == 1.0:
            track.existence = p * (1.0 - detection) / (1.0 - p * detection)
        else:
            track.existence = _updated(p, (1.0 - detection) ** weight)

    def _weight(self, track: Track, stamp_ns: int) -> float:
        """How much of a look is news after the one before it, from 0 to 1."""
        if not self._tau_ns:
            return 1.0
        return min(1.0, abs(stamp_ns - track.checked_ns) / self._tau_ns)

    def _age(self, track: Track, stamp_ns: int) -> float:
        """Brings a track to the time of a look, which is its last from now on; returns how likely
        it exists before the look is weighed. A look that comes late ages nothing.
        """
        p = self.probability(track, stamp_ns)
        track.checked_ns = max(track.checked_ns, stamp_ns)
        return p


def _log_survival(track: Track) -> float:
    """Of the probability, per second that nobody looks."""
    if track.moving:
        return LOG_MOVING
    return LOG_PARKED if track.parked else LOG_UNKNOWN


def _updated(p: float, ratio: float) -> float:
    """A probability after evidence of a likelihood ratio, by Bayes' rule; evidence against what was
    certain counts for nothing.
    """
    total = 1.0 - p + p * ratio
    return p * ratio / total if total else p
