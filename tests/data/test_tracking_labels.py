"""Tracking sequences become traces: in one world with their labels, with scores that mean
something.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from genie_sim.base.classes import MOVING_MPS
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import inverse, project, transform
from genie_sim.data.kitti.drive_truth import make_truth, read_labels
from genie_sim.data.kitti.layouts import picture_size
from genie_sim.data.kitti.tracking_labels import tracking_labels
from genie_sim.data.kitti.tracking_sequence import open_sequence, sequences
from genie_sim.data.kitti.tracklets import _box_of
from tests.data.tracking_files import CALIBRATION, CAR, OXTS
from tools.make.published import POINTRCNN_SCORES, tracking_trace


@pytest.fixture
def root(tmp_path):
    """Three frames of a car that stands still and looks east; a parked car 20 m ahead and 2 m to
    the left.
    """
    tmp_path /= "tracking"
    for folder in (
        "training/oxts",
        "training/calib",
        "training/label_02",
        "detections/pointrcnn_Car",
        "detections/pointrcnn_Pedestrian",
        "detections/rrc_Car",
        "detections/rrc_Pedestrian",
    ):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "training/oxts/0003.txt").write_text((OXTS + "\n") * 3)
    (tmp_path / "training/calib/0003.txt").write_text(CALIBRATION)
    label = "{} 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 20.0 -1.6\n"
    (tmp_path / "training/label_02/0003.txt").write_text("".join(map(label.format, range(3))))
    cars = "".join(
        CAR.format(frame=frame, logit=logit) for frame, logit in ((0, 8.0), (2, 3.1), (2, -0.5))
    )
    (tmp_path / "detections/pointrcnn_Car/0003.txt").write_text(cars)
    (tmp_path / "detections/pointrcnn_Pedestrian/0003.txt").write_text("")
    (tmp_path / "detections/rrc_Car/0003.txt").write_text("1,500.0,170.0,600.0,230.0,0.9\n")
    (tmp_path / "detections/rrc_Pedestrian/0003.txt").write_text("")
    return tmp_path


def test_a_sequence_becomes_a_trace(root):
    trace = tracking_trace(root, "0003")
    first, second, third = trace.frames["02"]
    assert (first.width, first.height, third.stamp_ns) == (1242, 375, 200_000_000)
    (car,) = first.detections
    assert (car.label, car.placed_by) == ("car", "scan")
    assert car.location == pytest.approx((20.0, 2.0, -1.6 + 0.75), abs=0.01)
    assert second.detections == ()
    # the weak one is left out
    assert [d.score for d in third.detections] == [pytest.approx(0.5255, abs=1e-3)]
    assert (
        len({frame.digest for frame in trace.frames["02"]})
        == len({f.dhash for f in trace.frames["02"]})
        == 3
    )


@pytest.mark.parametrize(("kind", "counts"), [("Car", True), ("Tram", False), ("Misc", False)])
def test_labels_and_detections_share_a_world(root, kind, counts):
    """What is found on a tram or a trailer is there, though nobody is expected to know of it."""
    path = root / "training/label_02/0003.txt"
    path.write_text(path.read_text().replace("Car", kind))
    trace = tracking_trace(root, "0003", origin=(49.001, 8.402, 100.0))
    truth = read_labels(root.parent, "tracking/0003", trace)
    (car,), (label,) = trace.frames["02"][0].detections, truth.pictures["02", 0]
    assert car.location == pytest.approx(label.centre, abs=0.01)
    assert (label.group, label.track, label.counts) == ("vehicles", 7, counts)
    assert truth.moving == frozenset()
    rows = make_truth(root.parent, "tracking/0003", trace).rows
    assert [(row.label, row.visible) for row in rows] == [("car", counts)] * 3
    path.write_text(path.read_text().replace(" 20.0 ", " 900.0 "))
    with pytest.raises(UserError, match=f"^{path}: 3 of 3 objects are more than 250 m away"):
        make_truth(root.parent, "tracking/0003", trace)


@pytest.mark.parametrize(("right_m", "box"), [(0.0, (500, 100, 700, 300)), (90.0, None)])
def test_a_box_outside_of_the_picture_is_none(right_m, box):
    intrinsics = np.array([[1000.0, 0, 600], [0, 1000, 200], [0, 0, 1]])
    corners = [(right_m + x, y, 10.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    assert _box_of(np.array(corners), intrinsics, (1242, 375)) == box


@pytest.mark.parametrize(
    ("speed_mps", "moves"), [(0.8 * MOVING_MPS, False), (1.2 * MOVING_MPS, True), (-9.0, True)]
)
def test_who_leaves_the_first_place_fast_enough_moves(root, speed_mps, moves):
    """The labels of three frames, 0.1 s apart; the second track stands."""
    label = "{} {} Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 {} -1.6\n"
    lines = [
        label.format(i, track, 20.0 + i * 0.1 * v)
        for i in range(3)
        for track, v in ((7, speed_mps), (8, 0.0))
    ]
    (root / "training/label_02/0003.txt").write_text("".join(lines))
    trace = tracking_trace(root, "0003")
    assert read_labels(root.parent, "tracking/0003", trace).moving == ({7} if moves else set())
    both = replace(trace, frames=dict.fromkeys(("02", "03"), trace.frames["02"]))
    assert make_truth(root.parent, "tracking/0003", both).cameras == ("02",)
    rows = make_truth(root.parent, "tracking/0003", trace).rows
    assert [(row.frame, row.object, row.moving) for row in rows] == [
        (frame, track, moves and track == 7) for frame in range(3) for track in (7, 8)
    ]


def test_who_comes_back_has_moved(root):
    """The farthest from the first place counts: 0.12 m in 0.2 s."""
    label = "{} 7 Car 0 0 -1.5 500 170 600 230 1.5 1.6 3.9 -2.0 1.6 {} -1.6\n"
    lines = [label.format(i, z) for i, z in enumerate((20.0, 20.12, 20.06))]
    (root / "training/label_02/0003.txt").write_text("".join(lines))
    assert read_labels(root.parent, "tracking/0003", tracking_trace(root, "0003")).moving == {7}


def test_boxes_in_pictures_are_placed_by_the_ground(root):
    frames = tracking_trace(root, "0003", "rrc").frames["02"]
    (car,) = frames[1].detections
    assert car.placed_by == "ground"
    assert 15 < car.location[0] < 30


def test_scores_rise_with_the_logit_and_stay_in_0_to_1(root):
    path = root / "detections/pointrcnn_Car/0003.txt"
    path.write_text(
        "".join(CAR.format(frame=0, logit=logit) for logit in (-900, -0.85, 0, 3, 15.6, 900))
    )
    scores = [
        d.score for d in tracking_trace(root, "0003", min_score=0.0).frames["02"][0].detections
    ]
    assert scores == sorted(scores, reverse=True)
    assert scores[0] == 1.0
    assert scores[-1] == 0.0
    a, b = POINTRCNN_SCORES["car"]
    # the fourth best has logit 0
    assert scores[3] == pytest.approx(1 / (1 + math.exp(-b)), abs=1e-4)
    assert a > 0


@pytest.mark.parametrize(
    ("file", "content", "place"),
    [
        ("detections/pointrcnn_Car/0003.txt", "0,2,1,2\n", "line 1"),
        ("detections/pointrcnn_Car/0003.txt", CAR.format(frame=3, logit=1), "frame 3"),
        ("detections/pointrcnn_Car/0003.txt", CAR.format(frame=0, logit="nan"), "line 1"),
        ("detections/pointrcnn_Car/0003.txt", CAR.format(frame=0.5, logit=1), "0.5 is no"),
        ("detections/rrc_Car/0003.txt", "0,9,9,1,1,0.5\n", "ends before"),
        ("detections/rrc_Car/0003.txt", "0,1,1,9,9,7.5\n", "score 7.5"),
        ("training/oxts/0003.txt", "", "empty"),
        ("training/oxts/0003.txt", "1 2 3\n", "line 1"),
        ("training/oxts/0003.txt", OXTS + "\n90.0000001" + OXTS[4:], "value 1 is 90.0000001"),
        ("training/oxts/0003.txt", OXTS + "\n1e308 " + OXTS[5:], "line 2"),
        ("training/calib/0003.txt", CALIBRATION.replace("172.854", "1e308"), "inverted"),
        ("training/calib/0003.txt", CALIBRATION.replace("P2", "P9"), "P2"),
    ],
)
def test_broken_files_are_named(root, file, content, place):
    (root / file).write_text(content)
    with pytest.raises(UserError) as error:
        tracking_trace(root, "0003", "rrc" if "rrc" in file else "pointrcnn")
    assert str(error.value).startswith(str(root / file)) and place in str(error.value)


@pytest.mark.parametrize(
    ("focal_px", "size"),
    [
        ("721.5377", (1242, 375)),
        ("707.0493", (1224, 370)),
        ("718.3351", (1238, 374)),
        ("707.0912", (1226, 370)),
        ("718.856", (1241, 376)),
        ("7.188560000000e+02", (1241, 376)),
        ("718.85", (1241, 376)),
        ("500", None),
    ],
)
def test_the_size_of_the_pictures_is_that_of_the_day(focal_px, size):
    """The calibrations of KITTI's five days; sequence 0020 is of the last one."""
    assert picture_size(float(focal_px)) == size


@pytest.mark.parametrize(
    "line",
    [
        "0 1 Car",
        "0 1 Car 0 0 0 a b c d 1 1 1 1 1 1 1",
        "9 1 Car" + " 0" * 14,
        "0 1 Car" + " inf" * 14,
    ],
)
def test_broken_labels_are_named(root, line):
    path = root / "training/label_02/0003.txt"
    path.write_text(line)
    with pytest.raises(UserError, match=r"0003.txt: line 1: "):
        tracking_labels(path, open_sequence(root / "training", "0003"))


def test_unknown_names_list_the_known(root):
    with pytest.raises(UserError, match=r"unknown tracking sequence '0004'"):
        tracking_trace(root, "0004")
    with pytest.raises(UserError, match=r"unknown published detector 'yolox_nano'"):
        tracking_trace(root, "0003", "yolox_nano")


def test_a_labelled_box_projects_to_its_place_in_the_image(kitti_root):
    """KITTI's own relation: the middle of a vehicle's box, projected by our camera 2, lies inside
    its labelled box.
    """
    training = kitti_root / "tracking" / "training"
    inside = []
    for sequence in sequences(kitti_root / "tracking" / "training"):
        drive = open_sequence(training, sequence)
        labels = tracking_labels(training / "label_02" / f"{sequence}.txt", drive)
        for frame, label in labels:
            if not label.counts or label.group != "vehicles":
                continue
            x1, y1, x2, y2 = label.box
            width, height = picture_size(drive.intrinsics[0, 0])
            if x1 > 1 and x2 < width - 2 and y2 < height - 2:  # all in the picture
                in_camera = transform(inverse(drive.world_SE3_camera2(frame)), label.centre)
                x, y = project(drive.intrinsics, in_camera[None])[0]
                inside.append(x1 < x < x2 and y1 < y < y2)
    print(f"{len(inside)} vehicles, {np.mean(inside):.4f} inside")
    assert len(inside) > 10_000
    assert np.mean(inside) > 0.995


def test_a_labelled_parked_car_has_one_place_in_the_world(kitti_root):
    """All 15 sequences: the centres of labelled vehicles that do not move. Labels and GPS wander by
    decimetres themselves (sequence 0019 by more); a wrong transform moves centres by metres to tens
    of metres.
    """
    wander_m = []
    for sequence in sequences(kitti_root / "tracking" / "training"):
        truth = read_labels(
            kitti_root, f"tracking/{sequence}", tracking_trace(kitti_root / "tracking", sequence)
        )
        parked: dict[int, list[tuple[float, ...]]] = {}
        for label in itertools.chain.from_iterable(truth.pictures.values()):
            if (
                label.group == "vehicles"
                and label.centre is not None
                and label.track not in truth.moving
            ):
                parked.setdefault(label.track, []).append(label.centre)
        for centres in map(np.array, parked.values()):
            if len(centres) >= 10:
                offsets = centres - np.median(centres, axis=0)
                wander_m.append(float(np.hypot(*offsets[:, :2].T).max()))
    median_m, p90_m = np.percentile(wander_m, [50, 90])
    print(
        f"{len(wander_m)} parked vehicles: farthest from their median place "
        f"{median_m:.2f} m, p90 {p90_m:.2f} m"
    )
    assert len(wander_m) > 200
    assert median_m < 0.4
    assert p90_m < 1.0


def test_both_layouts_of_drive_0005_are_one_world(kitti_root):
    """Sequence 0000 is drive 0005: its camera stands where the raw drive's camera 2 does, frame by
    frame.
    """
    from genie_sim.data.kitti.drive import open_drive

    raw = open_drive(kitti_root, "2011_09_26/0005", ["02"])
    sequence = open_sequence(kitti_root / "tracking" / "training", "0000", raw.layout.origin)
    for frame in raw.frames["02"]:
        assert sequence.world_SE3_camera2(frame.index) == pytest.approx(
            frame.world_SE3_camera, abs=0.02
        )


@pytest.mark.parametrize("detections", ["pointrcnn", "rrc"])
def test_all_sequences_become_traces(kitti_root, detections):
    for sequence in sequences(kitti_root / "tracking" / "training"):
        trace = tracking_trace(kitti_root / "tracking", sequence, detections)
        found = [d for frame in trace.frames["02"] for d in frame.detections]
        assert len(found) > len(trace.frames["02"]) / 2
        assert all(0.3 <= d.score <= 1 for d in found)


def test_a_score_is_the_share_of_detections_that_are_right():
    """As fitted, every other car is right at a logit of 3.0, and every other person at 2.1."""
    for label, logit in (("car", 3.0), ("person", 2.1)):
        a, b = POINTRCNN_SCORES[label]
        assert 1 / (1 + math.exp(-(a * logit + b))) == pytest.approx(0.5, abs=0.01)
