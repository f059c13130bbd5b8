"""Where a number comes from."""

from dataclasses import dataclass
from typing import Literal

from genie_sim.base.settings import Text


@dataclass(frozen=True, kw_only=True)
class Sourced:
    """What is told of every number: the kind of its source, and the source."""

    tag: Literal["P", "S", "M", "D", "A"]
    source: Text
