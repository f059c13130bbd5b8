"""Freshness policies: how long an object map keeps an object.

To add one, write a class with ``Never`` as its base and name it in ``FRESHNESS`` (or in a scenario
as ``package.module:Class``). Its arguments are its settings in YAML.
"""

from genie_sim.core.freshness.existence import Existence, MeasuredExistence
from genie_sim.core.freshness.never import Never
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.freshness.ttl import ClassTtl, Corroborated, Ttl

FRESHNESS: dict[str, type[Never]] = {
    "never": Never,
    "ttl": Ttl,
    "class_ttl": ClassTtl,
    "track": Tracks,
    "existence": Existence,
    "corroborate": Corroborated,
    "recommended": MeasuredExistence,
}
MUST_HAVE = (
    "tracks",
    "by_existence",
    "keeps_back",
    "notes_sightings",
    "expires_ns",
    "serves",
    "existence",
    "seen",
    "unseen",
)
