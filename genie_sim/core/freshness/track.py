"""``track``: objects move with a constant velocity (``core.tracking``) and are served where they
are predicted.
"""

from typing import Any

from genie_sim.core.freshness.never import Never, positive
from genie_sim.core.tracking import COAST_NS


class Tracks(Never):
    """A moving object is predicted for ``coast_ns`` after it was last seen, then forgotten; others
    stay.

    Parameters
    ----------
    coast_ns : int
        How long a track is predicted without a sighting.
    """

    tracks = True

    def __init__(self, coast_ns: int = COAST_NS) -> None:
        positive(coast_ns=coast_ns)
        self._coast_ns = coast_ns

    def expires_ns(self, track: Any) -> int | None:
        seen_ns: int = track.seen_ns
        return seen_ns + self._coast_ns if track.moving else None
