"""Bags as drives: written here by rosbags, in the manner of kitti2bag, and perceived."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import inverse, rigid, rotation_from_rpy
from genie_sim.base.import_report import ImportReport
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim_ros.bags import BagTopics, _picture, _places, perceive_bag
from genie_sim_ros.surroundings import Surroundings
from tests.data.made_drives import CHECKS, MadeDrive, cases, steady, told
from tests.ros.bag_files import (
    CAMERA,
    IMAGE,
    IMU_SE3_CAMERA,
    OBJECTS,
    ORIGIN,
    START_NS,
    STEP_NS,
    BagWriter,
)

KINDS = ("bag", "mcap", "ros2")


def street(path: Path, laser_m: float = 1.73) -> BagWriter:
    """Three frames of a car that drives east at 10 m/s; a wall of points 20 m ahead of it, and the
    road ``laser_m`` below its laser.
    """
    bag = BagWriter(path)
    intrinsics = np.array([[700.0, 0, 320], [0, 700, 180], [0, 0, 1]])
    bag.camera_info(START_NS, intrinsics, (640, 360))
    bag.transform(START_NS, "imu_link", CAMERA, IMU_SE3_CAMERA)
    bag.transform(START_NS, "imu_link", "velo_link", rigid(np.eye(3), (0.0, 0.0, 0.8)))
    wall = np.array([(20.0, y, z) for y in np.arange(-3, 3, 0.1) for z in np.arange(-1, 1, 0.1)])
    road = ((x, y, -laser_m) for x in np.arange(4, 28, 0.5) for y in np.arange(-6, 6, 0.5))
    ground = np.array([*road])
    longitude_per_m = 1 / (111_320 * math.cos(math.radians(ORIGIN[0])))
    for number in range(3):
        stamp_ns = START_NS + number * STEP_NS
        bag.position(
            stamp_ns, (ORIGIN[0], ORIGIN[1] + number * longitude_per_m, ORIGIN[2]), (0.0, 0.0, 0.0)
        )
        bag.image(stamp_ns, np.full((360, 640, 3), 10 * number, np.uint8))
        bag.scan(stamp_ns + 2_000_000, np.concatenate([wall, ground]), late_ns=70_000_000)
        bag.objects(
            stamp_ns,
            {"label": "car", "score": 0.75, "x": 280, "y": 150, "width": 80, "height": 60},
            {
                "label": "person",
                "score": 0.5,
                "x": 10,
                "y": 10,
                "width": 5,
                "height": 9,
                "space_frame": "map",
                "at": (7.0, 8.0),
            },
            {"label": "car", "score": 0.2, "x": 280, "y": 150, "width": 80, "height": 60},
        )
    return bag


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_every_kind_becomes_a_trace(kind: str, tmp_path: Path):
    """Stamps, poses along the street, the bag's own detections: one placed by the scan, one where
    the bag says.
    """
    trace = perceive_bag(street(tmp_path / f"street.{kind}").write(), detections=OBJECTS)
    frames = trace.frames[CAMERA]
    assert [frame.stamp_ns for frame in frames] == [0, STEP_NS, 2 * STEP_NS]
    assert trace.origin == ORIGIN
    for number, frame in enumerate(frames):
        assert frame.pose.east_m == pytest.approx(1.0 + number, abs=0.01)
        assert frame.pose.heading_rad == pytest.approx(0.0, abs=1e-3)
        assert (frame.width, frame.height) == (640, 360)
        car, person = frame.detections  # the third one's score is too low
        assert (car.label, car.score, car.placed_by, car.box) == (
            "car",
            0.75,
            "scan",
            (280.0, 150.0, 360.0, 210.0),
        )
        assert number + 20.0 < car.location[0] < number + 20.0 + 4.0, (
            "behind the surface of the wall"
        )
        assert (person.label, person.location, person.placed_by) == (
            "person",
            (7.0, 8.0, 0.0),
            "bag",
        )
    write_trace(tmp_path / "street.parquet", trace)
    assert read_trace(tmp_path / "street.parquet").digest == trace.digest


@pytest.mark.parametrize(("laser_m", "is_told"), [(1.73, False), (1.0, True), (2.5, True)])
def test_a_laser_under_which_no_ground_is_found_is_told(
    tmp_path: Path, laser_m: float, is_told: bool
):
    report = ImportReport("street")
    bag = street(tmp_path / "street.bag", laser_m).write()
    perceive_bag(bag, detections=OBJECTS, report=report)
    assert any("show no ground" in line for line in report.lines()) == is_told
    of_height = ImportReport("street")
    told = perceive_bag(bag, detections=OBJECTS, laser_height_m=laser_m, report=of_height)
    assert not any("show no ground" in line for line in of_height.lines())
    assert all("hsv" in frame.features for frames in told.frames.values() for frame in frames)


def test_the_same_bag_gives_the_same_content_in_ros_1_and_ros_2(tmp_path: Path):
    digests = {
        perceive_bag(street(tmp_path / f"street.{kind}").write(), detections=OBJECTS).digest
        for kind in KINDS
    }
    assert len(digests) == 1


def test_a_scenario_drives_through_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """From the bag to a run, as on the command line: three frames are shown and answered."""
    from genie_sim.cli.main import main
    from genie_sim.runs.folder import run_in_memory
    from genie_sim.scenario.reading import read_scenario

    bag, trace = street(tmp_path / "street.bag").write(), tmp_path / "street.parquet"
    assert main(["import", "bag", str(bag), "--detections", OBJECTS, "--out", str(trace)]) == 0
    assert "3 frames, 6 detections" in capsys.readouterr().out
    scenario = read_scenario(
        {
            "name": "street",
            "perception": {"trace": str(trace)},
            "cameras": [{"name": "front", "recording": CAMERA}],
            "edges": [{"name": "edge1", "device": "quadro_rtx_4000"}],
            "cars": [{"name": "car1", "device": "jetson_tx2", "edge": "edge1"}],
        }
    )
    frames = run_in_memory(scenario).frames
    assert frames.groupby("method").size().to_dict() == {"genie": 3, "local": 3, "remote": 3}
    assert frames[frames["method"] == "remote"]["first_answer_ns"].notna().all()
    assert (frames["objects_fresh"].dropna() == 2).any()


def test_without_gps_the_transforms_say_where_the_car_is(tmp_path: Path):
    bag = street(tmp_path / "street.bag")
    bag.messages = [one for one in bag.messages if "oxts" not in one[1]]
    for number in (0, 2):  # at the second image between the two
        stamp_ns = START_NS + number * STEP_NS
        bag.transform(
            stamp_ns,
            "world",
            "base_link",
            rigid(np.eye(3), (100.0 + number, 0.0, 0.0)),
            static=False,
        )
    bag.transform(START_NS, "base_link", "imu_link", np.eye(4))
    path = bag.write()
    with pytest.raises(UserError, match="say with --origin where the frame 'world' lies"):
        perceive_bag(path, detections=OBJECTS)
    frames = perceive_bag(path, detections=OBJECTS, origin=ORIGIN).frames[CAMERA]
    assert [frame.pose.east_m for frame in frames] == [101.0, 102.0, 103.0]


def test_a_fix_is_the_antenna_s_place_and_not_the_imu_s():
    """The antenna is 2 m before the IMU; the car looks north: the IMU is 2 m south of the fix."""
    around = Surroundings()
    around.frames.add_static("imu_link", "gps", rigid(np.eye(3), (2.0, 0.0, 0.0)))
    around.fixes.append((0, ORIGIN, "gps"))
    around.turns.append((0, rotation_from_rpy(0.0, 0.0, math.pi / 2), "imu_link"))
    origin, place_of = _places(Path("a.bag"), around, None)
    assert origin == ORIGIN
    assert place_of("imu_link", 0)[:3, 3] == pytest.approx((0.0, -2.0, 0.0), abs=1e-6)
    assert place_of("gps", 0)[:3, 3] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert place_of("elsewhere", 0) is None


@pytest.mark.parametrize(
    "without, cameras, told",
    [
        ("oxts", (), "where is the car"),
        ("camera_info", (), "no image topic with a camera_info beside it"),
        (
            "camera_info",
            (IMAGE,),
            "no /kitti/camera_color_left/camera_info says what the camera sees",
        ),
        (
            "nothing",
            ("left=/kitti/camera_color_left/image",),
            "did you mean '/kitti/camera_color_left/image_raw'",
        ),
        ("tf_static", (), "no image was taken where the car's position is known"),
        ("objects", (), "no autoware_msgs/msg/DetectedObjectArray or vision_msgs"),
    ],
)
def test_what_a_bag_lacks_is_named(
    without: str, cameras: tuple[str, ...], told: str, tmp_path: Path
):
    bag = street(tmp_path / "street.bag")
    bag.messages = [one for one in bag.messages if without not in one[1]]
    with pytest.raises(UserError, match=told):
        perceive_bag(bag.write(), cameras=cameras, detections=OBJECTS)


def test_no_bag_at_all(tmp_path: Path):
    with pytest.raises(UserError, match="no such bag"):
        perceive_bag(tmp_path / "none.bag", detections=OBJECTS)
    for name in ("text.bag", "text.mcap", "text.txt"):
        (tmp_path / name).write_text("no bag")
        with pytest.raises(UserError, match=f"{name}: cannot be read as a bag"):
            perceive_bag(tmp_path / name, detections=OBJECTS)


def test_a_picture_in_another_encoding_is_the_same_picture(tmp_path: Path):
    """A detector sees blue, green, red, whatever the bag holds."""
    seen: list[np.ndarray] = []

    class Eye:
        name, sha256 = "eye", "0"

        def detect(self, image_bgr: np.ndarray) -> list[Any]:
            seen.append(image_bgr)
            return []

    picture = np.random.default_rng(1).integers(0, 255, (36, 64, 3), np.uint8)
    for encoding, stored in (
        ("bgr8", picture),
        ("rgb8", np.ascontiguousarray(picture[:, :, ::-1])),
    ):
        bag = street(tmp_path / f"{encoding}.bag")
        bag.messages = [one for one in bag.messages if one[1] != IMAGE]
        bag.image(START_NS, stored, encoding)
        perceive_bag(bag.write(), detector=Eye())
    assert len(seen) == 2
    assert all((one == picture).all() for one in seen)


def test_what_a_detector_of_ones_own_gives_is_checked_as_on_a_drive(tmp_path: Path):
    class Eye:
        name, sha256 = "eye", "0"

        def detect(self, image_bgr: np.ndarray) -> list[Any]:
            return [("car", 0.9, (90.0, 50.0, 99.0, 60.0))]

    bag = street(tmp_path / "street.bag")
    bag.messages = [message for message in bag.messages if message[1] != IMAGE]
    bag.image(START_NS, np.zeros((36, 64, 3), np.uint8), "bgr8")
    with pytest.raises(UserError, match=r"^detector Eye: .* outside of its picture of 64 x 36"):
        perceive_bag(bag.write(), detector=Eye())


@pytest.mark.parametrize("format_", ["png", "jpeg"])
def test_a_compressed_image_is_read(tmp_path: Path, format_: str):
    import cv2

    picture = np.zeros((36, 64, 3), np.uint8)
    picture[:, :32] = (200, 100, 50)  # blue, green, red
    suffix = {"png": ".png", "jpeg": ".jpg"}[format_]
    data = cv2.imencode(suffix, picture)[1]
    compressed = SimpleNamespace(format=format_, data=data)
    decoded = _picture(tmp_path / "a.bag", "/camera", compressed)
    assert decoded.shape == (36, 64, 3)
    assert np.abs(decoded.astype(int) - picture)[:, :24].max() <= (0 if format_ == "png" else 6)
    broken = SimpleNamespace(format=format_, data=np.zeros(9, np.uint8))
    with pytest.raises(UserError, match=f"/camera: a compressed image .*{format_}"):
        _picture(tmp_path / "a.bag", "/camera", broken)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ("bag", "mcap"))
def test_kitti_in_a_bag_is_perceived_as_from_its_folder(
    kind: str, kitti_root: Path, weights_dir: Path, tmp_path: Path
):
    from genie_sim.data.detectors.detector import DetectorSettings
    from genie_sim.data.kitti.drive import open_drive, read_image
    from genie_sim.data.kitti.perceive import FrameSelection, perceive

    numbers = range(0, 50, 10)
    expected = perceive(
        kitti_root,
        FrameSelection("2011_09_26/0005", ("02",), numbers),
        DetectorSettings(weights=weights_dir),
    )
    drive = open_drive(kitti_root, "2011_09_26/0005", ("02",))
    shown = [frame for frame in drive.frames["02"] if frame.index in numbers]
    bag = BagWriter(tmp_path / f"kitti.{kind}")
    first = shown[0]
    bag.transform(
        first.stamp_ns,
        "imu_link",
        CAMERA,
        inverse(drive.layout.world_SE3_imu[0]) @ first.world_SE3_camera,
    )
    bag.transform(first.stamp_ns, CAMERA, "velo_link", drive.camera_SE3_velo("02"))
    bag.camera_info(first.stamp_ns, first.intrinsics, (1242, 375))
    folder = kitti_root / "2011_09_26" / "2011_09_26_drive_0005_sync"
    for frame in shown:
        values = [
            float(text)
            for text in (folder / "oxts/data" / f"{frame.index:010d}.txt").read_text().split()
        ]
        bag.position(
            frame.stamp_ns, (values[0], values[1], values[2]), (values[3], values[4], values[5])
        )
        bag.image(frame.stamp_ns, read_image(frame.image_path)[0])
        bag.scan(frame.stamp_ns + 5_000_000, drive.scan(frame.index))
    found: Trace = perceive_bag(
        bag.write(),
        detector=DetectorSettings("yolox_nano", weights_dir).opened(),
        cameras=(f"02={IMAGE}",),
        origin=expected.origin,
    )

    assert [frame.dhash for frame in found.frames["02"]] == [
        frame.dhash for frame in expected.frames["02"]
    ]
    assert sum(len(frame.detections) for frame in expected.frames["02"]) > 10
    for here, there in zip(found.frames["02"], expected.frames["02"], strict=True):
        assert here.stamp_ns == there.stamp_ns
        assert tuple(here.pose) == pytest.approx(tuple(there.pose), abs=0.002)
        assert [(one.label, one.score, one.box, one.placed_by) for one in here.detections] == [
            (one.label, one.score, one.box, one.placed_by) for one in there.detections
        ]
        for one, other in zip(here.detections, there.detections, strict=True):
            assert (one.location is None) == (other.location is None)
            if one.location is not None:
                assert one.location == pytest.approx(other.location, abs=0.005)


def changed(path: Path, topic: str, change: Callable[[int, Any], None]) -> Path:
    """The street; ``change`` gets the number of each message of a topic, and the message."""
    bag = street(path)
    for number, one in enumerate(one for one in bag.messages if topic in one[1]):
        change(number, one[3])
    return bag.write()


def invalid_imu(number: int, message: Any) -> None:
    message.orientation_covariance[0] = -1


def no_fix(number: int, message: Any) -> None:
    if number == 0:
        message.status.status, message.latitude, message.longitude = -1, 0.0, 0.0


def no_altitude(number: int, message: Any) -> None:
    if number != 1:
        message.altitude = math.nan


def no_stamp(number: int, message: Any) -> None:
    message.header.stamp.sec = message.header.stamp.nanosec = 0


def test_an_imu_that_knows_no_orientation_gives_no_heading(tmp_path: Path):
    path = changed(tmp_path / "a.mcap", "oxts/imu", invalid_imu)
    with pytest.raises(UserError, match="Imu that says its orientation, so that the heading is"):
        perceive_bag(path, detections=OBJECTS)


def test_a_frame_without_a_fix_is_left_out(tmp_path: Path):
    path, report = changed(tmp_path / "a.mcap", "gps/fix", no_fix), ImportReport("a")
    trace = perceive_bag(path, detections=OBJECTS, origin=ORIGIN, report=report)
    assert [round(frame.pose.east_m) for frame in trace.frames[CAMERA]] == [2, 3]
    assert report.left_out["images taken where the position is not known"] == 1
    assert report.left_out["fixes of /kitti/oxts/gps/fix without a position"] == 1


def test_a_fix_without_an_altitude_has_that_of_the_fix_before(tmp_path: Path):
    path, report = changed(tmp_path / "a.mcap", "gps/fix", no_altitude), ImportReport("a")
    trace = perceive_bag(path, detections=OBJECTS, report=report)
    assert [round(frame.pose.up_m, 3) for frame in trace.frames[CAMERA]] == [0.8] * 3
    assert "2 fixes have no altitude" in " ".join(report.warnings)


def test_a_stamp_of_zero_is_the_time_of_the_recording(tmp_path: Path):
    path, report = changed(tmp_path / "a.mcap", "image_raw", no_stamp), ImportReport("a")
    trace = perceive_bag(path, detections=OBJECTS, report=report)
    same = perceive_bag(street(tmp_path / "b.mcap").write(), detections=OBJECTS)
    assert trace.digest == same.digest
    assert f"{IMAGE}: 3 stamps are 0: the time of the recording is taken" in report.warnings


def test_intrinsics_are_those_of_the_pictures_size(tmp_path: Path):
    """At half the size a camera sees the same angle; another shape is refused."""

    def half(number: int, message: Any) -> None:
        message.height, message.width, message.step = 180, 320, 960
        message.data = np.zeros(180 * 960, np.uint8)

    path, report = changed(tmp_path / "a.mcap", "image_raw", half), ImportReport("a")
    trace = perceive_bag(path, detections=OBJECTS, report=report)
    same = perceive_bag(street(tmp_path / "b.mcap").write(), detections=OBJECTS)
    assert trace.frames[CAMERA][0].horizontal_fov_rad == same.frames[CAMERA][0].horizontal_fov_rad
    assert "pictures of 320x180, camera_info of 640x360" in report.warnings[0]

    def cut(number: int, message: Any) -> None:
        message.height, message.data = 180, message.data[: 180 * message.step]

    with pytest.raises(UserError, match="another shape, so nobody knows what was cut off"):
        perceive_bag(changed(tmp_path / "c.mcap", "image_raw", cut), detections=OBJECTS)


def with_camera(path: Path, base: str, encoding: str = "bgr8") -> Path:
    """The street, with a second camera at ``base``."""
    bag = street(path)
    for at_ns, name, kind, message in list(bag.messages):
        if "camera_info" in name:
            bag.messages.append((at_ns, f"{base}/camera_info", kind, message))
        if "image_raw" in name:
            fields = vars(message) | {"encoding": encoding}
            bag.messages.append((at_ns, f"{base}/image_raw", kind, type(message)(**fields)))
    return bag.write()


def test_two_cameras_of_one_name_are_both_read(tmp_path: Path):
    path = with_camera(tmp_path / "a.mcap", f"/rear/{CAMERA}")
    trace = perceive_bag(path, detections=OBJECTS)
    assert sorted(trace.frames) == [f"kitti_{CAMERA}", f"rear_{CAMERA}"]
    assert [len(frames) for frames in trace.frames.values()] == [3, 3]


def test_which_pictures_of_one_camera_are_taken_is_told(tmp_path: Path):
    bag, report = street(tmp_path / "a.mcap"), ImportReport("a")
    raw = f"/kitti/{CAMERA}/image_raw"
    same = [
        (at, f"/kitti/{CAMERA}/image_rect", *of) for at, name, *of in bag.messages if name == raw
    ]
    bag.messages += same
    perceive_bag(bag.write(), detections=OBJECTS, report=report)
    assert report.chosen == [f"images: {raw}, not /kitti/{CAMERA}/image_rect (--topic)"]


def test_distances_are_no_pictures(tmp_path: Path):
    path, report = with_camera(tmp_path / "a.mcap", "/depth", "16UC1"), ImportReport("a")
    assert list(perceive_bag(path, detections=OBJECTS, report=report).frames) == [CAMERA]
    assert report.left_out["topic /depth/image_raw: distances, no picture"] == 1
    with pytest.raises(UserError, match="/depth/image_raw: holds distances, not a picture"):
        perceive_bag(path, cameras=["/depth/image_raw"], detections=OBJECTS)


def test_detections_with_stamps_of_their_own_are_told(tmp_path: Path):
    """Each comes 30 ms after its image; if that is accepted it counts for the image before."""

    def late(number: int, message: Any) -> None:
        message.header.stamp.nanosec += 30_000_000

    path, report = changed(tmp_path / "a.mcap", "objects", late), ImportReport("a", accept=True)
    with pytest.raises(UserError, match=r"3 of 3 arrays have the stamp of no image .*30 ms away"):
        perceive_bag(path, detections=OBJECTS)
    trace = perceive_bag(path, detections=OBJECTS, report=report)
    same = perceive_bag(street(tmp_path / "b.mcap").write(), detections=OBJECTS)
    assert trace.digest == same.digest


def test_which_of_two_imus_is_taken_is_told_and_chosen(tmp_path: Path):
    """The other one, of a car that looks north; both lack nothing."""
    bag, quarter = street(tmp_path / "a.mcap"), math.sqrt(0.5)
    for at_ns, name, kind, message in list(bag.messages):
        if name == "/kitti/oxts/imu":
            turn = type(message.orientation)(x=0.0, y=0.0, z=quarter, w=quarter)
            other = type(message)(**(vars(message) | {"orientation": turn}))
            bag.messages.append((at_ns, "/other/imu", kind, other))
    path, report = bag.write(), ImportReport("a")
    heading = perceive_bag(path, detections=OBJECTS, report=report).frames[CAMERA][0].pose[3]
    assert heading == pytest.approx(0.0, abs=1e-3)
    assert report.chosen == ["imu: /kitti/oxts/imu, not /other/imu (--imu)"]
    sensors = BagTopics(imu="/other/imu")
    trace = perceive_bag(path, detections=OBJECTS, sensors=sensors)
    assert trace.frames[CAMERA][0].pose[3] == pytest.approx(math.pi / 2, abs=1e-3)
    with pytest.raises(UserError, match="unknown topic '/no/imu'"):
        perceive_bag(path, detections=OBJECTS, sensors=BagTopics(imu="/no/imu"))


def test_labels_of_a_bag_that_are_no_classes_are_told_and_mapped(tmp_path: Path):
    def relabel(number: int, message: Any) -> None:
        message.objects[0].label = "7"

    path, report = changed(tmp_path / "a.mcap", "objects", relabel), ImportReport("a")
    trace = perceive_bag(path, detections=OBJECTS, report=report)
    assert report.unused == {"7": 3}
    assert [d.label for d in trace.frames[CAMERA][0].detections] == ["person"]
    mapped = perceive_bag(path, detections=OBJECTS, classes={"7": "car"})
    same = perceive_bag(street(tmp_path / "b.mcap").write(), detections=OBJECTS)
    assert mapped.digest == same.digest
    with pytest.raises(UserError, match="9 of 9 detections have labels that are no classes"):
        perceive_bag(path, detections=OBJECTS, classes={"car": "no", "person": "no", "7": "no"})
    assert mapped.provenance["import"]["read"][f"images of {CAMERA}"] == 3


def of_bag(drive: MadeDrive, folder: Path, report: ImportReport) -> None:
    """The bag of a drive whose detector tells where objects are on the map."""
    bag = BagWriter(folder / "a.mcap")
    bag.camera_info(START_NS, np.array([[700.0, 0, 320], [0, 700, 180], [0, 0, 1]]), (640, 360))
    bag.transform(START_NS, "imu_link", CAMERA, IMU_SE3_CAMERA)
    places = drive.places(drive.objects_m)
    for t_s, fix, at in zip(drive.times_s, drive.geodetic(), places, strict=True):
        stamp_ns = START_NS + round(t_s * 1e9)
        bag.position(stamp_ns, fix, (0.0, 0.0, drive.heading_rad))
        bag.image(stamp_ns, np.zeros((360, 640, 3), np.uint8))
        seen = {"label": drive.label, "score": drive.score, "space_frame": "map", "at": at}
        bag.objects(stamp_ns, {"x": 280, "y": 150, "width": 80, "height": 60} | seen)
    perceive_bag(bag.write(), detections=OBJECTS, report=report)


def test_a_frame_that_is_not_optical_is_refused(tmp_path: Path):
    """Its x looks ahead and its z up, as frames of bodies do."""
    bag = street(tmp_path / "a.mcap")
    bag.messages[:] = [message for message in bag.messages if "tf" not in message[1]]
    bag.transform(START_NS, "imu_link", CAMERA, rigid(np.eye(3), (1.0, 0.06, 0.8)))
    bag.transform(START_NS, "imu_link", "velo_link", rigid(np.eye(3), (0.0, 0.0, 0.8)))
    path, report = bag.write(), ImportReport("a", accept=True)
    with pytest.raises(UserError, match=r"looks up or down: is its frame .* optical"):
        perceive_bag(path, detections=OBJECTS)
    perceive_bag(path, detections=OBJECTS, report=report)
    assert sum("optical" in line for line in report.warnings) == 1


@pytest.mark.parametrize("check", [name for _, name in cases("bag")])
def test_what_is_wrong_is_refused_or_told_as_by_every_reader(tmp_path: Path, check: str):
    drive, message, is_refused, _ = CHECKS[check]
    refused, lines = told(of_bag, drive, tmp_path)
    assert any(re.search(message, line) for line in lines), lines
    assert refused == is_refused and not any("\n" in line for line in lines)


def test_of_a_drive_that_is_right_nothing_is_told(tmp_path: Path):
    assert told(of_bag, steady(), tmp_path) == (False, [])
