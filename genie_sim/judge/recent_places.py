"""The places where objects were visible lately."""

from itertools import islice

import numpy as np

from genie_sim.base.units import NS_PER_S
from genie_sim.judge.joins import Array, GroupedPlaces, near, pair_codes
from genie_sim.record.columns import Codes

REMEMBERED_NS = 10 * NS_PER_S  # what was there so long ago counts as moved away
_NEVER_NS = -(2**62)
_NONE = -1  # the index of no instant


class RecentPlaces:
    """Every place where an object of some class was visible, and when it was visible there last.

    ``codes`` number the places: a class's code, and east and north [m].
    """

    def __init__(self) -> None:
        self.codes = Codes()
        self._places = np.zeros((0, 3))  # of the codes before the window
        self._last_ns = np.zeros(0, dtype=np.int64)

    def were_there(
        self,
        places: GroupedPlaces,
        tolerance_m: Array,
        instant: Array,
        visible: Array,
        now_ns: Array,
    ) -> Array:
        """Returns of each place (n,) whether anything of its class was visible within its tolerance
        at an instant before, at most ``REMEMBERED_NS`` ago.

        Parameters
        ----------
        places : GroupedPlaces
            The places, grouped by the codes of their classes.
        tolerance_m, instant : array
            How far away counts [m], and the index of the instant, place by place (n,).
        visible : array
            Of this window (2, visible): codes of places where objects are visible, and indices of
            the instants, in their order.
        now_ns : array
            The time of each instant [ns] (instants,); they come in order.
        """
        self._add_new()
        code, at = visible
        result = np.zeros(len(tolerance_m), dtype=bool)
        if len(result) and len(self.codes):
            # of each place that is asked about and each known one near it: when that was visible
            # last, in this window or before
            asked, near_code = self._near(places, tolerance_m)
            before = _last_before(visible, np.stack([near_code, instant[asked]]), len(now_ns))
            last_ns = np.where(before == _NONE, self._last_ns[near_code], now_ns[before])
            result[asked[last_ns >= now_ns[instant[asked]] - REMEMBERED_NS]] = True
        self._last_ns[code] = now_ns[at]  # of equal places the last one counts
        self._forget(int(now_ns[-1]) - REMEMBERED_NS)
        return result

    def _add_new(self) -> None:
        """Places with new codes have not been visible before."""
        old = len(self._last_ns)
        new = np.array(list(islice(self.codes, old, None))).reshape(-1, 3)
        self._places = np.concatenate([self._places, new])
        self._last_ns = np.append(self._last_ns, np.full(len(new), _NEVER_NS))

    def _near(self, places: GroupedPlaces, tolerance_m: Array) -> tuple[Array, Array]:
        """Indices of places and codes of known ones within reach of them."""
        classes, east_m, north_m = self._places.T
        known = GroupedPlaces(classes.astype(np.int64), east_m, north_m)
        asked, code, _ = near(places, known, float(tolerance_m.max()) * (1.0 + 1e-9))
        away_m = np.hypot(
            east_m[code] - places.east_m[asked], north_m[code] - places.north_m[asked]
        )
        within = away_m <= tolerance_m[asked]
        return asked[within], code[within]

    def _forget(self, before_ns: int) -> None:
        """Removes the places where nothing has been visible since, once they are the most."""
        remembered = self._last_ns >= before_ns
        if 2 * np.count_nonzero(remembered) < len(remembered):
            names = list(self.codes)
            kept = [names[code] for code in np.flatnonzero(remembered).tolist()]
            self.codes.clear()
            self.codes.update((name, code) for code, name in enumerate(kept))
            self._places, self._last_ns = self._places[remembered], self._last_ns[remembered]


def _last_before(visible: Array, asked: Array, instants: int) -> Array:
    """The last instant before at which something was visible at a place, or ``_NONE``.

    ``visible`` (2, visible) and ``asked`` (2, n) are codes of places and indices of instants, of
    which there are so many. Place 7 was visible at 0 and 3; at 3 the last instant before is 0:

    >>> _last_before(np.array([[7, 7], [0, 3]]), np.array([[7, 7, 8], [3, 0, 3]]), 4)
    array([ 0, -1, -1])
    """
    events = np.sort(pair_codes(visible[0], visible[1], instants))
    place, at = np.divmod(np.append(_NONE, events), instants)  # place -1 is none of those asked for
    row = np.searchsorted(events, pair_codes(asked[0], asked[1], instants))
    return np.where(place[row] == asked[0], at[row], _NONE)
