"""What the paper may mean by its metrics: an argument of everything that computes them."""

from dataclasses import dataclass, fields
from typing import Literal, get_args, get_type_hints


@dataclass(frozen=True, slots=True)
class Definitions:
    """One meaning of each metric that the paper leaves open.

    Parameters
    ----------
    time : str
        From when the time to an answer counts: since the frame was ``received`` by its consumer's
        host, or since the camera's ``stamp``.
    image_reuse : str
        Hits over requests of a Genie's clients (``own_requests``), or over those of its neighbours
        too (``all_requests``).
    error_bars : str
        The highest reuse in ``windows`` of equally many requests, or the highest value of the
        ``running`` ratio of any Genie.
    boost : str
        Confidence added by an update (``per_update``), or by the end of the run over the objects
        then stored (``per_object``).
    """

    time: Literal["received", "stamp"] = "received"
    image_reuse: Literal["own_requests", "all_requests"] = "own_requests"
    error_bars: Literal["windows", "running"] = "windows"
    boost: Literal["per_update", "per_object"] = "per_update"


USUAL = Definitions()  # as in ``analysis.metrics``
# metric -> its definitions, the usual one first
CHOICES: dict[str, tuple[str, ...]] = {
    field.name: get_args(get_type_hints(Definitions)[field.name]) for field in fields(Definitions)
}
