"""The frames of a drive through a detector, on several threads."""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import chain, groupby
from operator import attrgetter

import cv2

from genie_sim.base.geometry import Array
from genie_sim.base.parallel import workers_here
from genie_sim.core.messages import Encoding
from genie_sim.data.detectors.image_detector import ImageDetector, ThreadedDetector, look
from genie_sim.data.detectors.placement import Placement, Plane, fit_ground
from genie_sim.data.encoding import picture_of
from genie_sim.data.kitti.drive import CameraFrame, KittiDrive, read_image
from genie_sim.data.reader_frames import picture_frame, placed
from genie_sim.data.trace import TraceFrame

LASER_HEIGHT_M = 1.73  # https://www.cvlibs.net/datasets/kitti/setup.php
FLAT_GROUND = Plane((0.0, 0.0), -LASER_HEIGHT_M)
# Without a scan. The laser is tilted: the labelled vehicles of 14 tracking sequences stand on
# ground that rises by 0.009 m per metre ahead of it (median over sequences; of every other one
# 0.009, of the rest 0.0086).
TYPICAL_GROUND = Plane((0.009, 0.0), -LASER_HEIGHT_M)
MAX_WORKERS = 4  # each holds a picture, a scan and what the network makes of it


def trace_frames(
    drive: KittiDrive,
    frames: Iterable[CameraFrame],
    detector: ImageDetector,
    encoding: Encoding = "raw",
) -> Iterator[TraceFrame]:
    """The frames for a trace, in order, with KITTI's stamps.

    Networks look at several pictures at once, on up to ``MAX_WORKERS`` processors; a detector of
    the user's own looks at one after the other.

    Parameters
    ----------
    drive : of the frames
    frames : what to look at, ordered by number: cameras share a scan
    detector : what looks
    encoding : of the pictures before the detector sees them
    """

    def perceived(of_number: Sequence[CameraFrame]) -> list[TraceFrame]:
        scan = drive.scan(of_number[0].index)
        ground = TYPICAL_GROUND
        if scan is not None:
            ground = fit_ground(scan, LASER_HEIGHT_M) or FLAT_GROUND
        return [perceived_in(frame, scan, ground) for frame in of_number]

    def perceived_in(frame: CameraFrame, scan: Array | None, ground: Plane) -> TraceFrame:
        image, data = read_image(frame.image_path)
        picture, image = picture_of(image, data, encoding)
        frame.check_size(picture.size)
        camera_SE3_velo = drive.camera_SE3_velo(frame.camera)
        placement = Placement(frame.intrinsics, picture.size, camera_SE3_velo, scan, ground=ground)
        boxes, features = look(image, detector)
        return picture_frame(
            camera=frame.camera,
            index=frame.index,
            stamp_ns=frame.stamp_ns,
            picture=picture,
            world_SE3_camera=frame.world_SE3_camera,
            intrinsics=frame.intrinsics,
            detections=[placed(box, placement, frame.world_SE3_camera) for box in boxes],
            features=features,
        )

    numbers = (tuple(of_number) for _, of_number in groupby(frames, attrgetter("index")))
    with _one_thread_of_opencv(), ThreadPoolExecutor(_workers(detector)) as threads:
        yield from chain.from_iterable(threads.map(perceived, numbers))


def _workers(detector: ImageDetector) -> int:
    """How many pictures a detector looks at at once."""
    if not isinstance(detector, ThreadedDetector):
        return 1
    return max(1, min(workers_here() // detector.threads, MAX_WORKERS))


@contextmanager
def _one_thread_of_opencv() -> Iterator[None]:
    """OpenCV would put its own threads on the processors of the network."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
