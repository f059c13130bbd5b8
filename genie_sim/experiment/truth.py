"""What answers are worth where the truth is known: a table of counts, one row per answered frame."""

from __future__ import annotations

from genie_sim.experiment.tables import Column, Table


class TruthTable(Table):
    """One row per answered frame of a drive through a city: its first answer, compared with what is really there.

    A served object is true if one of its class really is within the object map's gate and the city's ``tolerance`` of
    it at the time of the frame. Objects without a place in the world are not counted.
    """

    name = "truth"
    sorted_by = ("method", "car", "stream", "stamp_ns")
    columns = (
        Column("method", "text", "", "local, remote or genie"),
        Column("car", "text", "", "the car whose camera took the frame"),
        Column("stream", "text", "", "camera stream of that car (frame_id)"),
        Column("stamp_ns", "int64", "ns", "when the camera took it"),
        Column("source", "text", "", "what produced the first answer"),
        Column("served", "int32", "objects", "with a place, in the first answer"),
        Column("true", "int32", "objects", "of those served: one of the class is there; the others are ghosts"),
        Column("not_in_view", "int32", "objects", "of those served: none of the class that is in view is there"),
        Column("in_view", "int32", "objects", "really in view, and within genie.view_range"),
        Column("found", "int32", "objects", "of those in view: one of the class is served there"),
    )

    def add(
        self,
        method: str,
        car: str,
        stream: str,
        stamp_ns: int,
        source: str,
        served: int,
        true: int,
        not_in_view: int,
        in_view: int,
        found: int,
    ) -> None:
        """A frame has its first answer."""
        self._append((method, car, stream, stamp_ns, source, served, true, not_in_view, in_view, found))
