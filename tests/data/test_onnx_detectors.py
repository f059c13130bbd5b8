"""Every detector keeps the same promises. One more class at the end tests those of a new one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.classes import ROAD_LABELS
from genie_sim.data.detector import DETECTORS, Yolov8, make_detector
from tests.kitti_folder import make_network
from tests.made_up_networks import make_nanodet, make_yolov8


class Conformance:
    """What ``perceive`` relies on. ``network`` makes a file with a car in each white 8 x 8 cell of
    the picture.
    """

    name: str
    size: tuple[int, int]

    def network(self, folder: Path) -> Path:
        raise NotImplementedError

    @pytest.fixture
    def detector(self, tmp_path):
        return make_detector(self.name, self.network(tmp_path), self.size, min_score=0.05)

    def picture(self, *cells, scale=1):
        image = np.zeros((self.size[1] // 8, self.size[0] // 8, 3), np.uint8)
        for column, row in cells:
            image[row, column] = 255
        return np.kron(image, np.ones((8 * scale, 8 * scale, 1), np.uint8))

    def test_it_finds_what_is_there(self, detector):
        (car,) = detector.detect(self.picture((20, 11)))
        assert car.label == "car"
        x1, y1, x2, y2 = car.box
        assert ((x1 + x2) / 2, (y1 + y2) / 2) == pytest.approx((164, 92), abs=0.5)

    def test_two_cars_are_two_best_first(self, detector):
        found = detector.detect(self.picture((8, 12), (30, 12)))
        assert len(found) == 2
        assert found[0].score >= found[1].score

    def test_nothing_there_nothing_found(self, detector):
        assert detector.detect(self.picture()) == []

    def test_boxes_are_in_pixels_of_the_picture(self, detector):
        small, large = (
            detector.detect(self.picture((20, 12), scale=scale))[0].box for scale in (1, 2)
        )
        assert large == pytest.approx([2 * value for value in small], abs=0.1)

    def test_boxes_end_at_the_border(self, detector):
        (car,) = detector.detect(self.picture((0, 0)))
        assert car.box[:2] == (0, 0)

    @pytest.mark.parametrize("shape", [(375, 1242), (370, 1224), (1, 1), (2000, 3)])
    def test_any_size_of_picture_will_do(self, detector, shape):
        for found in detector.detect(np.full((*shape, 3), 200, np.uint8)):
            assert found.label in ROAD_LABELS
            assert 0 <= found.score <= 1
            assert 0 <= found.box[0] <= found.box[2] <= shape[1]
            assert 0 <= found.box[1] <= found.box[3] <= shape[0]

    def test_the_same_picture_gives_the_same_answer(self, detector, tmp_path):
        noise = np.random.default_rng(5).integers(0, 255, (96, 320, 3), dtype=np.uint8)
        again = make_detector(self.name, self.network(tmp_path), self.size, min_score=0.05)
        assert detector.detect(noise) == detector.detect(noise) == again.detect(noise)

    def test_it_says_which_weights_it_has(self, detector):
        assert len(detector.sha256) == 64
        assert detector.size == self.size

    def test_more_threads_find_the_same(self, detector, tmp_path):
        threaded = make_detector(self.name, self.network(tmp_path), self.size, 0.05, threads=2)
        image = self.picture((20, 12))
        assert threaded.detect(image)[0].box == pytest.approx(
            detector.detect(image)[0].box, abs=0.01
        )

    def test_several_pictures_at_a_time_give_the_same(self, detector, tmp_path):
        """Three at a time, and two of three."""
        together = make_detector(self.name, self.network(tmp_path), self.size, 0.05, batch=3)
        images = [self.picture((20, 12)), self.picture(), self.picture((5, 6))]
        blobs, scales = zip(*map(together.prepare, images), strict=True)
        for count in (3, 2):
            outputs = together.infer_many(blobs[:count])
            assert len(outputs) == count
            for image, output, scale in zip(images, outputs, scales, strict=False):
                found, alone = (
                    together.found(output, scale, image.shape[1::-1]),
                    detector.detect(image),
                )
                assert [one.label for one in found] == [one.label for one in alone]
                assert [one.box for one in found] == [
                    pytest.approx(one.box, abs=0.01) for one in alone
                ]

    @pytest.mark.parametrize("size", [(640, 100), (0, 0), (-32, 32)])
    def test_an_impossible_size_is_refused(self, tmp_path, size):
        with pytest.raises(UserError, match="multiples of 32"):
            make_detector(self.name, self.network(tmp_path), size)

    def test_the_weights_of_another_network_are_refused(self, tmp_path):
        others = [
            kind.network(kind(), tmp_path)
            for kind in Conformance.__subclasses__()
            if kind.layout != self.layout
        ]
        for path in others:
            with pytest.raises(UserError, match=rf"{path.name}: ") as error:
                make_detector(self.name, path, self.size)
            assert "\n" not in str(error.value)


class TestYoloxNano(Conformance):
    name, size, layout = "yolox_nano", (640, 192), "yolox"

    def network(self, folder):
        return make_network(folder / "yolox_nano.onnx")


class TestYoloxTiny(Conformance):
    name, size, layout = "yolox_tiny", (416, 416), "yolox"

    def network(self, folder):
        return make_network(folder / "yolox_tiny.onnx")


class TestYoloxS(Conformance):
    name, size, layout = "yolox_s", (640, 640), "yolox"

    def network(self, folder):
        return make_network(folder / "yolox_s.onnx", side=640)


class TestNanodet(Conformance):
    name, size, layout = "nanodet_m", (416, 416), "nanodet"

    def network(self, folder):
        return make_nanodet(folder / "nanodet_m_416.onnx")

    def test_a_side_is_the_mean_of_its_distribution_in_strides(self, detector):
        (car,) = detector.detect(self.picture((20, 11)))
        assert car.box == pytest.approx((164 - 24, 92 - 24, 164 + 24, 92 + 24), abs=0.01)


class TestYolov8(Conformance):
    name, size, layout = "yolov8", (320, 320), "yolov8"

    def network(self, folder):
        return make_yolov8(folder / "yolov8.onnx")

    def test_the_file_says_its_size_and_classes(self, tmp_path):
        detector = make_detector(
            "yolov8", make_yolov8(tmp_path / "own.onnx", labels=("person", "car", "wheel"))
        )
        assert detector.size == (320, 320)
        assert detector.labels == ("person", "car", "wheel")

    def test_an_open_size_must_be_given(self, tmp_path):
        path = make_yolov8(tmp_path / "open.onnx", side=None)
        assert make_detector("yolov8", path, (320, 320)).size == (320, 320)
        with pytest.raises(UserError, match=r"open.onnx: leaves its input's size open"):
            make_detector("yolov8", path)

    @pytest.mark.parametrize(
        "names", ["", "{0: 'car'", "[]", "__import__('os')", "{1: 'car'}", "7"]
    )
    def test_broken_names_are_refused_not_run(self, names):
        with pytest.raises(UserError, match=r"x.onnx: metadata: names"):
            Yolov8.labels_of(Path("x.onnx"), {"names": names})


def test_a_network_for_one_picture_only_says_so(tmp_path):
    """Its shapes go through a node of their own, so they cannot be told from other numbers."""
    import onnx
    from onnx import helper

    network = onnx.load(make_network(tmp_path / "yolox_nano.onnx"))
    for node in network.graph.node:
        if node.op_type == "Reshape":
            node.input[1] = "copied"
    network.graph.node.insert(0, helper.make_node("Identity", ["shape"], ["copied"]))
    onnx.save(network, tmp_path / "one.onnx")
    assert make_detector("yolox_nano", tmp_path / "one.onnx").batch == 1
    with pytest.raises(UserError, match=r"one.onnx: does not support batch size 2"):
        make_detector("yolox_nano", tmp_path / "one.onnx", batch=2)


def test_every_detector_is_tested():
    assert {kind.name for kind in Conformance.__subclasses__()} == set(DETECTORS)


def test_an_unknown_provider_names_those_that_exist(tmp_path):
    path = make_network(tmp_path / "yolox_nano.onnx")
    with pytest.raises(UserError, match=r"unknown provider 'CUDAProvider'.*CPUExecutionProvider"):
        make_detector("yolox_nano", path, providers=["CUDAProvider"])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere:Detector", "No module named 'nowhere'"),
        ("pathlib:Nothing", "has no attribute 'Nothing'"),
        ("pathlib:Path", "has no detect, file_name"),
    ],
)
def test_a_detector_of_one_s_own_that_is_none(name, message):
    with pytest.raises(UserError, match=message):
        make_detector(name)


@pytest.mark.slow
def test_nanodet_on_real_frames(kitti_root, weights_dir):
    """Drive 0005, camera 02, every fifth frame: near the figures of a first measurement (0.786 and
    0.719).
    """
    from genie_sim.data.detector import DetectorSettings
    from genie_sim.data.evaluation import evaluate
    from genie_sim.data.perceive import LOWEST_SCORE, DriveFrames, perceive
    from genie_sim.data.truth import read_truth

    trace = perceive(
        kitti_root,
        DriveFrames("2011_09_26/0005", ["02"], range(0, 154, 5)),
        DetectorSettings("nanodet_m", weights_dir, min_score=LOWEST_SCORE, place_from=0.99),
    )
    judged = evaluate(trace, read_truth(kitti_root, "tracking/0000", trace), 0.3)
    precision = {name: group.average_precision() for name, group in judged.groups.items()}
    print(precision)
    assert precision["vehicles"] > 0.7
    assert precision["persons"] > 0.6
