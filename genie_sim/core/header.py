"""The header of a message, by which everything that belongs to a frame is found."""

from typing import NamedTuple


class Header(NamedTuple):
    """Who took a picture, with which camera, when.

    Parameters
    ----------
    stamp_ns : int
        When the camera took it, in nanoseconds since the beginning of the simulation (in real ROS,
        since the epoch).
    frame_id : str
        The camera stream, such as ``camera_02``.
    origin : str
        The car. It is part of a request's identity because cars that replay the same drive can
        share stamps.
    """

    stamp_ns: int
    frame_id: str
    origin: str
