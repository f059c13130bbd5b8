"""The street of a run over time, and the events of each frame: integer columns that compress well
as JSON.

A long run does not fit into one page. Then a stretch of it is kept, with every frame, step, look-up
and held object in it, rather than a thinned whole that would show a hit here and hide the next; the
page says which.

These are the data that the page's script reads (``replay_model.js``), which restores columns to
what the records have: of a column marked with + the first value is followed by the differences; of
one marked with @ each value is the place of a text in ``names``, -1 for none; and lengths, angles
and confidences are whole numbers of cm, mrad and 1/10,000 (e4). A name ends with its unit; -1 is
unknown or never; a frame's id is its place among those of all streams::

    begin_us, end_us    the stretch that is shown; instants count from the start of the run
    cars                name, edges (each with the instant in us from which on the car is linked to
                        it), cameras (whether it has any)
    edges               names
    names               all texts of all columns
    parts               the title of each part of the time
    streams             one a camera: car, stream, horizontal_fov_rad, first_id and first_frame (the
                        id and the number of its first frame), lap_ids (the first of each further
                        lap); of each frame stamp_us+, east_cm+, north_cm+, heading_mrad+
    methods             name, title, cars (those that drive under it), and columns:
      frames            by id; since the stamp: received_ns, first_answer_us, result_answer_us,
                        fresh_answer_us; outcome@, source@, served_by@, drop@; objects_served,
                        objects_result, objects_fresh, bytes_up, bytes_down
      lookups           in order of time: t_us+, frame_id, genie@, kind@, outcome@, edge and
                        neighbour (1: on an edge, asked by another edge), requests, hits, updates,
                        boost_sum_e4, entries
      held_objects      in order of time: begin_us+, took_us, car@, label@, judged@, east_cm,
                        north_cm
      steps             answer by answer: frame_id, which@, part@, place@, took_ns
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis import style
from genie_sim.base.units import NS_PER_S, duration_ns
from genie_sim.record.columns import NO_TEXT, Codes, Columns, Text
from genie_sim.record.records import COALESCED, HIT, MISS

if TYPE_CHECKING:
    from genie_sim.record.results import Run

    Column = np.ndarray[Any, Any]

US = 1_000
UNKNOWN = -1
# of frames, look-ups, steps and held objects together
MAX_ROWS = 200_000


def coded(column: Text, names: Codes) -> list[int]:
    """Of each row the place of its text among the names, -1 for none."""
    places = np.array([*(names[text] for text in column.names), UNKNOWN])  # NO_TEXT is the last
    of_rows: list[int] = places[column.codes].tolist()
    return of_rows


def texts(rows: Columns, columns: Sequence[str], names: Codes) -> dict[str, list[int]]:
    """Columns of texts, packed."""
    return {f"{name}@": coded(rows[name], names) for name in columns}


def scaled(values: "Column", scale: int) -> "Column":
    """Whole numbers of a finer unit."""
    return np.round(values * scale).astype(np.int64)


def deltas(values: "Column") -> list[int]:
    """The first value, then the differences: short numbers."""
    # Most columns have a few values, with which numpy's own difference takes ten times as long.
    return [after - before for before, after in pairwise([0, *values.tolist()])]


def integers(values: "Column") -> "Column":
    """Whole numbers, -1 for unknown."""
    return np.nan_to_num(values, nan=UNKNOWN).astype(np.int64)


def replay_data(run: "Run", start_ns: int) -> tuple[dict[str, Any] | None, str]:
    """The stretch of the run from ``start_ns`` on that fits into a page, and a sentence on what is
    left out, or empty; ``None`` of a fleet, and if no poses were written down.
    """
    scenario = run.facts["scenario"]
    if scenario.get("fleet") is not None or not run.methods:
        return None, ""
    poses = run.tables["poses"]
    if not len(poses):
        return None, "There is no replay: the run holds no poses."
    last_ns = _last_instant_ns(run)
    begin_ns = min(max(start_ns, run.warm_up_ns), int(poses["stamp_ns"].max()))
    end_ns, note = _end_ns(run, begin_ns), ""
    if begin_ns > run.warm_up_ns or end_ns < last_ns:
        is_too_large = _end_ns(run, run.warm_up_ns) < last_ns
        why = ": the page would be too large otherwise" if is_too_large else ""
        note = (
            f"The replay and the stories cover every frame from {begin_ns / NS_PER_S:.1f} s to "
            f"{end_ns / NS_PER_S:.1f} s of {last_ns / NS_PER_S:.1f} s{why}. "
            "Everything else covers the whole run. Another stretch: "
            "genie-sim report DIR --start '60 s'"
        )
    hand_overs: dict[str, list[tuple[int, str]]] = {}
    for fault in scenario.get("faults", []):
        if fault["fault"] == "hand_over":
            linked_ns = duration_ns(fault["begin"]) + duration_ns(fault["gap"])
            hand_overs.setdefault(fault["target"], []).append((linked_ns // US, fault["edge"]))
    names = Codes()
    poses = poses.rows((poses["stamp_ns"] >= begin_ns) & (poses["stamp_ns"] < end_ns))
    poses = poses.rows(np.lexsort((poses["frame"], poses["stream"].codes, poses["car"].codes)))
    data = {
        "begin_us": begin_ns // US,
        "end_us": end_ns // US,
        "cars": [
            {
                "name": car["name"],
                "edges": [(0, car["edge"]), *sorted(hand_overs.get(car["name"], []))],
                "cameras": bool(car["cameras"]),
            }
            for car in scenario["cars"]
        ],
        "edges": [edge["name"] for edge in scenario["edges"]],
        "streams": list(_streams(poses, run.tables["frames"])),
        "methods": [
            {
                "name": method.name,
                "title": method.title,
                **_of_method(run, method.name, poses, names, stretch_ns=(begin_ns, end_ns)),
            }
            for method in run.methods
        ],
        "names": list(names),
        "parts": {name: title for name, (title, _) in style.PARTS.items()},
    }
    return data, note


def _of_method(
    run: "Run", method: str, poses: Columns, names: Codes, stretch_ns: tuple[int, int]
) -> dict[str, Any]:
    """What the replay shows of one method.

    Parameters
    ----------
    run : Run
        The whole run.
    method : str
        The method's name.
    poses : Columns
        The frames that are shown; a frame's id is its place here.
    names : Codes
        Get the texts of all rows.
    stretch_ns : tuple of int
        The first instant that is shown, and the end, which is not.
    """
    tables = {name: table.where(method=method) for name, table in run.tables.items()}
    begin_ns, end_ns = stretch_ns
    return {
        "cars": tables["frames"]["car"].unique(),
        "frames": _frames(tables["frames"], poses, names),
        "lookups": _lookups(tables["lookups"], poses, names),
        "held_objects": _held_objects(tables["held_objects"], begin_ns, end_ns, names),
        "steps": _steps(tables["steps"], poses, names),
    }


def _last_instant_ns(run: "Run") -> int:
    """The last instant of frames, answers and look-ups; 0 for an empty run."""
    frames, lookups = run.tables["frames"], run.tables["lookups"]
    names = ("stamp_ns", "first_answer_ns", "result_answer_ns", "fresh_answer_ns")
    instants_ns = [*(frames.floats(name) for name in names), lookups.floats("t_ns")]
    return int(np.nanmax(np.concatenate(instants_ns), initial=0))


def _end_ns(run: "Run", begin_ns: int) -> int:
    """The end of what is shown: just after the run, else after as many whole seconds as fit, at
    least one.
    """
    tables = {"frames": "stamp_ns", "lookups": "stamp_ns", "steps": "stamp_ns"}
    tables["held_objects"] = "begin_ns"
    instants = np.sort(
        np.concatenate([run.tables[name][column] for name, column in tables.items()])
    )
    first = int(np.searchsorted(instants, begin_ns))
    if len(instants) - first <= MAX_ROWS:
        return _last_instant_ns(run) + 1
    return begin_ns + max((int(instants[first + MAX_ROWS]) - begin_ns) // NS_PER_S, 1) * NS_PER_S


def _places(poses: Columns, table: Columns) -> "Column":
    """The place in ``poses`` of the frame that each row is about, -1 where it is not there."""
    cars, streams = poses["car"].names, poses["stream"].names
    low, high = int(poses["stamp_ns"].min()), int(poses["stamp_ns"].max())

    def keys_of(rows: Columns) -> "Column":
        cameras = rows["car"].codes_in(cars) * len(streams) + rows["stream"].codes_in(streams)
        return np.asarray(cameras * (high - low + 1) + (rows["stamp_ns"] - low))

    keys, wanted_keys = keys_of(poses), keys_of(table)
    has_camera = table["car"].isin(cars) & table["stream"].isin(streams)
    in_range = (table["stamp_ns"] >= low) & (table["stamp_ns"] <= high)
    places = np.minimum(np.searchsorted(keys, wanted_keys), len(keys) - 1)
    return np.where(has_camera & in_range & (keys[places] == wanted_keys), places, UNKNOWN)


def _streams(poses: Columns, frames: Columns) -> Iterator[dict[str, Any]]:
    """The frames of each camera in order: when and where they were taken. A frame's id is its place
    in ``poses``.
    """
    laps, ids = np.zeros(len(poses), dtype=int), _places(poses, frames)
    laps[ids[ids != UNKNOWN]] = frames["lap"][ids != UNKNOWN]
    changed = (np.diff(poses["car"].codes) != 0) | (np.diff(poses["stream"].codes) != 0)
    begins = [0, *(np.flatnonzero(changed) + 1).tolist(), len(poses)]
    for begin, end in pairwise(begins):
        of_stream = poses.rows(slice(begin, end))
        lap_ids = begin + 1 + np.flatnonzero(np.diff(laps[begin:end]))
        yield {
            "car": of_stream["car"].tolist()[0],
            "stream": of_stream["stream"].tolist()[0],
            "first_id": begin,
            "first_frame": int(of_stream["frame"][0]),
            "lap_ids": lap_ids.tolist(),
            "horizontal_fov_rad": round(float(of_stream["horizontal_fov_rad"][0]), 3),
            "stamp_us+": deltas(of_stream["stamp_ns"] // US),
            "east_cm+": deltas(scaled(of_stream["east_m"], 100)),
            "north_cm+": deltas(scaled(of_stream["north_m"], 100)),
            "heading_mrad+": deltas(scaled(of_stream["heading_rad"], 1000)),
        }


def _frames(frames: Columns, poses: Columns, names: Codes) -> dict[str, Any]:
    """What became of each frame under one method, by the frame's id. Instants are counted from the
    stamp.
    """
    ids = _places(poses, frames)
    with_pose = np.flatnonzero(ids != UNKNOWN)
    rows, ids = frames.rows(with_pose), ids[with_pose]

    def by_id(values: "Column", unknown: Any = UNKNOWN) -> "Column":
        all_values = np.full(len(poses), unknown, dtype=values.dtype)
        all_values[ids] = values
        return all_values

    def numbers(values: "Column") -> list[int]:
        whole_numbers: list[int] = by_id(integers(values)).tolist()
        return whole_numbers

    instants = {
        name: rows.floats(f"{name}_ns")
        for name in ("first_answer", "result_answer", "fresh_answer")
    }
    flags = zip(rows["image_hit"].tolist(), rows["coalesced"].tolist(), strict=True)
    outcome = [
        UNKNOWN if hit is None else names[COALESCED if waits else HIT if hit else MISS]
        for hit, waits in flags
    ]
    return {
        "received_ns": numbers(rows.floats("received_ns") - rows["stamp_ns"]),
        **{
            f"{name}_us": numbers((values - rows["stamp_ns"]) // US)
            for name, values in instants.items()
        },
        "outcome@": numbers(np.array(outcome)),
        **{
            f"{name}@": coded(Text(by_id(rows[name].codes, NO_TEXT), rows[name].names), names)
            for name in ("source", "served_by", "drop")
        },
        **{
            name: numbers(rows[name])
            for name in (
                "objects_served",
                "objects_result",
                "objects_fresh",
                "bytes_up",
                "bytes_down",
            )
        },
    }


def _lookups(lookups: Columns, poses: Columns, names: Codes) -> dict[str, Any]:
    """One method's look-ups about these frames, in order of time."""
    ids = _places(poses, lookups)
    with_pose = np.flatnonzero(ids != UNKNOWN)
    with_pose = with_pose[np.argsort(lookups["t_ns"][with_pose], kind="stable")]
    rows = lookups.rows(with_pose)
    return {
        "t_us+": deltas(rows["t_ns"] // US),
        "edge": (rows["placement"] == "edge").astype(int).tolist(),
        "neighbour": (rows["requester"] == "neighbour").astype(int).tolist(),
        **texts(rows, ("genie", "kind", "outcome"), names),
        "boost_sum_e4": scaled(rows["boost_sum"], 10_000).tolist(),
        "frame_id": ids[with_pose].tolist(),
        **{name: rows[name].tolist() for name in ("requests", "hits", "updates", "entries")},
    }


def _held_objects(
    held_objects: Columns, begin_ns: int, end_ns: int, names: Codes
) -> dict[str, Any]:
    """What consumers hold or miss under one method in a stretch of time: where, how it is judged,
    since when and for how long, -1 where it does not end.
    """
    ends_ns = held_objects.floats("end_ns")
    rows = held_objects.rows((held_objects["begin_ns"] <= end_ns) & ~(ends_ns <= begin_ns)).by(
        "begin_ns"
    )
    return {
        "begin_us+": deltas(rows["begin_ns"] // US),
        "took_us": integers(rows.floats("end_ns") // US - rows["begin_ns"] // US).tolist(),
        **texts(rows, ("car", "label", "judged"), names),
        "east_cm": scaled(rows["east_m"], 100).tolist(),
        "north_cm": scaled(rows["north_m"], 100).tolist(),
    }


def _steps(steps: Columns, poses: Columns, names: Codes) -> dict[str, Any]:
    """The steps to the answers to these frames under one method, answer by answer."""
    ids = _places(poses, steps)
    with_pose = np.flatnonzero(ids != UNKNOWN)
    rows = steps.rows(with_pose)
    return {
        "frame_id": ids[with_pose].tolist(),
        **texts(rows, ("which", "part", "place"), names),
        "took_ns": (rows["end_ns"] - rows["begin_ns"]).tolist(),
    }
