"""``never``: the map keeps every object, as in the paper. The base of all other policies."""

from typing import Any, ClassVar

from genie_sim.base.errors import short_repr
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.messages import Header


class Never:
    """An object stays for ever where it was first seen, and is shared by the map's Genie as soon as
    C >= C_T.

    Other policies override what they do otherwise. The objects they get have ``label``, ``score``,
    ``confidence``, ``seen_ns``, ``sightings``, ``parked``, and ``origins``, a dict of the policy's
    own. Those of a policy with ``tracks`` have the other attributes of ``tracking.Track``, too.
    """

    # objects move with a constant velocity, and looks travel with answers
    tracks: ClassVar[bool] = False
    by_existence: ClassVar[bool] = False  # ``p_min`` decides what leaves, and not C_T
    p_min: float = 0.0
    laws: DetectorLaws = ASSUMED  # what the detector is like; set by whoever makes the Genie
    keeps_back: ClassVar[bool] = False  # has a ``serves`` of its own, which may say no
    notes_sightings: ClassVar[bool] = False  # has a ``seen`` of its own

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.keeps_back = cls.serves is not Never.serves
        cls.notes_sightings = cls.seen is not Never.seen

    @property
    def forgets(self) -> bool:
        """Whether it has an ``expires_ns`` of its own."""
        return type(self).expires_ns is not Never.expires_ns

    def expires_ns(self, stored: Any) -> int | None:
        """When to take out an object that nobody sees again; ``None``: never."""
        return None

    def serves(self, stored: Any, to: str, now_ns: int) -> bool:
        """Whether an object that is confident enough may leave in an answer to a car (``""``: to
        other Genies).
        """
        return True

    def existence(self, stored: Any, now_ns: int) -> float:
        """How likely the object still exists; what ``tracks`` leaves only from ``p_min`` on."""
        return 1.0

    def seen(self, stored: Any, score: float, header: Header) -> None:
        """A detector found the object, new or not, in the frame with this header."""

    def unseen(self, stored: Any, range_m: float, header: Header) -> None:
        """A detector looked at the object, so far away, and did not find it. Only for policies with
        ``tracks``.
        """


def positive(**values_ns: int) -> None:
    """Raises ``ValueError`` for a time that is not more than zero."""
    for name, value_ns in values_ns.items():
        if value_ns <= 0:
            raise ValueError(
                f"{name.removesuffix('_ns')}: must be more than zero, but is {value_ns:g} ns"
            )


def probability(**values: float) -> None:
    """Raises ``ValueError`` for a number outside 0..1."""
    for name, value in values.items():
        if isinstance(value, bool) or not 0 <= value <= 1:
            raise ValueError(f"{name}: must be a number from 0 to 1, not {short_repr(value)}")
