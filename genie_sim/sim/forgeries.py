"""What attackers tell others, as ground truth of a run: the objects they add and leave out."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from typing import Literal

from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Detection
from genie_sim.core.monitor import Forgery

SAME_M = 1.0  # a forged object that moves no farther is the same forgery
SAME_NS = NS_PER_S  # after a longer silence it is another one
Change = Literal["added", "left_out"]


class Forgeries:
    """All forgeries of a run, each from the first message to the last one.

    ``order`` is the drawn order of the cars, of which the first ones attack; ``None`` until it is
    drawn. All attacks of a run have the same one.
    """

    def __init__(self) -> None:
        self.order: list[int] | None = None
        self._forgeries: list[Forgery] = []
        self._latest: defaultdict[tuple[str, str, str, Change, str], list[int]] = defaultdict(list)

    def __iter__(self) -> Iterator[Forgery]:
        return iter(self._forgeries)

    def note(
        self,
        attack: str,
        *,
        attacker: str,
        receiver: str,
        before: Sequence[Detection],
        after: Sequence[Detection],
        now_ns: int,
    ) -> None:
        """Compares the objects of a message with those that it should have.

        Parameters
        ----------
        attack : str
            The kind of attack.
        attacker, receiver : str
            The hosts between which the message goes.
        before, after : sequence of Detection
            The objects without the attack, and with it. One that only has another score counts as
            added.
        now_ns : int
            The time [ns].
        """
        true = Counter((item.label, item.location, item.score) for item in before)
        told = Counter((item.label, item.location) for item in after)
        for item in after:
            key = item.label, item.location, item.score
            if true[key]:
                true[key] -= 1
            else:
                self._add((attack, attacker, receiver, "added", item.label), item, now_ns)
        for item in before:
            if told[item.label, item.location]:
                told[item.label, item.location] -= 1
            else:
                self._add((attack, attacker, receiver, "left_out", item.label), item, now_ns)

    def _add(self, key: tuple[str, str, str, Change, str], item: Detection, now_ns: int) -> None:
        """A new forgery, or an earlier one that goes on."""
        if item.location is None:
            return
        east_m, north_m, _ = item.location
        latest = self._latest[key]
        latest[:] = [i for i in latest if self._forgeries[i].end_ns >= now_ns - SAME_NS]
        for i in latest:
            forgery = self._forgeries[i]
            if math.hypot(forgery.east_m - east_m, forgery.north_m - north_m) <= SAME_M:
                self._forgeries[i] = forgery._replace(end_ns=now_ns)
                return
        latest.append(len(self._forgeries))
        self._forgeries.append(Forgery(*key, east_m, north_m, begin_ns=now_ns, end_ns=now_ns))
