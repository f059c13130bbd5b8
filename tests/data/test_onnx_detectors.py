"""Every detector keeps the same promises. One more class at the end tests those of a new one."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.classes import ROAD_LABELS
from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors import onnx_session
from genie_sim.data.detectors.detector import DETECTORS, DetectorSettings
from genie_sim.data.detectors.image_detector import tell_network
from genie_sim.data.detectors.networks import Yolov8
from tests.kitti_folder import make_network
from tests.made_up_networks import (
    make_nanodet,
    make_rtdetr,
    make_sized_rtdetr,
    make_yolov8,
    make_yolov10,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("networks")


@pytest.fixture(scope="class")
def detector(request, folder):
    """That of a class of tests, opened once."""
    tests = request.cls
    network = tests().network(folder)
    return DetectorSettings(tests.name, network, tests.size, min_score=0.05).opened()


class Conformance:
    """What ``perceive`` relies on. ``network`` makes a file with a car in each white 8 x 8 cell of
    the picture.
    """

    name: str
    size: tuple[int, int]

    def network(self, folder: Path) -> Path:
        raise NotImplementedError

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

    @pytest.mark.parametrize("shape", [(375, 1242), (1, 1), (2000, 3)])
    def test_any_size_of_picture_will_do(self, detector, shape):
        for found in detector.detect(np.full((*shape, 3), 200, np.uint8)):
            assert found.label in ROAD_LABELS
            assert 0 <= found.score <= 1
            assert 0 <= found.box[0] <= found.box[2] <= shape[1]
            assert 0 <= found.box[1] <= found.box[3] <= shape[0]

    def test_the_same_picture_gives_the_same_answer_on_more_threads_too(self, detector, folder):
        noise = np.random.default_rng(5).integers(0, 255, (96, 320, 3), dtype=np.uint8)
        again = DetectorSettings(
            self.name, self.network(folder), self.size, 0.05, threads=2
        ).opened()
        assert detector.detect(noise) == detector.detect(noise)
        image = self.picture((20, 12))
        assert again.detect(image)[0].box == pytest.approx(detector.detect(image)[0].box, abs=0.01)
        assert again.sha256 == detector.sha256 and len(again.sha256) == 64
        assert again.size == self.size

    def test_the_weights_of_another_network_are_refused(self, folder):
        other = next(one for one in Conformance.__subclasses__() if one.layout != self.layout)
        path = other.network(other(), folder)
        with pytest.raises(UserError, match=rf"{path.name}: ") as error:
            DetectorSettings(self.name, path, self.size).opened()
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
        detector = DetectorSettings(
            "yolov8", make_yolov8(tmp_path / "own.onnx", labels=("person", "car", "wheel"))
        ).opened()
        assert detector.size == (320, 320)
        assert detector.labels == ("person", "car", "wheel")

    def test_an_open_size_must_be_given(self, tmp_path):
        path = make_yolov8(tmp_path / "open.onnx", side=None)
        assert DetectorSettings("yolov8", path, (320, 320)).opened().size == (320, 320)

    @pytest.mark.parametrize(
        "names", ["", "{0: 'car'", "[]", "__import__('os')", "{1: 'car'}", "7"]
    )
    def test_broken_names_are_refused_not_run(self, tmp_path, names):
        import onnx

        path = make_yolov8(tmp_path / "x.onnx")
        model = onnx.load(str(path))
        model.metadata_props[0].value = names
        onnx.save(model, str(path))
        with pytest.raises(UserError, match=r"x.onnx: metadata: names"):
            DetectorSettings("yolov8", path).opened()


class TestYolov10(Conformance):
    name, size, layout = "yolov10", (320, 320), "yolov10"

    def network(self, folder):
        return make_yolov10(folder / "yolov10.onnx")

    def test_a_box_is_given_by_its_corners(self, detector):
        (car,) = detector.detect(self.picture((20, 11)))
        assert car.box == pytest.approx((124, 72, 204, 112), abs=0.5)


class TestSizedRtDetr(Conformance):
    name, size, layout = "rtdetr_sized", (320, 320), "rtdetr_sized"

    def network(self, folder):
        return make_sized_rtdetr(folder / "sized.onnx")

    def test_it_finds_what_rtdetr_finds(self, detector, tmp_path):
        other = DetectorSettings(
            "rtdetr", make_rtdetr(tmp_path / "other.onnx"), self.size, 0.05
        ).opened()
        for scale in (1, 2):
            (car,), (same,) = (
                one.detect(self.picture((20, 11), scale=scale)) for one in (detector, other)
            )
            assert car.label == same.label and car.box == pytest.approx(same.box, abs=0.5)


class TestRtDetr(Conformance):
    name, size, layout = "rtdetr", (320, 320), "rtdetr"

    def network(self, folder):
        return make_rtdetr(folder / "rtdetr.onnx")

    def test_places_are_shares_of_the_picture(self, detector):
        (car,) = detector.detect(self.picture((20, 11)))
        assert car.box == pytest.approx((124, 72, 204, 112), abs=0.5)


def white_cell() -> np.ndarray:
    """A picture of 320 x 320 with one white cell, where the made-up networks see a car."""
    image = np.zeros((320, 320, 3), np.uint8)
    image[88:96, 160:168] = 255
    return image


def changed(path: Path, change: str) -> Path:
    """A YOLOv8 that says the same in another way: ``logits``, ``shares`` or ``channels last``."""
    import onnx
    from onnx import helper, numpy_helper

    model = onnx.load(str(make_yolov8(path)))
    nodes, constants = model.graph.node, model.graph.initializer
    if change == "channels last":
        dims = model.graph.input[0].type.tensor_type.shape.dim
        dims[1].dim_value, dims[3].dim_value = 320, 3
        nodes.insert(0, helper.make_node("Transpose", ["last"], ["first"], perm=[0, 3, 1, 2]))
        for node in nodes[1:]:
            node.input[:] = ["first" if name == "pictures" else name for name in node.input]
        model.graph.input[0].name = "last"
    else:
        rows = np.ones((1, 6, 1), np.float32)
        if change == "shares":
            rows[0, :4] = 1 / 320
        else:
            rows[0, 4:] = 9.0
        constants.append(numpy_helper.from_array(rows, "rows"))
        nodes[-1].output[0] = "usual"
        nodes.append(helper.make_node("Mul", ["usual", "rows"], ["output0"]))
    onnx.save(model, str(path))
    return path


# What is wrong: the file, its size if given, and what the one line says: where, and of what kind.
REFUSED = {
    "another layout": (
        make_yolov10,
        None,
        r"a.onnx: .*its output is \(.*, 6\), expected \(6, 2100\); --detector names other",
    ),
    "another number of ends": (make_sized_rtdetr, None, "a.onnx: .*has 2 inputs and 3 outputs"),
    "an open size": (
        partial(make_yolov8, side=None),
        None,
        "a.onnx: .*leaves its input's size open",
    ),
    "channels last": (
        partial(changed, change="channels last"),
        None,
        "a.onnx: .*channels last; expected",
    ),
    "logits": (partial(changed, change="logits"), None, "a.onnx: .*are no probabilities"),
    "shares": (partial(changed, change="shares"), None, "a.onnx: .*shares of the picture"),
    "a size that is no multiple": (
        make_yolov8,
        (640, 100),
        "detector yolov8: size .*multiples of 32",
    ),
    "a negative size": (make_yolov8, (-32, 32), "detector yolov8: size .*multiples of 32"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_network_that_cannot_be_used_is_one_line(what, tmp_path):
    make, size, message = REFUSED[what]
    with pytest.raises(UserError, match=message) as error:
        DetectorSettings("yolov8", make(tmp_path / "a.onnx"), size).opened()
    assert "\n" not in str(error.value)


def test_what_a_later_picture_shows_of_a_network_is_told_too(tmp_path, monkeypatch):
    """Logits of a picture without objects may look like scores."""
    monkeypatch.setattr(Yolov8, "_look_at_grey", lambda *_: None)
    for change, message in (("logits", "no probabilities"), ("shares", "shares of the picture")):
        network = changed(tmp_path / "a.onnx", change)
        with pytest.raises(UserError, match=message):
            DetectorSettings("yolov8", network).opened().detect(white_cell())


def external(path: Path, folder: Path) -> Path:
    """The same network as ``torch.onnx.export`` writes it: all tensors in a file beside it."""
    import onnx

    target = folder / path.name
    model = onnx.load(str(path))
    onnx.save_model(
        model,
        str(target),
        save_as_external_data=True,
        all_tensors_to_one_file=True,
        location=f"{path.name}.data",
        size_threshold=0,
    )
    return target


def test_tensors_in_a_file_beside_the_network_are_read(tmp_path):
    folder = tmp_path / "export"
    folder.mkdir()
    whole = make_yolov8(tmp_path / "yolov8.onnx")
    path = external(whole, folder)
    split, same = (
        DetectorSettings("yolov8", path).opened(),
        DetectorSettings("yolov8", whole).opened(),
    )
    assert split.detect(white_cell()) == same.detect(white_cell()) != []
    data = folder / "yolov8.onnx.data"
    before, content = split.sha256, bytearray(data.read_bytes())
    content[-1] ^= 1
    data.write_bytes(content)
    assert DetectorSettings("yolov8", path).opened().sha256 != before, (
        "the tensors decide what it sees"
    )
    data.write_bytes(content[:100])
    with pytest.raises(UserError, match=r"yolov8.onnx: not an ONNX network: "):
        DetectorSettings("yolov8", path).opened()
    data.unlink()
    with pytest.raises(UserError, match=r"yolov8.onnx.data, but it "):
        DetectorSettings("yolov8", path).opened()
    data.symlink_to("/etc/hostname")
    with pytest.raises(UserError, match=r"yolov8.onnx: not an ONNX network: "):
        DetectorSettings("yolov8", path).opened()


@pytest.mark.parametrize("location", ["/etc/hostname", "../a.data", "", "b/c"])
def test_tensors_elsewhere_are_refused(tmp_path, location):
    import onnx

    folder = tmp_path / "export"
    folder.mkdir()
    path = external(make_yolov8(tmp_path / "yolov8.onnx"), folder)
    model = onnx.load(str(path), load_external_data=False)
    for entry in model.graph.initializer[0].external_data:
        if entry.key == "location":
            entry.value = location
    path.write_bytes(model.SerializeToString())
    with pytest.raises(UserError, match=r"yolov8.onnx: not an ONNX network: "):
        DetectorSettings("yolov8", path).opened()


def make_pooling_yolox(path: Path) -> Path:
    """The made-up network with a pooling at two sizes, as at the end of a backbone."""
    import onnx
    from onnx import helper, numpy_helper

    model = onnx.load(str(make_network(path)))
    mean = numpy_helper.from_array(np.full((4, 6, 1, 1), 1 / 6, np.float32), "mean")
    model.graph.initializer.append(mean)
    for side in (3, 5):
        sides = {"kernel_shape": [side, side], "pads": [side // 2] * 4}
        model.graph.node.append(helper.make_node("MaxPool", ["images"], [f"p{side}"], **sides))
    model.graph.node.append(helper.make_node("Concat", ["p3", "p5"], ["pools"], axis=1))
    model.graph.node.append(helper.make_node("Conv", ["pools", "mean"], ["c"]))
    model.graph.node.append(helper.make_node("Relu", ["c"], ["activation"]))
    onnx.save(model, str(path))
    return path


@pytest.mark.parametrize(
    ("name", "make", "features"),
    [("yolov8", make_yolov8, set()), ("yolox_nano", make_pooling_yolox, {"yolox_gap"})],
)
def test_a_network_of_half_precision_sees_the_same(tmp_path, name, make, features):
    import onnx
    from onnx import TensorProto, numpy_helper

    whole, size = make(tmp_path / "whole.onnx"), None if name == "yolov8" else (416, 416)
    model = onnx.load(str(whole))
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            array = numpy_helper.to_array(tensor).astype(np.float16)
            tensor.CopyFrom(numpy_helper.from_array(array, tensor.name))
    for value in (*model.graph.input, *model.graph.output):
        value.type.tensor_type.elem_type = TensorProto.FLOAT16
    onnx.save(model, str(tmp_path / "half.onnx"))
    half = DetectorSettings(name, tmp_path / "half.onnx", size).opened()
    (car,), told = half.look(white_cell())
    (same,) = DetectorSettings(name, whole, size).opened().detect(white_cell())
    assert {*told} == features
    assert car.label == same.label and car.score == pytest.approx(same.score, abs=0.01)
    assert car.box == pytest.approx(same.box, abs=1)


def test_a_yolox_that_decodes_itself_is_recognised(tmp_path):
    """The made-up network with its decoding behind it finds the same cars."""
    import onnx
    from onnx import helper, numpy_helper

    raw = make_network(tmp_path / "yolox_nano.onnx")
    plain = DetectorSettings("yolox_nano", raw, (416, 416)).opened()
    model = onnx.load(str(raw))
    scale, shift = np.ones((2, 1, len(plain.cells), 85), np.float32)
    scale[..., :4], shift[:] = plain.cell_strides, 0
    shift[..., :2] = plain.cells
    nodes = model.graph.node
    nodes[-1].output[0] = "raw"
    for name, array in (("scale", scale), ("shift", shift)):
        model.graph.initializer.append(numpy_helper.from_array(array, name))
    for name, values in (("two", [2]), ("four", [4]), ("all", [85]), ("from", [0]), ("last", [2])):
        array = np.array(values, np.int64)
        model.graph.initializer.append(numpy_helper.from_array(array, f"n_{name}"))
    for name, begin, end in (("xy", "from", "two"), ("wh", "two", "four"), ("rest", "four", "all")):
        inputs = ["shifted", f"n_{begin}", f"n_{end}", "n_last"]
        nodes.append(helper.make_node("Slice", inputs, [name]))
    nodes.insert(len(nodes) - 3, helper.make_node("Add", ["raw", "shift"], ["shifted"]))
    nodes.append(helper.make_node("Exp", ["wh"], ["sides"]))
    nodes.append(helper.make_node("Concat", ["xy", "sides", "rest"], ["decoded"], axis=2))
    nodes.append(helper.make_node("Mul", ["decoded", "scale"], ["output"]))
    onnx.save(model, str(tmp_path / "decoded.onnx"))
    decoded = DetectorSettings("yolox_nano", tmp_path / "decoded.onnx", (416, 416)).opened()
    found, same = decoded.detect(white_cell()), plain.detect(white_cell())
    assert [one.label for one in found] == [one.label for one in same] == ["car"]
    assert found[0].box == pytest.approx(same[0].box, abs=0.01)
    told = ImportReport("x"), ImportReport("x")
    tell_network(told[0], decoded)
    tell_network(told[1], plain)
    assert [report.chosen for report in told] == [
        ["yolox_nano: the network decodes its boxes itself"],
        [],
    ]


def test_labels_of_a_network_are_counted_and_mapped(tmp_path):
    path = make_yolov8(tmp_path / "a.onnx", labels=("car", "truck"))
    model = path.read_bytes().replace(b"'car'", b"'van'")
    path.write_bytes(model)
    detector = DetectorSettings("yolov8", path).opened()
    assert detector.detect(white_cell()) == []
    report = ImportReport("x")
    tell_network(report, detector)
    assert report.unused == {"van": 1}
    mapped = DetectorSettings("yolov8", path, classes={"van": "car"}).opened()
    assert [one.label for one in mapped.detect(white_cell())] == ["car"]
    path.write_bytes(model.replace(b"'truck'", b"'lorry'"))
    with pytest.raises(UserError, match=r"none of the network's classes \(van, lorry\) is of a ro"):
        DetectorSettings("yolov8", path).opened()


def bomb(path: Path, kind: str) -> Path:
    """A network with a few nodes behind it that take 40 GB, twice as much at each node, or all the
    time there is.
    """
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    model = onnx.load(str(make_yolov8(path)))
    nodes, name = model.graph.node, model.graph.output[0].name
    nodes[-1].output[0] = last = "before"
    largest = np.array([10**10] if kind == "constant" else 2**62, np.int64)
    model.graph.initializer.append(numpy_helper.from_array(largest, "n"))
    if kind == "constant":
        nodes.append(helper.make_node("ConstantOfShape", ["n"], ["many"]))
        nodes.append(helper.make_node("ReduceMax", ["many"], ["zero"], keepdims=0))
        nodes.append(helper.make_node("Add", ["before", "zero"], [name]))
    elif kind == "doubled":
        for number in range(40):
            nodes.append(helper.make_node("Concat", [last, last], [f"twice{number}"], axis=0))
            last = f"twice{number}"
        nodes.append(helper.make_node("ReduceMax", [last], [name], axes=[0]))
    else:
        value = helper.make_tensor_value_info
        body = helper.make_graph(
            [helper.make_node("Identity", [f"{end}_in"], [end]) for end in ("go", "same")],
            "body",
            [
                value("turn", TensorProto.INT64, []),
                value("go_in", TensorProto.BOOL, []),
                value("same_in", TensorProto.FLOAT, None),
            ],
            [value("go", TensorProto.BOOL, []), value("same", TensorProto.FLOAT, None)],
        )
        nodes.append(helper.make_node("Loop", ["n", "", "before"], [name], body=body))
    onnx.save(model, str(path))
    return path


@pytest.mark.unix
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits a process's memory so")
@pytest.mark.parametrize("kind", ["constant", "doubled"])
def test_a_network_that_takes_too_much_memory_is_refused(tmp_path, monkeypatch, kind):
    import resource

    monkeypatch.setattr(onnx_session, "FIRST_BYTES", 5 * 10**8)
    before = resource.getrlimit(resource.RLIMIT_AS)
    with pytest.raises(UserError, match=r"a.onnx: needs more than 0.6 GB for a picture of 320x320"):
        DetectorSettings("yolov8", bomb(tmp_path / "a.onnx", kind)).opened()
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_a_network_that_never_ends_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_session, "FIRST_S", 0.5)
    with pytest.raises(UserError, match=r"a.onnx: has no answer to its first picture after 0.5 s"):
        DetectorSettings("yolov8", bomb(tmp_path / "a.onnx", "loop")).opened()


def test_every_detector_is_tested():
    assert {kind.name for kind in Conformance.__subclasses__()} == set(DETECTORS)


def test_an_unknown_provider_names_those_that_exist(tmp_path):
    path = make_network(tmp_path / "yolox_nano.onnx")
    with pytest.raises(UserError, match=r"unknown provider 'CUDAProvider'.*CPUExecutionProvider"):
        DetectorSettings("yolox_nano", path, providers=["CUDAProvider"]).opened()


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
        DetectorSettings(name).opened()


@pytest.mark.slow
def test_nanodet_on_real_frames(kitti_root, weights_dir):
    """Drive 0005, camera 02, every fifth frame: near the figures of a first measurement (0.786 and
    0.719).
    """
    from genie_sim.data.detectors.detector import DetectorSettings
    from genie_sim.data.kitti.drive_truth import read_labels
    from genie_sim.data.kitti.perceive import FrameSelection, perceive
    from tools.make.evaluation import LOWEST_SCORE, evaluate

    trace = perceive(
        kitti_root,
        FrameSelection("2011_09_26/0005", ["02"], range(0, 154, 5)),
        DetectorSettings("nanodet_m", weights_dir, min_score=LOWEST_SCORE),
    )
    judged = evaluate(trace, read_labels(kitti_root, "tracking/0000", trace), 0.3)
    precision = {name: group.average_precision() for name, group in judged.groups.items()}
    print(precision)
    assert precision["vehicles"] > 0.7
    assert precision["persons"] > 0.6
