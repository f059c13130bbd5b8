"""For how long consumers hold, or miss, each object in one place, judged in one way."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.judge.joins import Array
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.tables import Table


class JudgedObjects(NamedTuple):
    """Columns (n,), a row per object that is held or missed: which camera looks
    (``HeldSpans.cameras``), at which of its instants in the window, its first being turn 0, the
    order among the objects of the instant, a code of the label, where it is [m], and the index of
    the judgement.
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

    def add(
        self, judged: JudgedObjects, *, camera_of: Array, turn_of: Array, now_ns: Array
    ) -> None:
        """Adds the objects of a window, and of each instant (instants,) its camera, its turn, which
        is its number among those of the camera, and its time [ns].

        A span ends at the turn after its last one, or stays open where the window has none. Four
        rows of one object and one camera, whose turns 0 to 4 are at 100 to 500 ms; turn -1 is the
        last one before the window, in which it has been open since 70 ms::

            turn            -1     0     2     4
            begin [ms]      70   100   300   500
            last turn              0     2     4
            span is since         70   300   500
            next turn              1     3     5
            span ends            200   400  open
        """
        instants = _by_turn(camera_of, turn_of)
        begin_ns = now_ns[instants[judged.camera, judged.turn]]
        spans, begin_ns = _spans(*self._with_open(judged, begin_ns, camera_of))

        end = instants[spans.camera, spans.turn + 1]
        over = np.flatnonzero(end != NONE)
        over = over[np.lexsort((spans.order[over], end[over]))]
        self._write(spans.rows(over), begin_ns[over], now_ns[end[over]])
        self._keep_open(spans.rows(end == NONE), begin_ns[end == NONE])

    def _with_open(
        self, judged: JudgedObjects, begin_ns: Array, camera: Array
    ) -> tuple[JudgedObjects, Array]:
        """These objects, and since when each is so [ns], with those that are open of the cameras,
        which are open no more.
        """
        codes = [code for code in np.unique(camera).tolist() if code in self._open]
        parts = [(judged, begin_ns), *map(self._open.pop, codes)]
        columns = zip(*(objects for objects, _ in parts), strict=True)
        begins_ns = np.concatenate([begins_ns for _, begins_ns in parts])
        return JudgedObjects(*map(np.concatenate, columns)), begins_ns

    def _keep_open(self, spans: JudgedObjects, begin_ns: Array) -> None:
        """Keeps what was judged at the last instant of its camera, which is turn -1 from now on."""
        for code in np.unique(spans.camera).tolist():
            rows = np.flatnonzero(spans.camera == code)
            rows = rows[np.argsort(spans.order[rows])]
            of_camera = spans.rows(rows)._replace(turn=np.full(len(rows), -1))
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


def _by_turn(camera: Array, turn: Array) -> Array:
    """The index of the instant at each turn of each camera, (cameras, turns + 1), or ``NONE``.

    >>> _by_turn(np.array([0, 1, 0]), np.array([0, 0, 1]))
    array([[ 0,  2, -1],
           [ 1, -1, -1]])
    """
    instants = np.full((int(camera.max()) + 1, int(turn.max()) + 2), NONE)
    instants[camera, turn] = np.arange(len(turn))
    return instants


def _spans(judged: JudgedObjects, begin_ns: Array) -> tuple[JudgedObjects, Array]:
    """Of objects at instants, and since when each is so as far as its row tells [ns], the spans
    without a gap: the row of the last instant of each, and since when the span is.

    An object that is held twice at an instant counts once, and from that instant on. Four rows of
    an object, three of them distinct, which make two spans::

        turn          3    4    6    6
        begin_ns     30   40   60   60
        is_distinct   x    x    x
        is_begin      x         x
        is_last            x    x
        span         30 to 4   60 to 6
    """
    order = np.lexsort((judged.order, judged.turn, *judged.keys))
    judged, begin_ns = judged.rows(order), begin_ns[order]
    is_other = np.ones(len(order), dtype=bool)
    is_other[1:] = np.any([key[1:] != key[:-1] for key in judged.keys], axis=0)
    turns_since = np.diff(judged.turn, prepend=0)
    distinct = np.flatnonzero(is_other | (turns_since != 0))
    is_twice = np.diff(distinct, append=len(order)) > 1
    is_begin = (is_other | (turns_since != 1))[distinct]
    judged, begin_ns = judged.rows(distinct), begin_ns[distinct]

    counted_from = np.where(is_begin | is_twice, np.arange(len(distinct)), 0)
    first_row = np.maximum.accumulate(counted_from)
    is_last = np.append(is_begin[1:], True)[: len(distinct)]
    return judged.rows(is_last), begin_ns[first_row][is_last]
