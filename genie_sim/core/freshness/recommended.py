"""``recommended``: looks counted once, tracks, existence with measured laws, answers out of the map."""

from genie_sim.core.freshness.existence import Existence
from genie_sim.core.tracking import COAST_NS


class Recommended(Existence):
    """Serves what exists with a probability of at least ``p_min``, whatever C is."""

    by_existence = True

    def __init__(self, p_min: float = 0.8, coast_ns: int = COAST_NS, measured: bool = True) -> None:
        super().__init__("ipda", p_min, coast_ns, measured)
