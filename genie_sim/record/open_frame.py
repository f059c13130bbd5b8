"""The row of a frame while more about it becomes known."""

from operator import attrgetter
from types import SimpleNamespace

from genie_sim.core.messages import Header
from genie_sim.record.records import FrameRow
from genie_sim.record.tables import Value

_values_of = attrgetter(*FrameRow._fields)


class OpenFrame(SimpleNamespace):
    """What is known of a frame so far: the columns of ``records.FrameRow``, and ``image``, until
    the result has come: what the detector itself finds in it.

    Parameters
    ----------
    method : str
        Under which name the row is written.
    header : Header
        The frame's.
    number, lap : int
        The frame's running number in the stream, and how often the car had driven its route before.
    """

    def __init__(self, method: str, header: Header, number: int = 0, lap: int = 0) -> None:
        stamp_ns, stream, car = header
        super().__init__(
            method=method,
            car=car,
            stream=stream,
            stamp_ns=stamp_ns,
            frame=number,
            lap=lap,
            image=None,
            **FrameRow._field_defaults,
        )

    def values(self) -> tuple[Value, ...]:
        """The values of the columns, in their order."""
        values: tuple[Value, ...] = _values_of(self)
        return values
