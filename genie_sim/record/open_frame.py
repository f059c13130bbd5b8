"""The row of a frame while more about it becomes known."""

from collections.abc import Mapping
from operator import attrgetter
from typing import Any

from genie_sim.core.messages import Header, Image
from genie_sim.record.records import FrameRow
from genie_sim.record.tables import Value

_values_of = attrgetter(*FrameRow._fields)


class OpenFrame:
    """What is known of a frame so far: the columns of ``records.FrameRow``, in their order, and
    ``image``, until the result has come: what the detector itself finds in it.

    Parameters
    ----------
    method : str
        Under which name the row is written.
    header : Header
        The frame's.
    number, lap : int
        The frame's running number in the stream, and how often the car had driven its route before.
    """

    __slots__ = (*FrameRow._fields, "image")

    def __init__(self, method: str, header: Header, number: int = 0, lap: int = 0) -> None:
        self.method = method
        self.car = header.origin
        self.stream = header.frame_id
        self.stamp_ns = header.stamp_ns
        self.frame = number
        self.lap = lap
        self.received_ns: int | None = None
        self.first_answer_ns: int | None = None
        self.fresh_answer_ns: int | None = None
        self.result_answer_ns: int | None = None
        self.source = "none"
        self.served_by: str | None = None
        self.image_hit: bool | None = None
        self.coalesced: bool | None = None
        self.first_looked_ns: int | None = None
        self.looked_ns: int | None = None
        self.objects_fresh: int | None = None
        self.objects_result: int | None = None
        self.objects_served: int | None = None
        self.bytes_up = 0
        self.bytes_down = 0
        self.drop: str | None = None
        self.image: Image | None = None

    def update(self, row: Mapping[str, Any]) -> "OpenFrame":
        """Takes over these columns; returns itself."""
        for column, value in row.items():
            setattr(self, column, value)
        return self

    def values(self) -> tuple[Value, ...]:
        """The values of the columns, in their order."""
        return _values_of(self)
