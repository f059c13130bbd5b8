"""Which numbers the paper may mean by its metrics: what a fact is called under each definition of its metric."""

import re
from collections.abc import Mapping

_TIMED = (
    r"(?:first|fresh)_answer_(?:mean|p\d+)|improvement_(?:first|fresh)_answer"
    r"|(?:fresh_)?under_deadline_share(?:_of_answered)?"
)

# Metric -> definition -> of the default's facts that are others under it: how their name is found.
DEFINITIONS: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    "time": {
        "received": (),
        "stamp": ((rf"^({_TIMED})(?=:)", r"\1_from_stamp"),),
    },
    "image_reuse": {
        "own_requests": (),
        "all_requests": ((r"^image_reuse(?=(?:_high)?:)", "image_reuse_with_neighbours"),),
    },
    "error_bars": {
        "windows": (),
        "running": (
            (r"^((?:object|image)_reuse(?:_with_neighbours)?)_high(?=:)", r"\1_highest_running"),
            (r"^image_peak_at", "image_running_peak_at"),
        ),
    },
    "boost": {
        "per_update": (),
        "per_object": ((r"^confidence_boost(?=:)", "boost_per_object"),),
    },
}


def fact(name: str, definitions: Mapping[str, str]) -> str:
    """What the fact is called that a test means by ``name``; metrics without a definition are the default's."""
    for metric, definition in definitions.items():
        for pattern, other in DEFINITIONS[metric][definition]:
            name = re.sub(pattern, other, name)
    return name
