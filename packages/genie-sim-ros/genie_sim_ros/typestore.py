"""The message types that rosbags knows of ROS 1 and ROS 2, and messages of these types. ROS need
not be installed, except for ``class_of``.
"""

import importlib
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_S

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

TIME = "builtin_interfaces/msg/Time"
TF = "tf2_msgs/msg/TFMessage"
_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
_EMPTY = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
_NUMPY = {"byte": "uint8", "char": "uint8", "octet": "uint8"}


@lru_cache
def typestore(ros: int, definition: str = "", name: str = "") -> "Typestore":
    """The message types of ROS 1 or 2, and one more if its ``definition`` is given. Raises
    ValueError for a definition that cannot be read.
    """
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    if TF not in store.fielddefs:
        store.register(get_types_from_msg(_TF_DEFINITION, TF))
    if definition:
        try:
            store.register(get_types_from_msg(definition, name))
        except TypesysError as error:
            raise ValueError(f"{name}: {error}") from error
    return store


def message(store: "Typestore", kind: str, /, **values: Any) -> Any:
    """A message of type ``kind`` (``std_msgs/msg/Header``) with these ``values`` of its fields; all
    other fields are empty.

    A message within it, or within a list of it, may be given by its own fields, as a mapping.
    """
    fields: Any = store.fielddefs[kind][1]
    return store.types[kind](
        **{name: _value(store, node, values.get(name)) for name, node in fields}
    )


def _value(store: "Typestore", node: tuple[Any, Any], value: Any) -> Any:
    """The value of a field of type ``node``, which is empty where ``value`` is ``None``."""
    import numpy as np
    from rosbags.interfaces import Nodetype

    nodetype, detail = node
    if nodetype == Nodetype.NAME:
        if value is None or isinstance(value, Mapping):
            return message(store, detail, **(value or {}))
        return value
    if nodetype == Nodetype.BASE:
        return _EMPTY.get(detail[0], 0) if value is None else value
    element, length = detail
    element_type, element_detail = element
    if value is not None:
        is_message = element_type == Nodetype.NAME
        return [_value(store, element, item) for item in value] if is_message else value
    if element_type == Nodetype.BASE and element_detail[0] != "string":
        kind = _NUMPY.get(element_detail[0], element_detail[0])
        return np.zeros(length if nodetype == Nodetype.ARRAY else 0, kind)
    return []


def time(stamp_ns: int) -> dict[str, int]:
    """A ROS time or duration, for ``message``."""
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    return {"sec": seconds, "nanosec": nanoseconds}


def stamp_ns(header: Any) -> int:
    """The stamp of a message's header [ns]."""
    return int(header.stamp.sec) * NS_PER_S + int(header.stamp.nanosec)


def class_of(name: str) -> Any:
    """The ROS 2 class of ``sensor_msgs/msg/Image`` or the like. Raises UserError if its package is
    not installed.
    """
    package, _, kind = name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except (ImportError, AttributeError) as error:
        raise UserError(f"{name}: no such ROS 2 message is installed ({error})") from error
