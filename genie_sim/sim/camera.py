"""Cameras: they replay what was recorded, at its own stamps."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from genie_sim.messages import Header, Image
from genie_sim.perception.trace import TraceFrame
from genie_sim.sim.clock import Process
from genie_sim.sim.device import Host
from genie_sim.sim.ros_graph import Graph, Node


class Camera(Node):
    """One camera stream of a car: a window of a recording, driven ``laps`` times.

    ``start_ns`` is when the first lap begins, ``window_ns`` the part of the recording's own time (``None``: all of
    it), ``pause_ns`` the time between two laps. ``published`` is told of each frame (image, running number, lap)
    before it is published. Two streams are two cameras even where one recording stands for both: their images are
    never byte for byte the same.
    """

    def __init__(
        self,
        name: str,
        host: Host,
        graph: Graph,
        topic: str,
        car: str,
        frames: Sequence[TraceFrame],
        window_ns: tuple[int, int] | None,
        start_ns: int,
        laps: int,
        pause_ns: int,
        size_bytes: int | None,
        published: Callable[[Image, int, int], None],
    ) -> None:
        super().__init__(f"{car}/{name}", host, graph, subscribes=(), publishes=(topic,))
        self._frame_id = name
        self._topic = topic
        self._car = car
        begin_ns, end_ns = window_ns if window_ns is not None else (frames[0].stamp_ns, frames[-1].stamp_ns + 1)
        self._begin_ns = begin_ns
        inside = frames if window_ns is None else [frame for frame in frames if begin_ns <= frame.stamp_ns < end_ns]
        self._frames: Sequence[TraceFrame] = inside
        self._start_ns = start_ns
        self._laps = laps
        self._lap_ns = end_ns - begin_ns + pause_ns
        self._size_bytes = size_bytes
        self._published = published
        self.env.process(self._replay())

    @property
    def last_stamp_ns(self) -> int:
        """When the last frame is taken."""
        return self._stamp_ns(self._laps - 1, self._frames[-1]) if self._frames else 0

    def _stamp_ns(self, lap: int, frame: TraceFrame) -> int:
        return self._start_ns + lap * self._lap_ns + frame.stamp_ns - self._begin_ns

    def _replay(self) -> Process:
        number = 0
        for lap in range(self._laps):
            for frame in self._frames:
                stamp_ns = self._stamp_ns(lap, frame)
                yield self.env.timeout(stamp_ns - self.env.now)
                image = Image(
                    Header(stamp_ns, self._frame_id, self._car),
                    self._size_bytes if self._size_bytes is not None else frame.size_bytes,
                    f"{self._frame_id}/{frame.digest}",
                    frame.dhash,
                    frame.pose,
                    frame.horizontal_fov_rad,
                    frame,
                )
                self._published(image, number, lap)
                self.publish(self._topic, image)
                number += 1
