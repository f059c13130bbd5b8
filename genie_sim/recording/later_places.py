"""What was visible where lately, where each of several processes judges some cars.

Whether an object that is held has moved away depends on what any car could see, so only all parts
together tell. Each part notes what it would have to know, and counts these objects as never there.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from genie_sim.recording.columns import Array, Columns, Text, concat
from genie_sim.recording.joins import GroupedPlaces
from genie_sim.recording.objects import Codes
from genie_sim.recording.recent_places import RecentPlaces
from genie_sim.recording.records import CONSUMER
from genie_sim.recording.tables import Column, Schema, Table

_PLACE = (
    Column("scene", "int64", "", "the row of the table held, of this part"),
    Column("class", "text", "", "class of the object"),
    Column("east_m", "float64", "m", "its place"),
    Column("north_m", "float64", "m", "its place"),
)
GHOSTS = Schema(
    "ghosts",
    "One row per object that is held where none is.",
    (*_PLACE, Column("reach_m", "float64", "m", "how far away another may have been")),
)
VISIBLE = Schema("visible", "One row per visible object and instant.", _PLACE)
INSTANTS_AT_ONCE = 8192


class LaterPlaces:
    """Notes the objects of one part that are held where none is, and what is visible."""

    def __init__(self, ghosts: Table, visible: Table) -> None:
        self._ghosts = ghosts
        self._visible = visible

    def note(
        self,
        ghosts: GroupedPlaces,
        visible: GroupedPlaces,
        *,
        ghost_scenes: Array,
        visible_scenes: Array,
        reach_m: Array,
        labels: Sequence[str],
    ) -> None:
        """Adds those of a window, grouped by the codes of their classes (``labels``), with the rows
        of their scenes.
        """
        of_ghosts = _columns(ghosts, ghost_scenes, labels)
        self._ghosts.extend(Columns({**of_ghosts, "reach_m": reach_m}))
        self._visible.extend(Columns(_columns(visible, visible_scenes, labels)))


def _columns(
    places: GroupedPlaces, scenes: Array, labels: Sequence[str]
) -> dict[str, Array | Text]:
    return {
        "scene": scenes,
        "class": Text.of(places.group, labels),
        "east_m": places.east_m,
        "north_m": places.north_m,
    }


def with_moved_away(
    held: Sequence[Columns], ghosts: Sequence[Columns], visible: Sequence[Columns], order: Array
) -> Columns:
    """The rows of ``held`` of all parts in their ``order``, with the objects that have moved away.

    Parameters
    ----------
    held, ghosts, visible : sequence of Columns
        What each part has written and noted.
    order : array
        Indices of the rows of all parts, one part after the other, in the order of time.
    """
    rows = concat(held).rows(order)
    place = np.empty_like(order)  # of each row in that order
    place[order] = np.arange(len(order))
    begins = np.cumsum([0, *map(len, held[:-1])])
    ghost_rows, visible_rows = (_in_order(noted, begins, place) for noted in (ghosts, visible))
    is_instant = rows["what"] == CONSUMER
    instant_of = np.cumsum(is_instant) - 1  # what is found without delay belongs to the one before
    now_ns = rows["stamp_ns"][is_instant]
    recent, classes = RecentPlaces(), Codes()
    moved_away = np.zeros(len(rows), dtype=np.int64)
    for begin in range(0, len(now_ns), INSTANTS_AT_ONCE):
        end = min(begin + INSTANTS_AT_ONCE, len(now_ns))
        first, last = np.searchsorted(instant_of, [begin, end])
        asked, seen = (_between(noted, first, last) for noted in (ghost_rows, visible_rows))
        codes = [recent.codes[place] for place in _places(seen, classes)]
        groups = np.array([code for code, _, _ in _places(asked, classes)], dtype=np.int64)
        were_there = recent.were_there(
            GroupedPlaces(groups, asked["east_m"], asked["north_m"]),
            reach_m=asked["reach_m"],
            instant=instant_of[asked["scene"]] - begin,
            visible=np.stack([np.array(codes, dtype=np.int64), instant_of[seen["scene"]] - begin]),
            now_ns=now_ns[begin:end],
        )
        np.add.at(moved_away, asked["scene"][were_there], 1)
    return rows.assign(
        moved_away=rows["moved_away"] + moved_away, never_there=rows["never_there"] - moved_away
    )


def _in_order(noted: Sequence[Columns], begins: Array, place: Array) -> Columns:
    """What all parts have noted, in the order of the rows that it belongs to."""
    part = np.repeat(begins, [len(of_part) for of_part in noted])
    rows = concat(noted)
    return rows.assign(scene=place[rows["scene"] + part]).by("scene")


def _between(noted: Columns, first: int, last: int) -> Columns:
    """What belongs to the rows from the first to before the last one."""
    return noted.rows(slice(*np.searchsorted(noted["scene"], [first, last])))


def _places(noted: Columns, classes: Codes) -> Iterator[tuple[int, float, float]]:
    """The code of the class of each, and its place."""
    names = [classes[name] for name in noted["class"].names]
    codes = (names[code] for code in noted["class"].codes.tolist())
    return zip(codes, noted["east_m"].tolist(), noted["north_m"].tolist(), strict=True)
