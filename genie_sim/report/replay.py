"""The street of a run over time, and the story of each frame: columns of whole numbers that pack well as JSON.

A long run does not fit into one page. Then a stretch of it is kept, with every frame, look-up and change of the object
maps in it, rather than a thinned whole that would show a hit here and hide the next; the page says which stretch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

    from genie_sim.recording.results import Run

    Column = np.ndarray[Any, Any]

MOST_ROWS = 200_000  # of frames, look-ups and map changes together: about 7 MB of JSON
US = 1_000
KINDS = ("image", "sighting", "boost")
OUTCOMES = ("miss", "hit", "coalesced")
UNKNOWN = -1


class _Names:
    """Texts that many rows share; a row holds a text's number, or -1 for none."""

    def __init__(self) -> None:
        self.all: dict[str, int] = {}

    def code(self, name: object) -> int:
        return self.all.setdefault(str(name), len(self.all))

    def codes(self, column: pd.Series[Any]) -> list[int]:
        import pandas as pd

        values, names = pd.factorize(column.astype(object), use_na_sentinel=True)
        numbers = np.array([*map(self.code, names), UNKNOWN])
        codes: list[int] = numbers[values].tolist()
        return codes


def replay_data(run: Run, start_ns: int, notes: list[str]) -> dict[str, Any] | None:
    """The stretch of the run from ``start_ns`` on that fits into a page; ``None`` if no poses were written down."""
    if run.facts["scenario"].get("fleet") is not None:
        notes.append("There is no replay of a fleet: its cars are too many, and change their edges.")
        return None
    if run.poses.empty:
        notes.append("There is no replay: the run holds no poses.")
        return None
    last_ns = last_instant_ns(run)
    begin_ns = min(max(start_ns, 0), int(run.poses["stamp_ns"].max()))
    end_ns = _end_ns(run, begin_ns)
    if begin_ns > 0 or end_ns < last_ns:
        notes.append(
            f"The replay and the stories cover every frame from {begin_ns / NS_PER_S:.1f} s to "
            f"{end_ns / NS_PER_S:.1f} s of {last_ns / NS_PER_S:.1f} s: "
            "the page would be too large otherwise. "
            "Everything else covers the whole run. Another stretch: genie-sim report DIR --start '60 s'"
        )
    names = _Names()
    shown = _between(run.poses, "stamp_ns", begin_ns, end_ns)
    poses = shown.sort_values(["car", "stream", "frame"], ignore_index=True)
    return {
        "begin_us": begin_ns // US,
        "end_us": end_ns // US,
        "streams": list(_streams(poses)),
        "methods": [
            {
                "name": method.name,
                "frames": _frames(run.frames[run.frames["method"] == method.name], poses, names),
                "lookups": _lookups(run.lookups[run.lookups["method"] == method.name], poses, names),
                "objects": list(_objects(run.objects[run.objects["method"] == method.name], begin_ns, end_ns, names)),
            }
            for method in run.methods
        ],
        "names": list(names.all),
        "kinds": KINDS,
        "outcomes": OUTCOMES,
    }


def last_instant_ns(run: Run) -> int:
    """The last instant on record: of frames, answers, look-ups and object maps; 0 for an empty run."""
    instants = {"frames": ["stamp_ns", "first_answer_ns", "fresh_answer_ns"], "lookups": ["t_ns"], "objects": ["t_ns"]}
    found = (getattr(run, table)[column].max() for table, columns in instants.items() for column in columns)
    return max((int(last) for last in found if last == last), default=0)


def _end_ns(run: Run, begin_ns: int) -> int:
    """The last instant that is shown: that of the run, else as many whole seconds as fit, at least one."""
    tables = ((run.frames, "stamp_ns"), (run.lookups, "stamp_ns"), (run.objects, "t_ns"))
    instants = np.sort(np.concatenate([table[column].to_numpy(np.int64) for table, column in tables]))
    first = int(np.searchsorted(instants, begin_ns))
    if len(instants) - first <= MOST_ROWS:
        return last_instant_ns(run)
    return begin_ns + max((int(instants[first + MOST_ROWS]) - begin_ns) // NS_PER_S, 1) * NS_PER_S


def _between(table: pd.DataFrame, column: str, begin_ns: int, end_ns: int) -> pd.DataFrame:
    return table[(table[column] >= begin_ns) & (table[column] < end_ns)]


def _about(table: pd.DataFrame, poses: pd.DataFrame) -> pd.DataFrame:
    """The rows about frames of the stretch that is shown."""
    return _between(table, "stamp_ns", int(poses["stamp_ns"].min()), int(poses["stamp_ns"].max()) + 1)


def _streams(poses: pd.DataFrame) -> Any:
    """The frames of each camera in order: when and where they were taken. A frame's id is its place in ``poses``."""
    for (car, stream), mine in poses.groupby(["car", "stream"], observed=True, sort=False):
        yield {
            "car": car,
            "stream": stream,
            "first_id": int(mine.index[0]),
            "first_frame": int(mine["frame"].iloc[0]),
            "fov_mrad": round(1000 * float(mine["horizontal_fov_rad"].iloc[0])),
            "stamp_us": _deltas(mine["stamp_ns"].to_numpy() // US),
            "east_cm": _deltas(_scaled(mine["east_m"], 100)),
            "north_cm": _deltas(_scaled(mine["north_m"], 100)),
            "heading_mrad": _deltas(_scaled(mine["heading_rad"], 1000)),
        }


def _frames(mine: pd.DataFrame, poses: pd.DataFrame, names: _Names) -> dict[str, Any]:
    """What became of each frame under one method, by the frame's id. Instants are counted from the stamp."""
    key = ["car", "stream", "frame"]
    rows = _plain(poses)[key].merge(_plain(_about(mine, poses)), on=key, how="left", validate="one_to_one")
    since = {name: rows[f"{name}_ns"] - rows["stamp_ns"] for name in ("received", "first_answer", "fresh_answer")}
    hit = np.where(rows["coalesced"].eq(True), 2, np.where(rows["image_hit"].eq(True), 1, 0))
    return {
        **{f"{name}_us": _integers(values // US) for name, values in since.items()},
        "outcome": np.where(rows["image_hit"].isna(), UNKNOWN, hit).tolist(),
        **{name: names.codes(rows[name]) for name in ("source", "served_by", "drop")},
        **{name: _integers(rows[name]) for name in ("objects_served", "objects_fresh", "bytes_up", "bytes_down")},
    }


def _lookups(mine: pd.DataFrame, poses: pd.DataFrame, names: _Names) -> dict[str, Any]:
    """One method's look-ups about these frames, in order of time."""
    key = ["car", "stream", "stamp_ns"]
    ids = _plain(poses)[key].assign(frame_id=poses.index)
    rows = _plain(_about(mine, poses)).merge(ids, on=key, how="inner", validate="many_to_one")
    rows = rows.sort_values("t_ns", kind="stable")
    return {
        "t_us": _deltas(rows["t_ns"].to_numpy() // US),
        "genie": names.codes(rows["genie"]),
        "edge": (rows["placement"] == "edge").astype(int).tolist(),
        "neighbour": (rows["requester"] == "neighbour").astype(int).tolist(),
        "kind": rows["kind"].astype(str).map(KINDS.index).tolist(),
        "outcome": rows["outcome"].astype(object).map(_outcome).tolist(),
        "boost_e4": _scaled(rows["boost_sum"], 10_000).tolist(),
        **{name: rows[name].tolist() for name in ("frame_id", "requests", "hits", "updates", "entries")},
    }


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """Cars and streams as text: two tables' categories may differ, and then do not compare."""
    return table.astype({"car": str, "stream": str})


def _outcome(outcome: object) -> int:
    return OUTCOMES.index(outcome) if isinstance(outcome, str) else UNKNOWN


def _objects(mine: pd.DataFrame, begin_ns: int, end_ns: int, names: _Names) -> Any:
    """One method's map objects: where each is, and its confidence from each instant on, -1 where it is forgotten."""
    changes = mine[mine["t_ns"] <= end_ns]
    by_object: Any = changes.groupby(["genie", "label", "east_m", "north_m"], observed=True, sort=True)
    for (genie, label, east_m, north_m), of_one in by_object:
        t_ns = of_one["t_ns"].to_numpy()
        first = max(int(np.searchsorted(t_ns, begin_ns, side="right")) - 1, 0)  # the last before the replay begins
        yield [
            names.code(genie),
            names.code(label),
            round(100 * east_m),
            round(100 * north_m),
            _deltas(np.maximum(t_ns[first:], begin_ns) // NS_PER_MS),
            _scaled(of_one["confidence"].iloc[first:].fillna(UNKNOWN / 1000), 1000).tolist(),
        ]


def _scaled(values: pd.Series[Any], scale: int) -> Column:
    return np.round(values.to_numpy(np.float64) * scale).astype(np.int64)


def _deltas(values: Column) -> list[int]:
    """The first value, then the differences: short numbers."""
    deltas: list[int] = np.diff(values.astype(np.int64), prepend=0).tolist()
    return deltas


def _integers(values: pd.Series[Any]) -> list[int]:
    """Whole numbers, -1 for unknown."""
    numbers = np.nan_to_num(values.to_numpy(np.float64, na_value=np.nan), nan=UNKNOWN)
    whole: list[int] = numbers.astype(np.int64).tolist()
    return whole
