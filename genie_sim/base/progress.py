"""How work tells how far it is."""

from typing import Protocol


class Progress(Protocol):
    """Is called with how much is done, how much there is, and what is going on, in words."""

    def __call__(self, done: float, total: float, what: str, /) -> None: ...
