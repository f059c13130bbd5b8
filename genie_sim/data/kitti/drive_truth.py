"""KITTI's labels in the pictures of a trace, and the truth table that they make.

KITTI labels what its annotators saw in the laser scans; objects far away or never labelled are
missing, so an object without a label nearby is not always a ghost.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from genie_sim.base.classes import GROUPS, MOVING_MPS
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import sha256_of
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Location
from genie_sim.data.intake import check_distances, truth_row
from genie_sim.data.kitti.drive_name import TRACKING, DriveName
from genie_sim.data.kitti.label import ObjectLabel, PictureKey
from genie_sim.data.kitti.layouts import raw_drives
from genie_sim.data.kitti.tracking_labels import labels_of_sequence
from genie_sim.data.kitti.tracking_sequence import CAMERA
from genie_sim.data.kitti.tracklets import labels_of_drive
from genie_sim.data.trace import Trace
from genie_sim.data.truth import TruthObject, TruthTable

TRACKLETS = "tracklet_labels.xml"


@dataclass(frozen=True, slots=True)
class PictureLabels:
    """The labels of all pictures of a trace, by picture, out of the file of a drive, and the tracks
    that move, by number.
    """

    drive: DriveName
    path: Path
    pictures: Mapping[PictureKey, list[ObjectLabel]]
    moving: frozenset[int]

    @property
    def source(self) -> str:
        """Which labels they are."""
        return f"{'tracklets' if self.drive.is_raw else 'label_02'} of {self.drive}"


def read_labels(root: str | Path, drive: str, trace: Trace) -> PictureLabels:
    """The labels of ``2011_09_26/0005`` (tracklets) or ``tracking/0000`` for the pictures of a
    trace of that drive.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    name = DriveName.parse(drive)
    in_sequence = name.part == TRACKING
    pictures: dict[PictureKey, list[ObjectLabel]] = {
        picture: [] for picture in trace.by_picture if picture[0] == CAMERA or not in_sequence
    }
    labels_of = labels_of_sequence if in_sequence else labels_of_drive
    path = label_file(Path(root), name)
    for picture, label in labels_of(Path(root), name, path, trace):
        pictures[picture].append(label)
    return PictureLabels(name, path, pictures, _moving(pictures, trace))


def label_file(root: Path, drive: DriveName) -> Path:
    """The file with the labels of a drive: tracklets of ``2011_09_26/0005``, ``label_02`` of
    ``tracking/0000``.

    Raises UserError, naming the labelled drives of both kinds, where there is none.
    """
    label_02 = root / TRACKING / "training" / "label_02"
    path = root / drive.folder / TRACKLETS
    if drive.part == TRACKING:
        path = label_02 / f"{drive.number}.txt"
    if not path.is_file():
        raw = (name for name in raw_drives(root) if (root / name.folder / TRACKLETS).is_file())
        choices = [*map(str, raw), *(f"{TRACKING}/{file.stem}" for file in label_02.glob("*.txt"))]
        raise UserError(
            f"{root}: {unknown('labelled drive', str(drive), choices)} (tracklets of a raw drive "
            "DATE/NUMBER, or label_02 of a sequence tracking/NUMBER)"
        )
    return path


def _moving(pictures: Mapping[PictureKey, list[ObjectLabel]], trace: Trace) -> frozenset[int]:
    """The tracks that got away from where they were first labelled faster than ``MOVING_MPS``, over
    all their time.
    """
    frames = trace.by_picture
    tracks: dict[int, dict[int, Location]] = {}
    for picture, labels in pictures.items():
        for label in labels:
            if label.centre is not None:
                tracks.setdefault(label.track, {})[frames[picture].stamp_ns] = label.centre
    return frozenset(track for track, places in tracks.items() if _speed_mps(places) > MOVING_MPS)


def _speed_mps(places: Mapping[int, Location]) -> float:
    """How far it got from its first place over the time between its first and its last."""
    first_ns, last_ns = min(places), max(places)
    away_m = max(math.dist(place[:2], places[first_ns][:2]) for place in places.values())
    return away_m / ((last_ns - first_ns) / NS_PER_S) if last_ns > first_ns else 0.0


def make_truth(
    root: str | Path, drive: str, trace: Trace, report: ImportReport | None = None
) -> TruthTable:
    """The truth table of a trace from the labels of its drive, ``2011_09_26/0005`` or
    ``tracking/0000``; ``report`` is told what was read.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    truth = read_labels(root, drive, trace)
    report = report or ImportReport(root)
    frames = trace.by_picture
    rows, distances_m = [], []
    for picture, labels in sorted(truth.pictures.items()):
        frame = frames[picture]
        report.read("pictures", 1)
        for label in sorted(labels):
            if label.centre is None:
                report.leave_out("labels of areas and of no class")
                continue
            distances_m.append(math.dist(label.centre[:2], frame.pose[:2]))
            there = TruthObject(
                label.track,
                GROUPS[label.group][0],
                label.track in truth.moving,
                label.counts,
                *label.centre,
            )
            rows.append(truth_row(frame, there))
    labelled = sorted({camera for camera, _ in truth.pictures})
    for camera in sorted(trace.frames.keys() - {*labelled}):
        report.leave_out(f"pictures of {camera}, without labels", len(trace.frames[camera]))
    report.read("labels", len(rows))
    check_distances(report, distances_m, truth.path)
    if not rows:
        raise UserError(f"{root}: no object of {truth.drive} is in view of the trace {trace.name}")
    provenance = {
        "drive": str(truth.drive),
        "labels": truth.source,
        "labels_sha256": sha256_of(truth.path),
        "trace": trace.name,
    }
    return TruthTable(
        trace.digest,
        trace.origin,
        tuple(rows),
        provenance,
        cameras=tuple(labelled) if len(labelled) < len(trace.frames) else None,
    )
