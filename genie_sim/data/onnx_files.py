"""Reads ONNX networks, with tensors in files beside them. Files are data: a name that leads
elsewhere, or more bytes than a file has, is refused before anything is read. A network is also a
program: the memory that it may take for its first picture has a limit.
"""

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from genie_sim.base.errors import UserError, as_user_error, short_repr

MAX_BYTES = 2**31 - 1  # of a network; ONNX Runtime takes no more from memory
EXTERNAL = 1  # onnx.TensorProto.EXTERNAL


class _TensorPlace(NamedTuple):
    """The file of a tensor, where it begins, and how many bytes it has."""

    path: Path
    begin: int
    length: int


Counts = tuple[int, int]  # of inputs and outputs


def read_network(
    weights: Path, counts: Sequence[Counts], *, more_outputs: bool = False
) -> tuple[Any, str]:
    """The ONNX network in a file, with one picture as its first input, and the sha256 of its file
    and of the files beside it that hold its tensors. Raises UserError for any other file.

    Parameters
    ----------
    weights : the file
    counts : how many inputs and outputs it may have
    more_outputs : whether others may follow those of the first of ``counts``; they are cut off
    """
    import onnx

    with as_user_error(f"{weights}: not an ONNX network", Exception):
        network = onnx.load(str(weights), load_external_data=False)
        total = hashlib.sha256(weights.read_bytes())
    beside = [(tensor, _place(weights, tensor)) for tensor in _external(network)]
    if sum(place.length for _, place in beside) > MAX_BYTES:
        raise UserError(f"{weights}: has more than {MAX_BYTES:,} bytes of tensors")
    for path in sorted({place.path for _, place in beside}):
        with as_user_error(f"{path}: cannot be read", OSError), path.open("rb") as file:
            total.update(hashlib.file_digest(file, "sha256").digest())
    for tensor, place in beside:
        with as_user_error(f"{place.path}: cannot be read", OSError), place.path.open("rb") as file:
            file.seek(place.begin)
            tensor.raw_data = file.read(place.length)
        del tensor.external_data[:]
        tensor.data_location = onnx.TensorProto.DEFAULT
    with as_user_error(f"{weights}: not an ONNX network", Exception):
        onnx.checker.check_model(network)
    graph = network.graph
    constants = {tensor.name for tensor in graph.initializer}
    inputs = [value for value in graph.input if value.name not in constants]
    if more_outputs:
        del graph.output[counts[0][1] :]
    if (len(inputs), len(graph.output)) not in counts:
        expected = ", or ".join(f"{many} and {outputs}" for many, outputs in counts)
        raise UserError(
            f"{weights}: has {len(inputs)} inputs and {len(graph.output)} outputs, "
            f"expected {expected}"
        )
    if len(inputs[0].type.tensor_type.shape.dim) != 4:
        count = len(inputs[0].type.tensor_type.shape.dim)
        raise UserError(f"{weights}: its input has {count} dimensions, expected 4 (a picture)")
    # Initializers listed as inputs cannot be folded, and recorded shapes are those of the exported
    # size.
    del graph.input[:], graph.value_info[:]
    graph.input.extend(inputs)
    return network, total.hexdigest()


def _external(network: Any) -> Iterator[Any]:
    """The tensors that are kept in other files, of the graph and of the graphs within it."""
    graphs = [network.graph, *network.functions]
    while graphs:
        graph = graphs.pop()
        tensors = list(getattr(graph, "initializer", ()))
        for node in graph.node:
            for attribute in node.attribute:
                tensors += [attribute.t, *attribute.tensors]
                graphs += [*([attribute.g] if attribute.HasField("g") else []), *attribute.graphs]
        yield from (tensor for tensor in tensors if tensor.data_location == EXTERNAL)


def _place(weights: Path, tensor: Any) -> _TensorPlace:
    """Where a tensor is. Raises UserError."""
    about = {entry.key: entry.value for entry in tensor.external_data}
    name = about.get("location", "")
    path = weights.parent / name
    what = f"{weights}: tensor {short_repr(tensor.name)}"
    if not name or Path(name).name != name or path.is_symlink():
        raise UserError(f"{what}: its file {short_repr(name)} must lie beside the network")
    if not path.is_file():
        raise UserError(f"{what}: is kept in {path}, which is not there: copy it, too")
    size = path.stat().st_size
    with as_user_error(f"{what}: no place in {name}", ValueError):
        begin = int(about.get("offset", "0"))
        length = int(about.get("length", str(size - begin)))
    if begin < 0 or not 0 <= length <= MAX_BYTES or begin + length > size:
        raise UserError(f"{what}: {length:,} bytes from {begin:,} on are not in {path} ({size:,})")
    return _TensorPlace(path, begin, length)
