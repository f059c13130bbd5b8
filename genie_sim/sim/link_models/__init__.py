"""Link models: how long a message occupies a link, when it arrives, and whether it is lost. One file each.

To add one, write a frozen dataclass with the method of ``LinkModel`` and name it here (or in a scenario as
``package.module:Class``). Its arguments are its settings in YAML.
"""

from typing import Protocol

import numpy as np

LINK_MODELS: dict[str, str] = {"wire": "genie_sim.sim.link_models.wire:Wire"}


class Channel(Protocol):
    """One direction of one link."""

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        """How long a message that begins its way now keeps the sender busy."""

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        """How long it takes from now, when its last bit has left, until it arrives; ``None`` if it is lost."""


class LinkModel(Protocol):
    """What a scenario says about a link. ``up`` leads from a car to its edge, or from an edge into the edge network."""

    def channel(self, up: bool, rng: np.random.Generator) -> Channel:
        """One direction, with the link's own random numbers."""
