"""Small made-up drives in KITTI's raw layout, a stand-in network, and a reader of KITTI's
tracklets, for the tests.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymap3d

DATE = "2011_09_26"
WIDTH, HEIGHT = 640, 192
FOCAL, CENTRE_X, CENTRE_Y = 720.0, 320.0, 96.0
START = (49.0112, 8.4228, 112.8)  # latitude, longitude, altitude
FIRST_STAMP_S = 32.345808896

# The laser has x ahead, y left, z up; the camera x right, y down, z ahead, at the same place.
VELO_TO_CAM = "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n"
IMU_TO_VELO = "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n"


def make_drive(
    root: Path,
    number: str = "0005",
    frames: int = 3,
    start: tuple[float, float, float] = START,
    yaw_rad: float = 0.0,
    roll_pitch_rad: tuple[float, float] = (0.0, 0.0),
    image: np.ndarray | None = None,
    extension: str = "png",
    scan: np.ndarray | None = None,
    date: str = DATE,
) -> Path:
    """A drive of cameras 02 and 03, one metre ahead a frame at 10 Hz; returns its folder."""
    import cv2

    folder = root / date / f"{date}_drive_{number}_sync"
    for part in ("image_02", "image_03", "oxts", "velodyne_points"):
        (folder / part / "data").mkdir(parents=True)
    projection = f"{FOCAL} 0 {CENTRE_X} 0 0 {FOCAL} {CENTRE_Y} 0 0 0 1 0"
    lines = [f"P_rect_{camera}: {projection}" for camera in ("00", "01", "02", "03")]
    lines += [f"R_rect_{camera}: 1 0 0 0 1 0 0 0 1" for camera in ("00", "01", "02", "03")]
    (root / date / "calib_cam_to_cam.txt").write_text(
        "calib_time: 09-Jan-2012 13:57:47\n" + "\n".join(lines) + "\n"
    )
    (root / date / "calib_velo_to_cam.txt").write_text(VELO_TO_CAM)
    (root / date / "calib_imu_to_velo.txt").write_text(IMU_TO_VELO)

    image = np.full((HEIGHT, WIDTH, 3), 60, np.uint8) if image is None else image
    scan = np.zeros((10, 3)) if scan is None else scan
    points = np.column_stack([scan, np.zeros(len(scan))]).astype(np.float32)
    stamps = [f"2011-09-26 13:04:{FIRST_STAMP_S + 0.1 * i:.9f}" for i in range(frames)]
    for part in ("image_02", "image_03", "oxts", "velodyne_points"):
        (folder / part / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    for index in range(frames):
        east, north = index * math.cos(yaw_rad), index * math.sin(yaw_rad)
        place = pymap3d.enu2geodetic(east, north, 0.0, *start)
        values = [*place, *roll_pitch_rad, yaw_rad, *[0.0] * 19, 4, 10, 4, 4, 0]
        (folder / "oxts" / "data" / f"{index:010d}.txt").write_text(
            " ".join(f"{float(v):.12f}" for v in values) + "\n"
        )
        (folder / "velodyne_points" / "data" / f"{index:010d}.bin").write_bytes(points.tobytes())
        for camera in ("02", "03"):
            cv2.imwrite(
                str(folder / f"image_{camera}" / "data" / f"{index:010d}.{extension}"), image
            )
    return folder


def make_street(root: Path, frames: int = 3, date: str = DATE) -> Path:
    """A drive whose pictures show one white cell in the middle, where the stand-in network sees a
    car, and whose scans have a surface 15 m ahead; returns its folder.
    """
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[96:104, 320:328] = 255
    across, up = np.meshgrid(np.arange(-0.8, 0.8, 0.1), np.arange(-1.0, 0.5, 0.1))
    surface = np.column_stack([np.full(across.size, 15.0), across.ravel(), up.ravel()])
    return make_drive(root, frames=frames, image=image, scan=surface, date=date)


def make_network(path: Path, side: int = 416, classes: int = 80) -> Path:
    """A network with YOLOX's inputs and outputs that calls each white 8x8 cell a car of 80x40
    pixels.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    channels = 5 + classes
    nodes, constants = [], [numpy_helper.from_array(np.array([1, channels, -1]), "shape")]
    for stride in (8, 16, 32):
        weight = np.zeros((channels, 3, stride, stride), np.float32)
        bias = np.zeros(channels, np.float32)
        if stride == 8:
            weight[4] = 1 / (255 * 3 * stride * stride)
            bias[[0, 1]], bias[2], bias[3], bias[5 + 2] = (
                0.5,
                math.log(80 / stride),
                math.log(40 / stride),
                1.0,
            )
        constants += [
            numpy_helper.from_array(weight, f"w{stride}"),
            numpy_helper.from_array(bias, f"b{stride}"),
        ]
        convolution = [f"w{stride}", f"b{stride}"]
        nodes.append(
            helper.make_node(
                "Conv", ["images", *convolution], [f"c{stride}"], strides=[stride, stride]
            )
        )
        nodes.append(helper.make_node("Reshape", [f"c{stride}", "shape"], [f"r{stride}"]))
    nodes.append(helper.make_node("Concat", ["r8", "r16", "r32"], ["all"], axis=2))
    nodes.append(helper.make_node("Transpose", ["all"], ["output"], perm=[0, 2, 1]))
    cells = sum((side // stride) ** 2 for stride in (8, 16, 32))
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, side, side])
    output = helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, cells, channels])
    graph = helper.make_graph(nodes, "stand-in", [picture], [output], constants)
    onnx.save(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 11)], ir_version=7),
        str(path),
    )
    return path


@dataclass(frozen=True)
class Tracklet:
    """One labelled object: its centre (x, y, z) in the laser's frame and its turn about z, by frame
    number.
    """

    kind: str
    height_m: float
    width_m: float
    length_m: float
    centres: dict[int, np.ndarray]
    turns_rad: dict[int, float]

    def corners(self, index: int) -> np.ndarray:
        cos, sin = math.cos(self.turns_rad[index]), math.sin(self.turns_rad[index])
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
        sides = signs * [self.length_m, self.width_m, self.height_m]
        return sides @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]).T + self.centres[index]


def read_tracklets(path: Path) -> list[Tracklet]:
    """KITTI's ``tracklet_labels.xml``; poses there are those of the box's bottom."""
    tracklets = []
    for item in ElementTree.parse(path).getroot().findall("tracklets/item"):
        height, width, length = (float(item.findtext(name)) for name in "hwl")
        first = int(item.findtext("first_frame"))
        poses = dict(enumerate(item.findall("poses/item"), start=first))
        centres = {
            index: np.array([float(pose.findtext(name)) for name in ("tx", "ty", "tz")])
            + np.array([0, 0, height / 2])
            for index, pose in poses.items()
        }
        turns = {index: float(pose.findtext("rz")) for index, pose in poses.items()}
        tracklets.append(
            Tracklet(item.findtext("objectType"), height, width, length, centres, turns)
        )
    return tracklets
