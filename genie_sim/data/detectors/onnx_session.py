"""Reads ONNX networks, with tensors in files beside them, and opens them with ONNX Runtime.
``onnx.load`` refuses names that lead elsewhere and more bytes than a file has. A network is also a
program: its memory has a limit here and for its first picture, which has one of time, too.
"""

import hashlib
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, tells_of_low_memory, unknown
from genie_sim.base.parallel import limited_memory

MAX_BYTES = 2**31 - 1  # of a network; ONNX Runtime takes no more from memory
COPIES = 4  # of a network in the memory while it is read
CPU = "CPUExecutionProvider"
# What a network may take for its first picture: some bytes for each pixel and each of its own, and
# seconds. A hundred times what published networks take.
FIRST_BYTES, BYTES_OF_PIXEL = 2 * 10**9, 1000
FIRST_S = 60.0


def read_network(weights: Path, inputs: int, outputs: int) -> tuple[Any, str]:
    """The ONNX network in a file, with one picture as its first input, and the sha256 of its file
    and of its tensors in files beside it. Raises UserError for any other file.

    Parameters
    ----------
    weights : the file
    inputs, outputs : how many it must have
    """
    import onnx

    bound = limited_memory(COPIES * MAX_BYTES)
    with as_user_error(f"{weights}: not an ONNX network", Exception), bound:
        if weights.stat().st_size > MAX_BYTES:
            raise ValueError(f"has more than {MAX_BYTES:,} bytes")
        total = hashlib.sha256(weights.read_bytes())
        bare = onnx.load(str(weights), load_external_data=False).ByteSize()
        network = onnx.load(str(weights))
        if network.ByteSize() > bare:
            total.update(network.SerializeToString(deterministic=True))
        onnx.checker.check_model(network)
    graph = network.graph
    constants = {tensor.name for tensor in graph.initializer}
    own_inputs = [value for value in graph.input if value.name not in constants]
    if (len(own_inputs), len(graph.output)) != (inputs, outputs):
        raise UserError(
            f"{weights}: has {len(own_inputs)} inputs and {len(graph.output)} outputs, "
            f"expected {inputs} and {outputs}; --detector names other kinds"
        )
    dims = own_inputs[0].type.tensor_type.shape.dim
    shape = [dim.dim_value or dim.dim_param or "any" for dim in dims]
    is_last = len(dims) == 4 and dims[3].dim_value in (1, 3) and dims[1].dim_value != 3
    if len(dims) != 4 or is_last or dims[1].dim_value not in (0, 3):
        last = "channels last; " if is_last else ""
        raise UserError(
            f"{weights}: its input is ({', '.join(map(str, shape))}), {last}expected a picture: "
            "(1, 3, height, width)"
        )
    # Initializers listed as inputs cannot be folded, and recorded shapes are those of the exported
    # size.
    del graph.input[:], graph.value_info[:]
    graph.input.extend(own_inputs)
    return network, total.hexdigest()


def add_last_activation(graph: Any) -> bool:
    """Adds an output: the activation that follows the concatenation of what the last poolings made
    (in YOLOX, spatial pyramid pooling at the end of the backbone). Whether there is one; it is
    found by the structure, not by a name.
    """
    from onnx import ValueInfoProto

    pooled = [node.output[0] for node in graph.node if node.op_type == "MaxPool"]
    ends = [
        node.output[0]
        for node in graph.node
        if node.op_type == "Concat" and len({*node.input} & {*pooled}) > 1
    ]
    for name in ends[-1:]:
        conv = [
            node.output[0] for node in graph.node if node.op_type == "Conv" and name in node.input
        ]
        after = [
            node.output[0]
            for node in graph.node
            if {*node.input} & {*conv[:1]} and node.op_type != "Sigmoid"
        ]
        if after:
            # without its type, which follows from the network: float or float16
            graph.output.append(ValueInfoProto(name=after[0]))
            return True
    return False


def open_session(
    weights: Path,
    network: Any,
    size: tuple[int, int],
    *,
    providers: Sequence[str],
    threads: int,
) -> Any:
    """An ONNX Runtime session for pictures of a width and height; the network may have been made
    for another. Raises UserError.
    """
    import onnxruntime
    from onnx import numpy_helper

    for provider in providers:
        if provider not in onnxruntime.get_available_providers():
            raise UserError(unknown("provider", provider, onnxruntime.get_available_providers()))
    dims = network.graph.input[0].type.tensor_type.shape.dim
    for dim, value in zip(dims, (1, 3, size[1], size[0]), strict=True):
        dim.dim_value = value
    for value in network.graph.input[1:]:
        sizes = np.array([size], np.int64)
        network.graph.initializer.append(numpy_helper.from_array(sizes, value.name))
    del network.graph.input[1:]
    for number, output in enumerate(network.graph.output):
        for axis, dim in enumerate(output.type.tensor_type.shape.dim):
            dim.dim_param = f"output_{number}_{axis}"
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    # leaves the cores to others
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    # ONNX Runtime's exceptions have no common base of their own, nor have ONNX's and Protobuf's.
    unusable = (
        f"{weights}: ONNX Runtime cannot use this network at {size[0]}x{size[1]}; --size and "
        "--detector name other sizes and kinds"
    )
    with as_user_error(unusable, Exception):
        return onnxruntime.InferenceSession(
            network.SerializeToString(), options, providers=list(providers)
        )


@contextmanager
def bounded_memory(
    weights: Path, network: Any, size: tuple[int, int], providers: Sequence[str]
) -> Iterator[None]:
    """Raises UserError for a network that needs more than any for pictures of a width and height.
    Devices other than the processor take addresses for all their memory, and have no limit.
    """
    width, height = size
    more_bytes = FIRST_BYTES + BYTES_OF_PIXEL * width * height + COPIES * network.ByteSize()
    try:
        with limited_memory(more_bytes) if (*providers,) == (CPU,) else nullcontext():
            yield
    except Exception as error:
        if tells_of_low_memory(error.__cause__ or error):
            raise UserError(
                f"{weights}: needs more than {more_bytes / 1e9:.1f} GB for a picture of "
                f"{width}x{height}"
            ) from error
        raise


@contextmanager
def bounded_time(weights: Path) -> Iterator[Any]:
    """Options for a session's first picture. Raises UserError where it takes longer than any."""
    import onnxruntime

    options = onnxruntime.RunOptions()
    timer = threading.Timer(FIRST_S, setattr, (options, "terminate", True))
    timer.daemon = True
    timer.start()
    try:
        yield options
    except Exception as error:
        if options.terminate:
            raise UserError(
                f"{weights}: has no answer to its first picture after {FIRST_S:g} s"
            ) from error
        raise
    finally:
        timer.cancel()
