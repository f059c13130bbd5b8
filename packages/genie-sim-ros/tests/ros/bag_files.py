"""Bags of every kind, as somebody else records them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg

from genie_sim.base.geometry import rigid, rotation_from_rpy
from genie_sim_ros.bags import IMAGES, POINTS
from genie_sim_ros.typestore import TF, message, time, typestore
from tests.ros.conftest import HERE

CAMERA, IMAGE, SCAN = (
    "camera_color_left",
    "/kitti/camera_color_left/image_raw",
    "/kitti/velo/pointcloud",
)


OBJECTS, ARRAY = "/detection/image_detector/objects", "autoware_msgs/msg/DetectedObjectArray"


ORIGIN = (49.011, 8.423, 116.0)


START_NS, STEP_NS = 1_317_000_000 * 10**9, 100_000_000


# The camera looks where the car drives: its z is the car's x, its x the car's -y.
IMU_SE3_CAMERA = rigid([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (1.0, 0.06, 0.8))


@dataclass
class BagWriter:
    """Writes a ROS 1 bag, an MCAP file or a ROS 2 bag's folder (sqlite3) with the same content."""

    path: Path
    ros: int = field(init=False)
    messages: list[tuple[int, str, str, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.ros = 1 if self.path.suffix == ".bag" else 2
        self.store = typestore(self.ros)

    def add(self, at_ns: int, topic: str, kind: str, **fields: Any) -> None:
        self.messages.append((at_ns, topic, kind, message(self.store, kind, **fields)))

    def header(self, stamp_ns: int, frame: str) -> Any:
        return message(self.store, "std_msgs/msg/Header", stamp=time(stamp_ns), frame_id=frame)

    def write(self) -> Path:
        serialize = self.store.serialize_ros1 if self.ros == 1 else self.store.serialize_cdr
        ordered = sorted(self.messages, key=lambda one: one[0])
        if self.path.suffix == ".mcap":
            from genie_sim_ros.export import START_S, BagMessage, write

            began_ns = START_S * 10**9
            entries = [
                BagMessage(at_ns - began_ns, topic, kind, vars(one))
                for at_ns, topic, kind, one in ordered
            ]
            write(self.path, 2, entries)
            return self.path
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import Writer as Writer2

        with Writer1(self.path) if self.ros == 1 else Writer2(self.path, version=9) as writer:
            connections: dict[str, Any] = {}
            for at_ns, topic, kind, one in ordered:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                writer.write(connections[topic], at_ns, serialize(one, kind))
        return self.path

    def transform(
        self, at_ns: int, parent: str, child: str, parent_SE3_child: Any, static: bool = True
    ) -> None:
        from scipy.spatial.transform import Rotation

        def numbers(kind: str, names: str, values: Any) -> Any:
            return message(self.store, kind, **dict(zip(names, map(float, values), strict=True)))

        motion = message(
            self.store,
            "geometry_msgs/msg/Transform",
            translation=numbers("geometry_msgs/msg/Vector3", "xyz", parent_SE3_child[:3, 3]),
            rotation=numbers(
                "geometry_msgs/msg/Quaternion",
                "xyzw",
                Rotation.from_matrix(parent_SE3_child[:3, :3]).as_quat(),
            ),
        )
        one = message(
            self.store,
            "geometry_msgs/msg/TransformStamped",
            header=self.header(at_ns, parent),
            child_frame_id=child,
            transform=motion,
        )
        self.add(at_ns, "/tf_static" if static else "/tf", TF, transforms=[one])

    def camera_info(self, at_ns: int, intrinsics: Any, size: tuple[int, int]) -> None:
        k, p = ("K", "P") if self.ros == 1 else ("k", "p")
        projection = np.column_stack([intrinsics, np.zeros(3)])
        fields = {
            k: np.asarray(intrinsics, float).ravel(),
            p: projection.ravel(),
            "width": size[0],
            "height": size[1],
        }
        topic = f"/kitti/{CAMERA}/camera_info"
        self.add(
            at_ns, topic, "sensor_msgs/msg/CameraInfo", header=self.header(at_ns, CAMERA), **fields
        )

    def image(self, stamp_ns: int, picture: np.ndarray, encoding: str = "bgr8") -> None:
        height, width = picture.shape[:2]
        self.add(
            stamp_ns,
            IMAGE,
            IMAGES[0],
            header=self.header(stamp_ns, CAMERA),
            height=height,
            width=width,
            encoding=encoding,
            step=picture[0].size,
            data=picture.ravel(),
        )

    def scan(self, stamp_ns: int, points: np.ndarray, late_ns: int = 0) -> None:
        """``late_ns``: recorded so much after the image of this stamp."""
        fields = [
            message(
                self.store,
                "sensor_msgs/msg/PointField",
                name=name,
                offset=4 * at,
                datatype=7,
                count=1,
            )
            for at, name in enumerate("xyz")
        ]
        self.add(
            stamp_ns + late_ns,
            SCAN,
            POINTS,
            header=self.header(stamp_ns, "velo_link"),
            height=1,
            width=len(points),
            fields=fields,
            point_step=12,
            row_step=12 * len(points),
            is_dense=True,
            data=np.frombuffer(points.astype("<f4").tobytes(), np.uint8),
        )

    def position(
        self, stamp_ns: int, fix: tuple[float, float, float], rpy: tuple[float, float, float]
    ) -> None:
        from scipy.spatial.transform import Rotation

        quaternion = Rotation.from_matrix(rotation_from_rpy(*rpy)).as_quat()
        turn = message(
            self.store,
            "geometry_msgs/msg/Quaternion",
            **dict(zip("xyzw", map(float, quaternion), strict=True)),
        )
        latitude, longitude, altitude = fix
        at = self.header(stamp_ns, "imu_link")
        self.add(
            stamp_ns,
            "/kitti/oxts/gps/fix",
            "sensor_msgs/msg/NavSatFix",
            header=at,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
        )
        self.add(stamp_ns, "/kitti/oxts/imu", "sensor_msgs/msg/Imu", header=at, orientation=turn)

    def objects(self, stamp_ns: int, *found: dict[str, Any]) -> None:
        definition = (HERE / "objects.txt").read_text()
        if ARRAY not in self.store.fielddefs:
            types = get_types_from_msg(definition, ARRAY)
            known = {
                name: fields for name, fields in types.items() if name not in self.store.fielddefs
            }
            self.store.register(known)
        at = self.header(stamp_ns, CAMERA)
        objects = []
        for one in found:
            east, north = one.pop("at", (0.0, 0.0))
            place = message(self.store, "geometry_msgs/msg/Point", x=east, y=north)
            pose = message(self.store, "geometry_msgs/msg/Pose", position=place)
            objects.append(
                message(self.store, "autoware_msgs/msg/DetectedObject", header=at, pose=pose, **one)
            )
        self.add(stamp_ns + 50_000_000, OBJECTS, ARRAY, header=at, objects=objects)
