"""For how long consumers hold, or miss, each object in one place, judged in one way."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.judge.joins import Array, rows_of
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.tables import Table


class JudgedObjects(NamedTuple):
    """Columns (n,), a row per object that is held or missed at an instant: the index of the
    instant, the code of its camera, since when it is so [ns], a code of the label, the index of the
    judgement, and where it is [m].
    """

    instant: Array
    camera: Array
    begin_ns: Array
    label: Array
    judgement: Array
    east_m: Array
    north_m: Array


class HeldSpans:
    """Writes a row of ``held_objects`` for each object when it is judged as it is no more.

    Parameters
    ----------
    method : str
        The name under which rows are written.
    table : Table
        Gets the rows (``records.HELD_OBJECTS``).
    cameras, labels : Codes
        The codes of cameras, each a car and a stream, and of labels.
    judgements : sequence of str
        The names of the judgements.
    """

    def __init__(
        self,
        method: str,
        table: Table,
        cameras: Codes,
        labels: Codes,
        judgements: Sequence[str],
    ) -> None:
        self._method = method
        self._table = table
        self._cameras = cameras
        self._labels = labels
        self._judgements = judgements
        # what was held or missed at the last instant of each camera
        self._open = JudgedObjects(*np.zeros((5, 0), dtype=np.int64), *np.zeros((2, 0)))

    def add(self, objects: JudgedObjects, *, camera: Array, now_ns: Array) -> None:
        """Adds the objects of a window, and of each of its instants (instants,) the code of the
        camera and the time [ns].

        A span ends at the instant of its camera that follows its last one, or stays open where the
        window has none. Before the window's instants come the last ones of all cameras, at which
        earlier spans are open. A window with two instants of the first of two cameras::

            instant      0    1    2    3
            camera       0    1    0    0
            following    2    4    3    4

        A span that has its last row at instant 0 ends at 2, at 2 it ends at 3; at 1 or at 3 it
        stays open: there is no instant 4.
        """
        before = len(self._cameras)
        following = _following(np.append(np.arange(before), camera))
        objects = objects._replace(instant=before + objects.instant)
        objects = JudgedObjects(*map(np.append, self._open, objects))

        first, last = _spans(objects, following)
        end = following[objects.instant[last]]
        order = np.lexsort((first, objects.begin_ns[first], end))
        spans, end = rows_of(objects, first[order]), end[order]
        is_over = end < len(following)
        self._write(rows_of(spans, is_over), now_ns[end[is_over] - before])
        still_open = rows_of(spans, ~is_over)
        # next time the last instant of each camera has the index that is the camera's code
        self._open = still_open._replace(instant=still_open.camera)

    def close(self) -> None:
        """What is held now is held until the end."""
        spans = rows_of(self._open, np.argsort(self._open.camera, kind="stable"))
        self._write(spans, np.full(len(spans.camera), None))

    def _write(self, spans: JudgedObjects, end_ns: Array) -> None:
        columns = {
            "method": Text.of(np.zeros(len(end_ns), dtype=np.int64), [self._method]),
            "car": Text.of(spans.camera, [car for car, _ in self._cameras]),
            "stream": Text.of(spans.camera, [stream for _, stream in self._cameras]),
            "label": Text.of(spans.label, list(self._labels)),
            "east_m": spans.east_m,
            "north_m": spans.north_m,
            "judged": Text.of(spans.judgement, self._judgements),
            "begin_ns": spans.begin_ns,
            "end_ns": end_ns,
        }
        self._table.extend_columns(Columns(columns))


def _following(camera: Array) -> Array:
    """The index of the next instant of the same camera, for each of (n,) instants; n for none.

    >>> _following(np.array([0, 1, 0, 0]))
    array([2, 4, 3, 4])
    """
    order = np.argsort(camera, kind="stable")
    is_same = np.diff(camera[order]) == 0
    following = np.full(len(camera), len(camera))
    following[order[:-1][is_same]] = order[1:][is_same]
    return following


def _spans(objects: JudgedObjects, following: Array) -> tuple[Array, Array]:
    """The first and the last row of each span: rows of one camera, label, place and judgement, of
    which each is at the instant of the one before (such an object is held twice) or at the one that
    follows it (``_following``).

    An object at three of one camera's instants, 0, 1 and 3, twice at the last one: two spans.

    >>> same = np.zeros(4, dtype=int)
    >>> objects = JudgedObjects(np.array([0, 1, 3, 3]), *[same] * 6)
    >>> _spans(objects, _following(np.zeros(4)))
    (array([0, 2]), array([1, 3]))
    """
    instant, camera, _, *rest = objects
    order = np.lexsort((instant, camera, *rest))
    goes_on = instant[order][1:] <= following[instant[order]][:-1]
    for column in (camera, *rest):
        goes_on &= np.diff(column[order]) == 0
    is_first = np.ones(len(order), dtype=bool)
    is_last = is_first.copy()
    is_first[1:] = is_last[:-1] = ~goes_on
    return order[is_first], order[is_last]
