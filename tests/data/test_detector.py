"""Detectors: pictures in, boxes out. A small stand-in network has YOLOX's inputs and outputs."""

import numpy as np
import pytest

from genie_sim.base.classes import ROAD_LABELS
from genie_sim.base.errors import UserError
from genie_sim.data.detectors.boxes import COCO_LABELS, best_boxes
from genie_sim.data.detectors.detector import DetectorSettings, find_weights
from genie_sim.data.detectors.image_detector import look
from genie_sim.data.detectors.networks import YoloxNano
from genie_sim.data.detectors.onnx_detector import letterbox
from tests.kitti_folder import DATE, make_network


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    return make_network(tmp_path_factory.mktemp("weights") / "yolox_nano.onnx")


def scores_of(*rows):
    scores = np.zeros((len(rows), len(COCO_LABELS)))
    for i, (label, score) in enumerate(rows):
        scores[i, COCO_LABELS.index(label)] = score
    return scores


def test_decoding_follows_the_network_s_contract(network):
    """xy = (p + cell) * stride, wh = exp(p) * stride, score = objectness * class."""
    detector = DetectorSettings("yolox_nano", network).opened()
    output = np.zeros((80 * 24 + 40 * 12 + 20 * 6, 85), np.float32)
    second_row_of_stride_16 = 80 * 24 + 40 + 3
    output[second_row_of_stride_16, [0, 1, 2, 3, 4, 5 + 2]] = (
        0.25,
        0.5,
        np.log(2.0),
        np.log(3.0),
        0.9,
        0.5,
    )
    boxes, scores = detector.decode([output])
    x, y = (0.25 + 3) * 16, (0.5 + 1) * 16
    assert len(boxes) == 1, "no other cell has an object"
    assert boxes[0] == pytest.approx((x - 16, y - 24, x + 16, y + 24), abs=1e-4)
    assert scores[0, 2] == pytest.approx(0.45)


def test_letterbox_keeps_proportions_and_fills_with_grey():
    boxed, scale = letterbox(np.zeros((375, 1242, 3), np.uint8), (640, 192))
    assert scale == pytest.approx(192 / 375)
    assert boxed.shape == (192, 640, 3)
    assert (boxed[:, :635] == 0).all()
    assert (boxed[:, 636:] == 114).all()


def test_of_overlapping_boxes_of_one_class_the_best_stays():
    boxes = np.array([[0, 0, 100, 100], [5, 0, 105, 100], [300, 0, 400, 100]], float)
    found = best_boxes(boxes, scores_of(("car", 0.5), ("car", 0.8), ("car", 0.4)), min_score=0.3)
    assert [(f.score, f.box[0]) for f in found] == [(0.8, 5), (0.4, 300)]


def test_a_score_that_half_precision_puts_above_1_is_1():
    (car,) = best_boxes(np.array([[0, 0, 9, 9.0]]), scores_of(("car", 1.004)), min_score=0.3)
    assert car.score == 1.0


def test_a_cyclist_does_not_suppress_the_bicycle():
    boxes = np.array([[0, 0, 100, 100], [0, 0, 100, 100]], float)
    found = best_boxes(boxes, scores_of(("person", 0.8), ("bicycle", 0.6)), min_score=0.3)
    assert [f.label for f in found] == ["person", "bicycle"]


def test_a_van_found_as_a_car_and_as_a_truck_is_one_object():
    boxes = np.array([[0, 0, 100, 100], [2, 0, 102, 100]], float)
    found = best_boxes(boxes, scores_of(("car", 0.6), ("truck", 0.5)), min_score=0.3)
    assert [f.label for f in found] == ["car"]


def test_weak_objects_and_what_is_not_of_the_road_are_dropped():
    boxes = np.array([[0, 0, 9, 9], [100, 0, 109, 9], [200, 0, 209, 9]], float)
    assert (
        best_boxes(boxes, scores_of(("car", 0.29), ("tv", 0.9), ("cat", 0.9)), min_score=0.3) == []
    )
    assert len(COCO_LABELS) == 80
    assert set(COCO_LABELS) >= ROAD_LABELS


def test_weights_are_found_by_path_folder_and_environment(network, monkeypatch, tmp_path):
    monkeypatch.delenv("GENIE_SIM_WEIGHTS", raising=False)
    assert find_weights("yolox_nano.onnx", network) == network
    assert find_weights("yolox_nano.onnx", network.parent) == network
    with pytest.raises(UserError, match=r"where is yolox_nano.onnx.*GENIE_SIM_WEIGHTS"):
        find_weights("yolox_nano.onnx")
    monkeypatch.setenv("GENIE_SIM_WEIGHTS", str(network.parent))
    assert find_weights("yolox_nano.onnx") == network
    with pytest.raises(UserError, match=r"yolox_nano.onnx: no such weights file"):
        find_weights("yolox_nano.onnx", tmp_path)


def test_wrong_names_sizes_and_scores_are_refused(network):
    with pytest.raises(
        UserError, match=r"unknown detector 'yolox_nanno' \(did you mean 'yolox_nano'\?\); known:"
    ):
        DetectorSettings("yolox_nanno", network).opened()
    with pytest.raises(UserError, match="size 20000x20000: more than 33,554,432 pixels"):
        DetectorSettings("yolox_nano", network, size=(20_000, 20_000)).opened()
    with pytest.raises(UserError, match=r"min_score 1\.5"):
        DetectorSettings("yolox_nano", network, min_score=1.5).opened()


class Plain:
    """A detector that runs no network."""

    file_name = "yolox_nano.onnx"

    def __init__(self, path, size, min_score):
        self.path = path

    def detect(self, image_bgr):
        return []


class Threaded(Plain):
    """One that takes threads, and gives features."""

    def __init__(self, path, size, min_score, threads):
        super().__init__(path, size, min_score)
        self.threads = threads

    def look(self, image_bgr):
        return self.detect(image_bgr), {"own": b"ab"}


def test_threads_are_of_those_that_take_them(network):
    assert DetectorSettings("tests.data.test_detector:Plain", network).opened().path == network
    with pytest.raises(UserError, match=r"test_detector:Plain.* unexpected .*'threads'"):
        DetectorSettings("tests.data.test_detector:Plain", network, threads=2).opened()
    for name in ("tests.data.test_detector:Threaded", "yolox_nano"):
        with pytest.raises(UserError, match=f"detector '{name}': threads 0 must be"):
            DetectorSettings(name, network, threads=0).opened()
    own = DetectorSettings("tests.data.test_detector:Threaded", network, threads=2).opened()
    assert own.threads == 2 and look(np.zeros((9, 9, 3), np.uint8), own) == ([], {"own": b"ab"})


@pytest.mark.parametrize(
    "content", [b"", b"<html>404 Not DetectedBox</html>", b"\x08\x07" + bytes(range(200))]
)
def test_a_file_that_is_no_network_is_refused(tmp_path, content):
    path = tmp_path / "yolox_nano.onnx"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"yolox_nano.onnx: not an ONNX network") as error:
        DetectorSettings("yolox_nano", path).opened()
    assert "\n" not in str(error.value)


def test_a_truncated_network_is_refused(network, tmp_path):
    path = tmp_path / "yolox_nano.onnx"
    whole = network.read_bytes()
    for share in (0.1, 0.5, 0.9, 0.999):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(UserError, match=r"yolox_nano.onnx: "):
            DetectorSettings("yolox_nano", path).opened()


@pytest.mark.usefixtures("weights_dir")
def test_yolox_finds_the_van_the_cyclist_and_the_pedestrian(kitti_root):
    """Drive 0005, camera 02, first frame: a white van ahead, a man on a bicycle, a woman on the
    pavement.
    """
    from genie_sim.data.kitti.drive import open_drive, read_image

    drive = open_drive(kitti_root, f"{DATE}/0005", ["02"])
    picture, _ = read_image(drive.frames["02"][0].image_path)
    found = DetectorSettings("yolox_nano").opened().detect(picture)
    for label, (x, y) in {"car": (370, 225), "person": (830, 230), "bicycle": (830, 330)}.items():
        assert any(
            f.label == label and f.box[0] < x < f.box[2] and f.box[1] < y < f.box[3] for f in found
        ), label
    assert sum(f.label == "person" for f in found) == 2
    with pytest.raises(UserError, match="inputs and 6 outputs, expected 1 and 1"):
        YoloxNano(find_weights("nanodet_m_416.onnx"))
