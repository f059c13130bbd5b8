"""The places where objects were visible lately."""

from itertools import islice

import numpy as np

from genie_sim.base.units import NS_PER_S
from genie_sim.judge.joins import Array, GroupedPlaces, near
from genie_sim.record.columns import Codes

REMEMBERED_NS = 10 * NS_PER_S  # what was there so long ago counts as moved away
_NEVER_NS = -(2**62)


class RecentPlaces:
    """Every place where an object of some class was visible, and when it was visible there last.

    ``codes`` number the places: a class's code, and east and north [m].
    """

    def __init__(self) -> None:
        self.codes = Codes()
        self._places = np.zeros((0, 3))  # of the codes before the window
        self._last_ns = np.zeros(0, dtype=np.int64)

    def __len__(self) -> int:
        return len(self.codes)

    def were_there(
        self,
        places: GroupedPlaces,
        tolerance_m: Array,
        instant: Array,
        visible: Array,
        now_ns: Array,
    ) -> Array:
        """Returns of each place whether anything of its class was visible within reach of it at an
        instant before, in the last 10 s.

        Parameters
        ----------
        places : GroupedPlaces
            The places, grouped by the codes of their classes.
        tolerance_m, instant : array
            How far away counts [m], and the index of the instant, place by place.
        visible : array
            Of this window: codes of places where objects are visible and, beside them, indices of
            the instants, in their order.
        now_ns : array
            The time of each instant [ns]; they come in order.
        """
        self._add_new()
        code, at = visible
        result = np.zeros(len(tolerance_m), dtype=bool)
        if len(result) and len(self):
            asked, found = self._near(places, tolerance_m)
            keys = np.append(np.sort(code * len(now_ns) + at), -1)
            before = keys[np.searchsorted(keys[:-1], found * len(now_ns) + instant[asked]) - 1]
            of_place, earlier = np.divmod(before, len(now_ns))
            last_ns = np.where(of_place == found, now_ns[earlier], self._last_ns[found])
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
