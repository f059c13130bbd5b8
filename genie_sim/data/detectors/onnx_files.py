"""Reads ONNX networks, with tensors in files beside them. ``onnx.load`` refuses names that lead
elsewhere and more bytes than a file has. A network is also a program: the memory that it may take
has a limit, here and for its first picture.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.parallel import limited_memory

MAX_BYTES = 2**31 - 1  # of a network; ONNX Runtime takes no more from memory
COPIES = 4  # of a network in the memory while it is read

Counts = tuple[int, int]  # of inputs and outputs


def read_network(weights: Path, counts: Sequence[Counts]) -> tuple[Any, str]:
    """The ONNX network in a file, with one picture as its first input, and the sha256 of its file
    and of its tensors in files beside it. Raises UserError for any other file.

    Parameters
    ----------
    weights : the file
    counts : how many inputs and outputs it may have
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
    inputs = [value for value in graph.input if value.name not in constants]
    if (len(inputs), len(graph.output)) not in counts:
        expected = ", or ".join(f"{many} and {outputs}" for many, outputs in counts)
        raise UserError(
            f"{weights}: has {len(inputs)} inputs and {len(graph.output)} outputs, "
            f"expected {expected}"
        )
    dims = inputs[0].type.tensor_type.shape.dim
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
    graph.input.extend(inputs)
    return network, total.hexdigest()
