"""The street of a run over time, and the story of each frame: columns of whole numbers that pack well as JSON.

A long run does not fit into one page. Then a stretch of it is kept, with every frame, step, look-up and change of the
object maps in it, rather than a thinned whole that would show a hit here and hide the next; the page says which.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis import style
from genie_sim.recording.columns import NO_TEXT, Columns, Text
from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    from genie_sim.recording.results import Run

    Column = np.ndarray[Any, Any]

MOST_ROWS = (
    200_000  # of frames, look-ups, map changes, steps and held objects together: about 7 MB of JSON
)
US = 1_000
KINDS = ("image", "sighting", "boost")
OUTCOMES = ("miss", "hit", "coalesced")
WHICHS = ("first", "fresh", "both")
JUDGED = ("right", "missed", "moved_away", "never_there", "duplicate")
UNKNOWN = -1


class _Names:
    """Texts that many rows share; a row holds a text's number, or -1 for none."""

    def __init__(self) -> None:
        self.all: dict[str, int] = {}

    def code(self, name: object) -> int:
        return self.all.setdefault(str(name), len(self.all))

    def codes(self, column: Text) -> list[int]:
        """Of a column; new texts are numbered as they first occur."""
        codes, first = np.unique(column.codes, return_index=True)
        places = {
            int(code): self.code(column.names[code])
            for code in codes[np.argsort(first)]
            if code != NO_TEXT
        }
        numbers = np.full(len(column.names) + 1, UNKNOWN)
        numbers[list(places)] = list(places.values())
        found: list[int] = numbers[column.codes].tolist()
        return found


def replay_data(run: "Run", start_ns: int, notes: list[str]) -> dict[str, Any] | None:
    """The stretch of the run from ``start_ns`` on that fits into a page; ``None`` if no poses were written down."""
    if run.facts["scenario"].get("fleet") is not None:
        return None  # it has a map
    poses = run.tables["poses"]
    if not len(poses):
        notes.append("There is no replay: the run holds no poses.")
        return None
    last_ns = last_instant_ns(run)
    begin_ns = min(max(start_ns, 0), int(poses["stamp_ns"].max()))
    end_ns = _end_ns(run, begin_ns)
    if begin_ns > 0 or end_ns < last_ns:
        notes.append(
            f"The replay and the stories cover every frame from {begin_ns / NS_PER_S:.1f} s to "
            f"{end_ns / NS_PER_S:.1f} s of {last_ns / NS_PER_S:.1f} s: "
            "the page would be too large otherwise. "
            "Everything else covers the whole run. Another stretch: genie-sim report DIR --start '60 s'"
        )
    names = _Names()
    poses = _between(poses, "stamp_ns", begin_ns, end_ns)
    poses = poses.rows(np.lexsort((poses["frame"], poses["stream"].codes, poses["car"].codes)))
    return {
        "begin_us": begin_ns // US,
        "end_us": end_ns // US,
        "streams": list(_streams(poses)),
        "methods": [
            {
                "name": method.name,
                "frames": _frames(run.tables["frames"].where(method=method.name), poses, names),
                "lookups": _lookups(run.tables["lookups"].where(method=method.name), poses, names),
                "objects": list(
                    _objects(
                        run.tables["objects"].where(method=method.name), begin_ns, end_ns, names
                    )
                ),
                "held": dict(
                    _held(run.tables["held"].where(method=method.name, what="consumer"), end_ns)
                ),
                "held_objects": _held_objects(
                    run.tables["held_objects"].where(method=method.name), begin_ns, end_ns, names
                ),
                "steps": _steps(run.tables["steps"].where(method=method.name), poses, names),
            }
            for method in run.methods
        ],
        "names": list(names.all),
        "kinds": KINDS,
        "outcomes": OUTCOMES,
        "whichs": WHICHS,
        "judged": JUDGED,
    }


def last_instant_ns(run: "Run") -> int:
    """The last instant on record: of frames, answers, look-ups and object maps; 0 for an empty run."""
    instants = {
        "frames": ["stamp_ns", "first_answer_ns", "fresh_answer_ns"],
        "lookups": ["t_ns"],
        "objects": ["t_ns"],
    }
    found = (
        run.tables[table].floats(column)
        for table, columns in instants.items()
        for column in columns
    )
    return max((int(np.nanmax(one)) for one in found if not np.isnan(one).all()), default=0)


def _end_ns(run: "Run", begin_ns: int) -> int:
    """The last instant that is shown: that of the run, else as many whole seconds as fit, at least one."""
    tables = {"frames": "stamp_ns", "lookups": "stamp_ns", "objects": "t_ns", "steps": "stamp_ns"}
    tables["held_objects"] = "begin_ns"
    instants = np.sort(
        np.concatenate([run.tables[name][column] for name, column in tables.items()])
    )
    first = int(np.searchsorted(instants, begin_ns))
    if len(instants) - first <= MOST_ROWS:
        return last_instant_ns(run)
    return begin_ns + max((int(instants[first + MOST_ROWS]) - begin_ns) // NS_PER_S, 1) * NS_PER_S


def _between(table: Columns, column: str, begin_ns: int, end_ns: int) -> Columns:
    return table.rows((table[column] >= begin_ns) & (table[column] < end_ns))


def _places(poses: Columns, table: Columns, column: str) -> "Column":
    """The place in ``poses`` of the frame that each row is about, -1 where it is not there; a frame is told by its
    camera and by ``column``, which is its number or its stamp."""
    cars, streams = poses["car"].names, poses["stream"].names
    least, most = int(poses[column].min()), int(poses[column].max())
    keys, sought = (
        (one["car"].codes_in(cars) * len(streams) + one["stream"].codes_in(streams))
        * (most - least + 1)
        + (one[column].astype(np.int64) - least)
        for one in (poses, table)
    )
    there = (table["car"].isin(cars) & table["stream"].isin(streams)) & (table[column] >= least)
    found = np.minimum(np.searchsorted(keys, sought), len(keys) - 1)
    return np.where(there & (table[column] <= most) & (keys[found] == sought), found, UNKNOWN)


def _streams(poses: Columns) -> Iterator[dict[str, Any]]:
    """The frames of each camera in order: when and where they were taken. A frame's id is its place in ``poses``."""
    changed = (np.diff(poses["car"].codes) != 0) | (np.diff(poses["stream"].codes) != 0)
    begins = [0, *(np.flatnonzero(changed) + 1).tolist(), len(poses)]
    for begin, end in pairwise(begins):
        mine = poses.rows(slice(begin, end))
        yield {
            "car": mine["car"].tolist()[0],
            "stream": mine["stream"].tolist()[0],
            "first_id": begin,
            "first_frame": int(mine["frame"][0]),
            "fov_mrad": round(1000 * float(mine["horizontal_fov_rad"][0])),
            "stamp_us": _deltas(mine["stamp_ns"] // US),
            "east_cm": _deltas(_scaled(mine["east_m"], 100)),
            "north_cm": _deltas(_scaled(mine["north_m"], 100)),
            "heading_mrad": _deltas(_scaled(mine["heading_rad"], 1000)),
        }


def _frames(mine: Columns, poses: Columns, names: _Names) -> dict[str, Any]:
    """What became of each frame under one method, by the frame's id. Instants are counted from the stamp."""
    ids = _places(poses, mine, "frame")
    here = np.flatnonzero(ids != UNKNOWN)
    rows, ids = mine.rows(here), ids[here]

    def by_id(values: "Column", unknown: Any = UNKNOWN) -> "Column":
        found = np.full(len(poses), unknown, dtype=values.dtype)
        found[ids] = values
        return found

    def numbers(values: "Column") -> list[int]:
        found: list[int] = by_id(_integers(values)).tolist()
        return found

    instants = {
        name: rows.floats(f"{name}_ns") for name in ("received", "first_answer", "fresh_answer")
    }
    flags = zip(rows["image_hit"].tolist(), rows["coalesced"].tolist(), strict=True)
    outcome = [UNKNOWN if hit is None else 2 if coalesced else int(hit) for hit, coalesced in flags]
    texts = {name: rows[name] for name in ("source", "served_by", "drop")}
    return {
        **{
            f"{name}_us": numbers((values - rows["stamp_ns"]) // US)
            for name, values in instants.items()
        },
        "outcome": numbers(np.array(outcome)),
        **{
            name: names.codes(Text(by_id(text.codes, NO_TEXT), text.names))
            for name, text in texts.items()
        },
        **{
            name: numbers(rows[name])
            for name in ("objects_served", "objects_fresh", "bytes_up", "bytes_down")
        },
    }


def _lookups(mine: Columns, poses: Columns, names: _Names) -> dict[str, Any]:
    """One method's look-ups about these frames, in order of time."""
    ids = _places(poses, mine, "stamp_ns")
    here = np.flatnonzero(ids != UNKNOWN)
    here = here[np.argsort(mine["t_ns"][here], kind="stable")]
    rows = mine.rows(here)
    return {
        "t_us": _deltas(rows["t_ns"] // US),
        "genie": names.codes(rows["genie"]),
        "edge": (rows["placement"] == "edge").astype(int).tolist(),
        "neighbour": (rows["requester"] == "neighbour").astype(int).tolist(),
        "kind": rows["kind"].codes_in(KINDS).tolist(),
        "outcome": rows["outcome"].codes_in(OUTCOMES).tolist(),
        "boost_e4": _scaled(rows["boost_sum"], 10_000).tolist(),
        "frame_id": ids[here].tolist(),
        **{name: rows[name].tolist() for name in ("requests", "hits", "updates", "entries")},
    }


def _held(mine: Columns, end_ns: int) -> Iterator[tuple[str, dict[str, list[int]]]]:
    """By car, where the truth is known: how many objects its consumer holds at each instant, and how many are there."""
    for car, rows in mine.rows(mine["stamp_ns"] <= end_ns).groups("car"):
        counts = {name: rows[name].tolist() for name in ("held", "right")}
        yield car, {"t_us": _deltas(rows["stamp_ns"] // US), **counts}


def _held_objects(mine: Columns, begin_ns: int, end_ns: int, names: _Names) -> dict[str, Any]:
    """What consumers hold or miss under one method in a stretch of time: where, how it is judged, since when and for
    how long, -1 where it does not end."""
    ends_ns = mine.floats("end_ns")
    rows = mine.rows((mine["begin_ns"] <= end_ns) & ~(ends_ns <= begin_ns)).by("begin_ns")
    return {
        "begin_us": _deltas(rows["begin_ns"] // US),
        "took_us": _integers(rows.floats("end_ns") // US - rows["begin_ns"] // US).tolist(),
        "car": names.codes(rows["car"]),
        "label": names.codes(rows["label"]),
        "judged": rows["judged"].codes_in(JUDGED).tolist(),
        "east_cm": _scaled(rows["east_m"], 100).tolist(),
        "north_cm": _scaled(rows["north_m"], 100).tolist(),
    }


def _steps(mine: Columns, poses: Columns, names: _Names) -> dict[str, Any]:
    """The steps to the answers to these frames under one method, answer by answer."""
    ids = _places(poses, mine, "stamp_ns")
    here = np.flatnonzero(ids != UNKNOWN)
    rows = mine.rows(here)
    return {
        "frame_id": ids[here].tolist(),
        "which": rows["which"].codes_in(WHICHS).tolist(),
        "part": rows["part"].codes_in(tuple(style.PARTS)).tolist(),
        "place": names.codes(rows["place"]),
        "took_ns": (rows["end_ns"] - rows["begin_ns"]).tolist(),
    }


def _objects(mine: Columns, begin_ns: int, end_ns: int, names: _Names) -> Iterator[list[Any]]:
    """One method's map objects: where each is, and its confidence from each instant on, -1 where it is forgotten."""
    mine = mine.rows(mine["t_ns"] <= end_ns)
    keys = [mine["north_m"], mine["east_m"], mine["label"].codes, mine["genie"].codes]
    mine = mine.rows(np.lexsort(keys))
    places = [mine["genie"].codes, mine["label"].codes, mine["east_m"], mine["north_m"]]
    begins = np.flatnonzero(np.any([np.diff(one, prepend=np.nan) != 0 for one in places], axis=0))
    genies, labels, all_ns = mine["genie"].tolist(), mine["label"].tolist(), mine["t_ns"]
    confidence = _scaled(np.nan_to_num(mine["confidence"], nan=UNKNOWN / 1000), 1000)
    for begin, end in pairwise([*begins.tolist(), len(mine)]):
        t_ns = all_ns[begin:end]
        first = max(
            int(np.searchsorted(t_ns, begin_ns, side="right")) - 1, 0
        )  # the last before the replay begins
        yield [
            names.code(genies[begin]),
            names.code(labels[begin]),
            round(100 * mine["east_m"][begin]),
            round(100 * mine["north_m"][begin]),
            _deltas(np.maximum(t_ns[first:], begin_ns) // NS_PER_MS),
            confidence[begin + first : end].tolist(),
        ]


def _scaled(values: "Column", scale: int) -> "Column":
    return np.round(values * scale).astype(np.int64)


def _deltas(values: "Column") -> list[int]:
    """The first value, then the differences: short numbers."""
    deltas: list[int] = np.diff(values, prepend=0).tolist()
    return deltas


def _integers(values: "Column") -> "Column":
    """Whole numbers, -1 for unknown."""
    return np.nan_to_num(values, nan=UNKNOWN).astype(np.int64)
