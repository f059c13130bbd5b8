"""Truth tables: what really stood in view of each frame of a trace, computed from KITTI's labels.

One Parquet file beside the trace, ``NAME.truth.parquet`` beside ``NAME.parquet``: one row per frame and object, with
the digests of the trace and of the labels in the schema's metadata. Labels themselves are not in it.
"""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from genie_sim import parquet
from genie_sim.core.geometry import Geodetic, transform
from genie_sim.errors import UserError, as_user_error
from genie_sim.messages import Frame, Location
from genie_sim.perception.trace import POSITION_DECIMALS, Trace

if TYPE_CHECKING:
    import pyarrow

FORMAT_VERSION = 1
SUFFIX = ".truth.parquet"
REACH_M = (
    2.0  # an object is a labelled one within this distance: half of what separates parked cars
)
RANGE_M = 40.0  # where KITTI's labels end
LABELS = {
    "vehicles": "car",
    "persons": "person",
}  # groups of labels, and the classes under which they are compared
KNOWN = ("car", "truck", "bus", "person")  # what a detector may call them; nothing else is labelled


class TruthRow(NamedTuple):
    """One object in view of one frame. ``visible``: it counts in KITTI's benchmark (at least 25 pixels high, mostly in
    the picture, and how hidden it is was judged)."""

    camera: str
    frame: int
    stamp_ns: int
    object: int
    label: str
    moving: bool
    visible: bool
    east_m: float
    north_m: float
    up_m: float

    @property
    def location(self) -> Location:
        return self.east_m, self.north_m, self.up_m


@dataclass(frozen=True, slots=True)
class TruthTable:
    """The rows of one trace, placed around one geodetic origin. ``trace`` is the digest of the trace they belong to;
    ``digest`` is the sha256 of trace, origin and rows."""

    trace: str
    origin: Geodetic
    rows: tuple[TruthRow, ...]
    provenance: Mapping[str, Any]
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        text = json.dumps(
            [self.trace, [float(x) for x in self.origin], self.rows], separators=(",", ":")
        )
        object.__setattr__(self, "digest", hashlib.sha256(text.encode()).hexdigest())

    def rebased(self, origin: Geodetic) -> "TruthTable":
        """The same around another origin, as ``Trace.rebased``."""
        if tuple(origin) == tuple(self.origin):
            return self
        from genie_sim.perception.geodesy import enu_SE3_enu

        new_SE3_old = enu_SE3_enu(origin, self.origin)
        moved = []
        for row in self.rows:
            east_m, north_m, up_m = transform(new_SE3_old, row.location).tolist()
            moved.append(row._replace(east_m=east_m, north_m=north_m, up_m=up_m))
        return TruthTable(self.trace, origin, tuple(moved), self.provenance)


class RecordedTruth:
    """What is there on a recorded drive, for whoever judges."""

    reach_m, range_m = REACH_M, RANGE_M

    def __init__(self, table: TruthTable) -> None:
        self._visible: dict[tuple[str, int], list[TruthRow]] = {}
        self._hidden: dict[tuple[str, int], list[TruthRow]] = {}
        for row in table.rows:
            (self._visible if row.visible else self._hidden).setdefault(
                (row.camera, row.frame), []
            ).append(row)

    def knows(self, label: str) -> bool:
        return label in KNOWN

    def visible(self, frame: Frame) -> Sequence[TruthRow]:
        return self._visible.get(_key(frame), ())

    def is_there(self, frame: Frame, label: str, east_m: float, north_m: float) -> bool:
        rows = (*self._hidden.get(_key(frame), ()), *self._visible.get(_key(frame), ()))
        return any(
            row.label == label and math.hypot(row.east_m - east_m, row.north_m - north_m) <= REACH_M
            for row in rows
        )


def _key(frame: Any) -> tuple[str, int]:
    return frame.camera, frame.index


def make_truth(root: str | Path, drive: str, trace: Trace) -> TruthTable:
    """The truth table of a trace from the labels of its drive, ``2011_09_26/0005`` or ``tracking/0000``.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    from genie_sim.perception.truth import read_truth

    truth = read_truth(root, drive, trace)
    stamps_ns = {
        (camera, one.index): one.stamp_ns for camera in trace.frames for one in trace.frames[camera]
    }
    rows = []
    for (camera, index), labels in sorted(truth.pictures.items()):
        for label in sorted(labels):
            if label.centre is not None and label.group in LABELS:
                what = LABELS[label.group], label.track in truth.moving, label.counts
                place = (round(x, POSITION_DECIMALS) for x in label.centre)
                rows.append(
                    TruthRow(camera, index, stamps_ns[camera, index], label.track, *what, *place)
                )
    if not rows:
        raise UserError(f"{root}: no object of {drive} is in view of the trace {trace.name}")
    provenance = {
        "drive": drive,
        "labels": truth.source,
        "labels_sha256": _digest_of_labels(Path(root), drive),
    }
    return TruthTable(trace.digest, trace.origin, tuple(rows), {**provenance, "trace": trace.name})


def _digest_of_labels(root: Path, drive: str) -> str:
    date, number = drive.split("/")
    if date == "tracking":
        path = root / date / "training" / "label_02" / f"{number}.txt"
    else:
        path = root / date / f"{date}_drive_{number}_sync" / "tracklet_labels.xml"
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_truth(path: Path, table: TruthTable) -> None:
    """Writes a table; the same one gives the same bytes with the same pyarrow."""
    about = {
        "format_version": FORMAT_VERSION,
        "trace": table.trace,
        "origin": list(table.origin),
        "digest": table.digest,
        "provenance": table.provenance,
    }
    parquet.write(path, _schema(), (row._asdict() for row in table.rows), about)


def path_beside(path: Path) -> Path:
    """Where the truth table of a trace's file belongs."""
    return path.with_name(path.name.removesuffix(".parquet") + SUFFIX)


def truth_beside(path: Path, trace: Trace) -> TruthTable | None:
    """The truth table beside a trace's file, ``None`` where there is none.

    Raises UserError for one that cannot be read, was altered, or belongs to another trace.
    """
    beside = path_beside(path)
    if not beside.is_file():
        return None
    table = read_truth_table(beside)
    if table.trace != trace.digest:
        raise UserError(
            f"{beside}: belongs to the trace {table.trace[:12]}, {path.name} is {trace.digest[:12]}: make it again "
            "with 'genie-sim truth', or take it away"
        )
    return table


def read_truth_table(path: Path) -> TruthTable:
    """Reads a truth table and checks all of it. Raises UserError."""
    read, about = parquet.read(path, "truth table")
    if about.get("format_version") != FORMAT_VERSION:
        version = about.get("format_version")
        raise UserError(
            f"{path}: format_version: {version!r}, this genie-sim reads {FORMAT_VERSION}"
        )
    parquet.check_columns(path, read, _schema())
    with as_user_error(f"{path}: not a truth table", ValueError, KeyError, TypeError):
        rows = tuple(TruthRow(**row) for row in read.select(_schema().names).to_pylist())
        table = TruthTable(about["trace"], tuple(about["origin"]), rows, about["provenance"])
        digest = about["digest"]
    if table.digest != digest:
        raise UserError(
            f"{path}: content does not match its own digest {str(digest)[:12]}: file was altered"
        )
    return table


def _schema() -> "pyarrow.Schema":
    import pyarrow as pa

    kinds = {
        "camera": pa.string(),
        "label": pa.string(),
        "moving": pa.bool_(),
        "visible": pa.bool_(),
    }
    whole = dict.fromkeys(("frame", "stamp_ns", "object"), pa.int64())
    return pa.schema([(name, (kinds | whole).get(name, pa.float64())) for name in TruthRow._fields])
