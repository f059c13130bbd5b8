"""Where a number comes from."""

from dataclasses import dataclass
from typing import Literal

from genie_sim.base.marks import Text


@dataclass(frozen=True, kw_only=True)
class Sourced:
    """What is told of every number."""

    tag: Literal["P", "S", "M", "D", "A"]
    """From the paper, a public source, measured, derived, or assumed."""

    source: Text
    """Where it is from, and how it was derived."""
