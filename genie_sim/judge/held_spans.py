"""For how long consumers hold, or miss, each object in one place, judged in one way."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.judge.joins import Array
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.tables import Table


class JudgedObjects(NamedTuple):
    """Objects that are held or missed, one row each: which camera looks (``HeldSpans.cameras``), at
    which of its instants, the order among the objects of the instant, a code of the label, where it
    is [m], and the index of the judgement.
    """

    camera: Array
    turn: Array
    order: Array
    label: Array
    east_m: Array
    north_m: Array
    judgement: Array

    def rows(self, selection: Array) -> "JudgedObjects":
        """Those of a mask or of indices."""
        return JudgedObjects(*(column[selection] for column in self))

    @property
    def keys(self) -> tuple[Array, ...]:
        """What tells the rows of ``held_objects`` apart."""
        return self.camera, self.label, self.east_m, self.north_m, self.judgement


NONE = -1  # the index of an instant that is not in the window


class HeldSpans:
    """Writes a row of ``held_objects`` for each object when it is judged as it is no more.

    Parameters
    ----------
    method : str
        The name under which rows are written.
    table : Table
        Gets the rows (``records.HELD_OBJECTS``).
    cars, labels : Codes
        The numbers of cars and the codes of labels.
    judgements : sequence of str
        The names of the judgements.
    """

    def __init__(
        self,
        method: str,
        table: Table,
        cars: Codes,
        labels: Codes,
        judgements: Sequence[str],
    ) -> None:
        self._method = method
        self._table = table
        self._cars = cars
        self._labels = labels
        self._judgements = judgements
        self.cameras: Codes = Codes()  # of a car's number and a stream
        # by camera: what was held or missed at its last instant, and since when [ns]
        self._open: dict[int, tuple[JudgedObjects, Array]] = {}

    def add(self, judged: JudgedObjects, camera: Array, turn: Array, now_ns: Array) -> None:
        """The objects of a window, and of each instant its camera, its number among those of the
        camera, and its time [ns].
        """
        earlier = [
            self._open.pop(code) for code in np.unique(camera).tolist() if code in self._open
        ]
        # The instants by camera and turn; turn -1 is the camera's last one before the window.
        instants = np.full((int(camera.max()) + 1, int(turn.max()) + 2), NONE)
        instants[camera, turn] = np.arange(len(turn))
        begin_ns = now_ns[instants[judged.camera, judged.turn]]
        begin_ns = np.concatenate([begin_ns, *(begins_ns for _, begins_ns in earlier)])
        parts = [judged, *(of_camera for of_camera, _ in earlier)]
        judged = JudgedObjects(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

        order = np.lexsort((judged.order, judged.turn, *judged.keys))
        judged, begin_ns = judged.rows(order), begin_ns[order]
        is_other = np.ones(len(order), dtype=bool)
        is_other[1:] = np.any([key[1:] != key[:-1] for key in judged.keys], axis=0)
        step = np.diff(judged.turn, prepend=0)
        # An object that is held twice at an instant counts once, and from that instant on.
        once = np.flatnonzero(is_other | (step != 0))
        is_twice = np.diff(once, append=len(order)) > 1
        judged, begin_ns = judged.rows(once), begin_ns[once]
        is_begin = (is_other | (step != 1))[once]
        since = np.maximum.accumulate(np.where(is_begin | is_twice, np.arange(len(once)), 0))
        is_last = np.append(is_begin[1:], True)[: len(once)]
        judged, begin_ns = judged.rows(is_last), begin_ns[since][is_last]

        end = instants[judged.camera, judged.turn + 1]
        over, still = np.flatnonzero(end != NONE), np.flatnonzero(end == NONE)
        over = over[np.lexsort((judged.order[over], end[over]))]
        self._write(judged.rows(over), begin_ns[over], now_ns[end[over]])
        for code in np.unique(judged.camera[still]).tolist():
            rows = still[judged.camera[still] == code]
            rows = rows[np.argsort(judged.order[rows])]
            of_camera = judged.rows(rows)._replace(turn=np.full(len(rows), -1))
            self._open[code] = of_camera, begin_ns[rows]

    def close(self) -> None:
        """What is held now is held until the end."""
        cameras = list(self.cameras)
        for code in sorted(self._open, key=lambda code: (cameras[code][0], code)):
            self._write(*self._open[code], None)

    def _write(self, judged: JudgedObjects, begin_ns: Array, end_ns: Array | None) -> None:
        cars = np.array([car for car, _ in self.cameras], dtype=np.int64)[judged.camera]
        if end_ns is None:
            end_ns = np.full(len(begin_ns), None)
        columns = {
            "method": Text.of(np.zeros(len(begin_ns), dtype=np.int64), [self._method]),
            "car": Text.of(cars, list(self._cars)),
            "label": Text.of(judged.label, list(self._labels)),
            "east_m": judged.east_m,
            "north_m": judged.north_m,
            "judged": Text.of(judged.judgement, self._judgements),
            "begin_ns": begin_ns,
            "end_ns": end_ns,
        }
        self._table.extend_columns(Columns(columns))
