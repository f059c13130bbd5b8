"""The labels of KITTI's tracking benchmark (``label_02``), in the pictures of a trace."""

from collections.abc import Iterator
from pathlib import Path

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.geometry import transform
from genie_sim.data.kitti.drive_name import TRACKING, DriveName
from genie_sim.data.kitti.label import ObjectLabel, PictureKey, check_drive, object_label
from genie_sim.data.kitti.number_files import are_plausible, numbered_lines
from genie_sim.data.kitti.tracking_sequence import CAMERA, TrackingSequence, open_sequence
from genie_sim.data.trace import Trace


def labels_of_sequence(
    root: Path, name: DriveName, path: Path, trace: Trace
) -> Iterator[tuple[PictureKey, ObjectLabel]]:
    """The labels in a file for the pictures of a trace of the same drive. Raises UserError where it
    is another.
    """
    training = root / TRACKING / "training"
    drive = open_sequence(training, name.number, trace.origin)
    frames = trace.frames.get(CAMERA)
    if frames is None:
        cameras = ", ".join(trace.frames)
        raise UserError(f"{training}: labels are those of camera {CAMERA}, the trace has {cameras}")
    poses = {index: drive.world_SE3_camera2(index) for index in range(len(drive.world_SE3_camera0))}
    check_drive(f"{training}: sequence {name.number}", frames, poses)
    indices = {frame.index for frame in frames}
    for index, label in tracking_labels(path, drive):
        if index in indices:
            yield (CAMERA, index), label


def tracking_labels(path: Path, drive: TrackingSequence) -> list[tuple[int, ObjectLabel]]:
    """The frame and the label of every line of the ``label_02`` file of a sequence. Raises
    UserError.
    """
    labels = []
    for number, fields in numbered_lines(path):
        where = f"{path}: line {number}"
        with as_user_error(f"{where}: not a tracking label", IndexError, ValueError, OverflowError):
            frame, track = int(fields[0]), int(fields[1])
            truncation, occlusion = int(float(fields[3])), int(fields[4])
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, fields[6:16])
        if not are_plausible([x1, y1, x2, y2, height_m, x, y, z]):
            raise UserError(f"{where}: not a tracking label: a number is not finite, or too large")
        if not 0 <= frame < len(drive.world_SE3_camera0):
            raise UserError(f"{where}: frame {frame} has no line in oxts")
        label = object_label(
            track,
            fields[2],
            (x1, y1, x2, y2),
            truncation=truncation,
            occlusion=occlusion,
            centre=transform(drive.world_SE3_camera0[frame], (x, y - height_m / 2, z)),
        )
        labels.append((frame, label))
    return labels
