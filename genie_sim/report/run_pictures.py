"""The recorded pictures that the cameras of a run show, for the replay on its page."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base import files, units
from genie_sim.base.errors import UserError
from genie_sim.base.paths import sha256_of
from genie_sim.report.replay_pictures import MAX_PICTURES, Pictures

if TYPE_CHECKING:
    from genie_sim.data.trace import Trace, TraceFrame
    from genie_sim.record.columns import Columns
    from genie_sim.record.results import Run

COPY_WIDTH_PX = 480
COPY_QUALITY = 60  # of JPEG


def kitti_pictures(run: "Run", root: Path, *, copied: bool) -> Pictures:
    """The pictures of the first camera of each car, in KITTI's folder ``root``: the files
    themselves, or small copies of them that go into the page.

    Raises ``UserError`` for a run of anything but recorded drives of KITTI, and where pictures are
    missing or not those of the recording.
    """
    from genie_sim.data.kitti import ATTRIBUTION

    scenario = run.facts["scenario"]
    if scenario.get("fleet") is not None or scenario["perception"].get("trace") is None:
        raise UserError("--pictures: only the cameras of recorded drives have pictures")
    drives: dict[str, _Drive] = {}
    paths: dict[tuple[str, str, int], Path] = {}
    for car in scenario["cars"]:
        if not car["cameras"]:
            continue
        cameras = scenario["cameras"] if car["cameras"] is True else car["cameras"]
        name = car["route"]["trace"] or scenario["perception"]["trace"]
        if name not in drives:
            drives[name] = _Drive(root, name)
        camera = cameras[0]
        poses = run.tables["poses"].where(car=car["name"], stream=camera["name"])
        frames = drives[name].window(camera["recording"], car["route"]["window"])
        for number, frame in _taken(poses, frames, car["name"], name):
            paths[car["name"], camera["name"], number] = drives[name].path(frame)
    address = _copy if copied else Path.as_uri
    how = f"at most {MAX_PICTURES} small copies" if copied else "read from their own files"
    return Pictures(paths, address, f"Pictures ({how}): {ATTRIBUTION}", copied)


class _Drive:
    """A recorded drive: its trace, and its pictures on disk. Each picture is compared with the
    digest in the trace before it is shown.
    """

    def __init__(self, root: Path, name: str) -> None:
        from genie_sim.data.perceive import images
        from genie_sim.data.trace import read_trace

        self._trace: Trace = read_trace(files.find(files.TRACE, name))
        drive = self._trace.provenance.get("drive")
        if not isinstance(drive, str):
            raise UserError(f"--pictures: {name}: the trace does not name a drive of KITTI")
        self._paths = images(root, drive, sorted(self._trace.frames))
        self._checked: set[Path] = set()

    def window(self, recording: str, window: Sequence[str] | None) -> "Sequence[TraceFrame]":
        """The frames of one recorded camera in a part of the drive; ``None``: in all of it."""
        frames = self._trace.frames[recording]
        if window is None:
            return frames
        begin_ns, end_ns = map(units.duration_ns, window)
        return [frame for frame in frames if begin_ns <= frame.stamp_ns < end_ns]

    def path(self, frame: "TraceFrame") -> Path:
        """The file of a frame's picture. Raises ``UserError`` where it is another one."""
        path = self._paths.get((frame.camera, frame.index))
        if path is None:
            raise UserError(f"--pictures: no picture of camera {frame.camera}, frame {frame.index}")
        if path not in self._checked:
            if sha256_of(path) != frame.digest:
                raise UserError(f"{path}: is not the picture that the trace was made of")
            self._checked.add(path)
        return path.absolute()


def _taken(
    poses: "Columns", frames: "Sequence[TraceFrame]", car: str, trace: str
) -> "Iterator[tuple[int, TraceFrame]]":
    """The recorded frame that each frame of a run shows, by its number. Raises ``UserError`` where
    the recording has other times than the run.
    """
    rows: Mapping[str, Any] = {name: poses[name].tolist() for name in ("frame", "stamp_ns")}
    offset_ns = 0
    for number, stamp_ns in zip(rows["frame"], rows["stamp_ns"], strict=True):
        lap_frame = number % len(frames) if frames else 0
        if lap_frame == 0 and frames:
            offset_ns = stamp_ns - frames[0].stamp_ns
        if not frames or stamp_ns - frames[lap_frame].stamp_ns != offset_ns:
            raise UserError(f"--pictures: {trace} is not the trace that {car} replayed in this run")
        yield number, frames[lap_frame]


def _copy(path: Path) -> str:
    """A small copy of a picture as an address that holds it."""
    import cv2

    from genie_sim.data.kitti import read_image

    picture = read_image(path)
    height, width = picture.shape[:2]
    size = COPY_WIDTH_PX, round(COPY_WIDTH_PX * height / width)
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, COPY_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg.tobytes()).decode()}"
