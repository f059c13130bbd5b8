"""Tables of what was really there, and what a recorded drive is judged by.

A truth table is one Parquet file beside the trace, ``NAME.truth.parquet`` beside ``NAME.parquet``:
one row per frame and object, with the digest of the trace and where it comes from in the schema's
metadata.
"""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from genie_sim.base.classes import CANONICAL, class_of
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.geometry import Array, Geodetic, transform
from genie_sim.base.matching import SAME_M
from genie_sim.base.paths import remembered
from genie_sim.base.spans import rows_of_spans
from genie_sim.core.messages import Frame, Location
from genie_sim.data import world_table
from genie_sim.data.trace import POSITION_DECIMALS, RANGE_M, Trace, rounded

if TYPE_CHECKING:
    import pyarrow

SUFFIX = ".truth.parquet"
METADATA = (
    "trace",
    "tolerance_m",  # written for readers of the file
    "range_m",
    "cameras",
)  # of a table's file, besides what all tell
MAX_RANGE_M = 1000.0  # no sensor of a car sees farther


class TruthObject(NamedTuple):
    """One object in view of a frame, by its number. ``visible``: whoever is in that frame's place
    is expected to know of it. With KITTI it counts in the benchmark (at least 25 pixels high,
    mostly in the picture, and how hidden it is was judged).
    """

    object: int
    label: str
    moving: bool
    visible: bool
    east_m: float
    north_m: float
    up_m: float


class TruthRow(NamedTuple):
    """A ``TruthObject`` with the frame that it is in view of."""

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


@dataclass(frozen=True)
class TruthTable:
    """The rows of one trace, placed around one geodetic origin. ``trace`` is the digest of the
    trace they belong to, as its file has it; ``digest`` is the sha256 of trace, origin and rows,
    and of the range where it is not the usual one, and the cameras where they are not all.
    ``cameras`` are those whose frames have labels; ``None``: all of the trace.

    An object that is held is right within ``SAME_M`` of one in the rows; objects up to
    ``range_m`` away from the sensor count, as far as the labels reach.
    """

    trace: str
    origin: Geodetic
    rows: tuple[TruthRow, ...]
    provenance: Mapping[str, Any]
    range_m: float = RANGE_M
    cameras: tuple[str, ...] | None = None
    tolerance_m: ClassVar[float] = SAME_M

    @functools.cached_property
    def digest(self) -> str:
        """The sha256 of what the table says, computed when it is asked for."""
        content = [self.trace, [float(x) for x in self.origin], self.rows]
        if self.range_m != RANGE_M:
            content.append([SAME_M, self.range_m])
        if self.cameras is not None:
            content.append(["cameras", *self.cameras])
        return world_table.content_digest(content)

    def rebased(self, origin: Geodetic) -> "TruthTable":
        """The same around another origin, as ``Trace.rebased``."""
        if origin == self.origin:
            return self
        from genie_sim.data.geodesy import enu_SE3_enu

        new_SE3_old = enu_SE3_enu(origin, self.origin)
        rows = []
        for row in self.rows:
            east_m, north_m, up_m = rounded(transform(new_SE3_old, row.location), POSITION_DECIMALS)
            rows.append(row._replace(east_m=east_m, north_m=north_m, up_m=up_m))
        return replace(self, origin=origin, rows=tuple(rows))


class RecordedTruth:
    """What is there on a recorded drive, for whoever judges."""

    tolerance_m = SAME_M

    def __init__(self, table: TruthTable) -> None:
        self.range_m, self.cameras = table.range_m, table.cameras
        self._visible: dict[tuple[str, int], list[TruthRow]] = {}
        places: dict[tuple[str, int, str], list[tuple[float, float]]] = {}
        for row in table.rows:
            if row.visible:
                self._visible.setdefault((row.camera, row.frame), []).append(row)
            of_class = places.setdefault((row.camera, row.frame, row.label), [])
            of_class.append((row.east_m, row.north_m))
        # of all, visible or not: east and north [m]; by camera, frame and class the first row and
        # how many there are
        self._places_m = np.array([place for of in places.values() for place in of]).reshape(-1, 2)
        counts = [len(of_class) for of_class in places.values()]
        begins = itertools.accumulate(counts, initial=0)
        self._spans: dict[tuple[str, int], dict[str, tuple[int, int]]] = {}
        for (camera, frame, label), begin, count in zip(places, begins, counts, strict=False):
            self._spans.setdefault((camera, frame), {})[label] = begin, count

    def knows(self, label: str) -> bool:
        return label in CANONICAL

    def visible(self, frame: Frame) -> Sequence[TruthRow]:
        return self._visible.get(_key(frame), ())

    def are_there(
        self, frames: Sequence[Frame], labels: Sequence[str], east_m: Array, north_m: Array
    ) -> Array:
        """Whether an object of a class is within ``tolerance_m`` of a place, visible or not, in its
        frame, for each of (n,) places.
        """
        spans: list[int] = []
        last: Frame | None = None
        of_frame: Mapping[str, tuple[int, int]] = {}
        for frame, label in zip(frames, labels, strict=True):
            if frame is not last:  # many are about one frame
                last, of_frame = frame, self._spans.get(_key(frame), {})
            spans += of_frame.get(class_of(label), (0, 0))
        begins, counts = np.array(spans, dtype=np.int64).reshape(-1, 2).T
        row, index = rows_of_spans(begins, counts)
        there_m = self._places_m[row]
        away_m = np.hypot(there_m[:, 0] - east_m[index], there_m[:, 1] - north_m[index])
        result = np.zeros(len(counts), dtype=bool)
        result[index[away_m <= self.tolerance_m]] = True
        return result


def _key(frame: Any) -> tuple[str, int]:
    return frame.camera, frame.index


def check_truth_replaceable(path: Path) -> None:
    """Raises ``UserError`` where a table may not be written: what is there is none."""
    world_table.check_replaceable(path, METADATA)


def check(path: object, table: TruthTable) -> None:
    """Raises UserError, naming ``path``, for a table that no run can use: readers and writers ask
    the same.
    """
    if not isinstance(table.provenance.get("trace"), str):
        raise UserError(f"{path}: metadata: provenance: 'trace' is missing or not a str")
    check_rows(path, table.rows)
    check_range(f"{path}: metadata", table.range_m)
    if table.cameras is not None and not {row.camera for row in table.rows} <= {*table.cameras}:
        raise UserError(f"{path}: metadata: cameras {table.cameras!r} are not those of its rows")


def check_rows(path: object, rows: Sequence[TruthRow]) -> None:
    """Raises UserError, naming ``path``, for objects of no class or at no place."""
    for row in rows:
        where = f"{path}: camera {row.camera!r}, frame {row.frame}: object {row.object}"
        if row.label not in CANONICAL:
            raise UserError(f"{where}: label: {unknown('class', row.label, CANONICAL)}")
        if not world_table.in_range(row.location):
            raise UserError(f"{where} at {row.location} is at no place on Earth [m]")


def check_range(where: object, range_m: Any) -> None:
    """Raises UserError, beginning with ``where``, for a range [m] that no sensor has."""
    if not (world_table.in_range([range_m], MAX_RANGE_M) and range_m > 0):
        raise UserError(f"{where}: range_m {range_m!r} is no length up to {MAX_RANGE_M:g} [m]")


def write_truth(path: Path, table: TruthTable) -> None:
    """Writes a table; the same one gives the same bytes with the same pyarrow. Raises UserError for
    one that ``read_truth_table`` would refuse.
    """
    check(path, table)
    rows = (row._asdict() for row in table.rows)
    world_table.write(path, _schema(), rows, table, METADATA)


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
            f"{beside}: belongs to the trace {table.trace[:12]!r}, {path.name} is "
            f"{trace.digest[:12]}: make it again with 'genie-sim import truth', or take it away"
        )
    return table


@remembered
def read_truth_table(path: Path) -> TruthTable:
    """Reads a truth table and checks all of it. Raises UserError."""
    columns, about = world_table.read(path, "truth table", _schema(), "trace")
    rows = tuple(TruthRow(**row) for row in columns.to_pylist())
    cameras = about.get("cameras")
    if cameras is not None:
        if not (isinstance(cameras, list) and all(isinstance(name, str) for name in cameras)):
            raise UserError(f"{path}: metadata: cameras {cameras!r} are no names")
        cameras = tuple(cameras)
    range_m, provenance = about.get("range_m", RANGE_M), about["provenance"]
    table = TruthTable(about["trace"], about["origin"], rows, provenance, range_m, cameras)
    check(path, table)
    world_table.check_digest(path, table.digest, about)
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
