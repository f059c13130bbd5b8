"""Tiny ONNX networks with the inputs and outputs of real detectors: each sees a car in every white
8 x 8 cell.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

CAR = 2  # COCO's number


def make_nanodet(path: Path, side: int = 416) -> Path:
    """NanoDet's six outputs; a car reaches 3 strides from its cell's centre to every side."""
    from onnx import TensorProto, helper, numpy_helper

    nodes, constants, outputs = [], [numpy_helper.from_array(np.array([1, 80, -1]), "scores")], []
    constants.append(numpy_helper.from_array(np.array([1, 32, -1]), "sides"))
    for kind, channels in (("cls_pred", 80), ("dis_pred", 32)):
        for stride in (8, 16, 32):
            name = f"{kind}_stride_{stride}"
            weight, bias = (
                np.zeros((channels, 3, stride, stride), np.float32),
                np.zeros(channels, np.float32),
            )
            if kind == "cls_pred":
                weight[CAR] = (0.2 if stride == 8 else 0.0) / (3 * stride * stride)
            else:
                bias[3::8] = 20.0  # all four distributions are at bin 3
            constants += [
                numpy_helper.from_array(weight, f"w_{name}"),
                numpy_helper.from_array(bias, f"b_{name}"),
            ]
            convolution = ["pictures", f"w_{name}", f"b_{name}"]
            shape = "scores" if kind == "cls_pred" else "sides"
            nodes.append(
                helper.make_node("Conv", convolution, [f"c_{name}"], strides=[stride, stride])
            )
            nodes.append(helper.make_node("Relu", [f"c_{name}"], [f"p_{name}"]))
            nodes.append(helper.make_node("Reshape", [f"p_{name}", shape], [f"r_{name}"]))
            nodes.append(helper.make_node("Transpose", [f"r_{name}"], [name], perm=[0, 2, 1]))
            cells = (side // stride) ** 2
            outputs.append(
                helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, cells, channels])
            )
    return _saved(path, nodes, outputs, constants, side)


def make_yolov8(
    path: Path, side: int | None = 320, labels: tuple[str, ...] = ("wheel", "car")
) -> Path:
    """The one output of an Ultralytics export; a car is 80 x 40 pixels. ``side`` ``None``: left
    open in the file.
    """
    from onnx import TensorProto, helper, numpy_helper

    channels, fixed = 4 + len(labels), side or 320
    nodes = []
    constants = [numpy_helper.from_array(np.array([1, channels, -1]), "shape")]
    centres = np.zeros(
        (1, channels, sum((fixed // stride) ** 2 for stride in (8, 16, 32))), np.float32
    )
    column = 0
    for stride in (8, 16, 32):
        weight = np.zeros((channels, 3, stride, stride), np.float32)
        bias = np.zeros(channels, np.float32)
        bias[2:4] = 80, 40
        if stride == 8 and "car" in labels:
            weight[4 + labels.index("car")] = 1 / (3 * stride * stride)
        constants += [
            numpy_helper.from_array(weight, f"w{stride}"),
            numpy_helper.from_array(bias, f"b{stride}"),
        ]
        nodes.append(
            helper.make_node(
                "Conv",
                ["pictures", f"w{stride}", f"b{stride}"],
                [f"c{stride}"],
                strides=[stride] * 2,
            )
        )
        nodes.append(helper.make_node("Reshape", [f"c{stride}", "shape"], [f"r{stride}"]))
        across = np.arange(fixed // stride)
        x, y = np.meshgrid((across + 0.5) * stride, (across + 0.5) * stride)
        centres[0, :2, column : column + x.size] = x.ravel(), y.ravel()
        column += x.size
    constants.append(numpy_helper.from_array(centres, "centres"))
    nodes.append(helper.make_node("Concat", ["r8", "r16", "r32"], ["all"], axis=2))
    nodes.append(helper.make_node("Add", ["all", "centres"], ["output0"]))
    output = helper.make_tensor_value_info("output0", TensorProto.FLOAT, list(centres.shape))
    names = {"names": str(dict(enumerate(labels)))}
    return _saved(path, nodes, [output], constants, side, names)


def make_yolov10(path: Path, side: int = 320) -> Path:
    """The output of a network with suppression inside: left, top, right, bottom, score, class."""
    network, (places, scores) = _parts_of_yolov8(path, side)
    corners = network.constant(
        "corners", [[[1, 0, -0.5, 0], [0, 1, 0, -0.5], [1, 0, 0.5, 0], [0, 1, 0, 0.5]]]
    )
    boxes = network.of(("MatMul", [corners, places], {}))
    best = network.of(("ReduceMax", [scores], {"axes": [1], "keepdims": 1}))
    number = network.of(("ArgMax", [scores], {"axis": 1}), ("Cast", ["@"], {"to": 1}))
    network.of(("Concat", [boxes, best, number], {"axis": 1}))
    return network.save(("Transpose", [network.last], {"perm": [0, 2, 1]}))


def make_sized_rtdetr(path: Path, side: int = 320) -> Path:
    """The two inputs and three outputs of RT-DETR as its authors export it."""
    from onnx import TensorProto, helper

    network, (places, scores) = _parts_of_yolov8(path, side)
    corners = network.constant(
        "corners", [[[1, 0, -0.5, 0], [0, 1, 0, -0.5], [1, 0, 0.5, 0], [0, 1, 0, 0.5]]]
    )
    network.of(
        ("MatMul", [corners, places], {}),
        ("Transpose", ["@"], {"perm": [0, 2, 1]}),
        ("Mul", ["@", network.constant("share", [[[1 / side]]])], {}),
    )
    shares = network.last
    sizes = network.of(
        ("Cast", ["orig_target_sizes"], {"to": 1}),
        ("Concat", ["@", "@"], {"axis": 1}),
        ("Unsqueeze", ["@"], {"axes": [1]}),
    )
    boxes = network.of(("Mul", [shares, sizes], {}))
    classes = network.of(("ArgMax", [scores], {"axis": 1, "keepdims": 0}))
    best = network.of(("ReduceMax", [scores], {"axes": [1], "keepdims": 0}))
    graph = network.model.graph
    graph.input.append(
        helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [1, 2])
    )
    del graph.output[:]
    for name, kind, axes in ((classes, "INT64", 2), (boxes, "FLOAT", 3), (best, "FLOAT", 2)):
        value = helper.make_tensor_value_info(name, getattr(TensorProto, kind), [None] * axes)
        graph.output.append(value)
    return network.write()


def make_rtdetr(path: Path, side: int = 320) -> Path:
    """The output of RT-DETR: places as shares of the picture."""
    network, (places, scores) = _parts_of_yolov8(path, side)
    shares = network.of(("Mul", [places, network.constant("share", [[[1 / side]]])], {}))
    network.of(("Concat", [shares, scores], {"axis": 1}))
    return network.save(("Transpose", [network.last], {"perm": [0, 2, 1]}))


class _Network:
    """A network that is being made out of another: each step gets a name of its own."""

    def __init__(self, path: Path, model) -> None:
        self.path, self.model, self.last = path, model, ""

    def constant(self, name: str, values) -> str:
        from onnx import numpy_helper

        array = np.asarray(values, np.float32)
        self.model.graph.initializer.append(numpy_helper.from_array(array, name))
        return name

    def whole(self, values) -> str:
        from onnx import numpy_helper

        name = f"whole{len(self.model.graph.initializer)}"
        array = np.asarray(values, np.int64)
        self.model.graph.initializer.append(numpy_helper.from_array(array, name))
        return name

    def of(self, *steps) -> str:
        """The output of some nodes one after the other; ``@`` is that of the one before."""
        from onnx import helper

        for kind, inputs, attributes in steps:
            name = f"step{len(self.model.graph.node)}"
            inputs = [self.last if one == "@" else one for one in inputs]
            self.model.graph.node.append(helper.make_node(kind, inputs, [name], **attributes))
            self.last = name
        return self.last

    def save(self, step) -> Path:
        from onnx import TensorProto, helper

        last = self.of(step)
        del self.model.graph.output[:]
        kind = helper.make_tensor_value_info(last, TensorProto.FLOAT, [None] * 3)
        self.model.graph.output.append(kind)
        return self.write()

    def write(self) -> Path:
        import onnx

        onnx.save(self.model, str(self.path))
        return self.path


def _parts_of_yolov8(path: Path, side: int) -> tuple[_Network, tuple[str, str]]:
    """A YOLOv8 to go on from, and its places and its scores, each (1, n, boxes)."""
    import onnx

    network = _Network(path, onnx.load(str(make_yolov8(path, side))))
    cut = [network.whole(values) for values in ([0], [4], [6], [1])]
    places = network.of(("Slice", ["output0", cut[0], cut[1], cut[3]], {}))
    scores = network.of(("Slice", ["output0", cut[1], cut[2], cut[3]], {}))
    return network, (places, scores)


def _saved(path, nodes, outputs, constants, side, metadata=None) -> Path:
    import onnx
    from onnx import TensorProto, helper

    picture = helper.make_tensor_value_info(
        "pictures", TensorProto.FLOAT, [1, 3, side or "height", side or "width"]
    )
    graph = helper.make_graph(nodes, "stand-in", [picture], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 11)], ir_version=7)
    for key, value in (metadata or {}).items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.save(model, str(path))
    return path
