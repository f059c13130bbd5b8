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
FROM_STAMP = "_from_stamp"  # ends the names of times that count from the camera's stamp
TIMED = (
    "first_answer_",
    "fresh_answer_",
    "result_answer_",
    "improvement_",
    "under_deadline_share",
    "fresh_under_deadline_share",
    "result_under_deadline_share",
)
# metric -> its definitions, the usual one first
CHOICES: dict[str, tuple[str, ...]] = {
    field.name: get_args(get_type_hints(Definitions)[field.name]) for field in fields(Definitions)
}


def meant(metric: str, definitions: Definitions) -> str:
    """The name of what a metric means under these definitions: of a run's metric the run's own
    name, of anything else a name that no run has.
    """
    if definitions.time == "stamp" and metric.startswith(TIMED):
        return f"{metric}{FROM_STAMP}"
    if definitions.image_reuse == "all_requests" and metric in ("image_reuse", "image_reuse_high"):
        metric = metric.replace("image_reuse", "image_reuse_with_neighbours")
    if definitions.error_bars == "running" and metric.endswith(("_high", "_peak_at")):
        return f"{metric}_running"
    if definitions.boost == "per_object" and metric == "confidence_boost":
        return "boost_per_object"
    return metric
