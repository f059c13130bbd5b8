"""Cameras: they replay what was recorded, at its own stamps."""

from collections.abc import Callable, Sequence

from genie_sim.messages import Frame, Header, Image
from genie_sim.sim.ros_graph import Graph, Node
from genie_sim.sim.setup import CameraSetup, CarSetup

POSITION_BYTES = 81  # geometry_msgs/PoseStamped: 16 of header, 9 of frame_id, 7 doubles
Published = Callable[[Image, int, int], None]


class Camera(Node):
    """One camera stream of a car: a window of a recording, driven ``laps`` times.

    ``published`` is told of each frame (image, running number, lap) before it is published. Two streams are two
    cameras even where one recording stands for both: their images are never byte for byte the same. Of a car that does
    not see, each frame is only its position (Section V-F), which is what its localisation knows.
    """

    def __init__(
        self, camera: CameraSetup, car: CarSetup, graph: Graph, topic: str, published: Published
    ) -> None:
        super().__init__(f"{car.name}/{camera.name}", graph, subscribes=(), publishes=(topic,))
        frames, window_ns = camera.frames, car.window_ns
        self._camera = camera
        self._car = car
        self._topic = topic
        begin_ns, end_ns = (
            window_ns if window_ns is not None else (frames[0].stamp_ns, frames[-1].stamp_ns + 1)
        )
        self._first_ns = car.start_ns + camera.phase_ns - begin_ns
        inside = (
            frames
            if window_ns is None
            else [frame for frame in frames if begin_ns <= frame.stamp_ns < end_ns]
        )
        self._frames: Sequence[Frame] = inside
        self._lap_ns = end_ns - begin_ns + car.pause_ns
        self._published = published
        laps = (
            (self._stamp_ns(lap, frame), lap, frame) for lap in range(car.laps) for frame in inside
        )
        self._coming = enumerate(laps)

    @property
    def last_stamp_ns(self) -> int:
        """When the last frame is taken."""
        return self._stamp_ns(self._car.laps - 1, self._frames[-1]) if self._frames else 0

    def _stamp_ns(self, lap: int, frame: Frame) -> int:
        return int(self._first_ns + lap * self._lap_ns + frame.stamp_ns)

    def wait(self) -> None:
        """For the next frame."""
        coming = next(self._coming, None)
        if coming is not None:
            number, (stamp_ns, lap, frame) = coming
            self.env.after(stamp_ns - self.env.now, self._take, number, lap, stamp_ns, frame)

    def _take(self, number: int, lap: int, stamp_ns: int, frame: Frame) -> None:
        image = self._image(Header(stamp_ns, self._camera.name, self._car.name), frame)
        self.env.begin(image.header)
        self._published(image, number, lap)
        self.publish(self._topic, image)
        self.env.way = None  # what is done next, by whomever, is not about this frame
        self.wait()

    def _image(self, header: Header, frame: Frame) -> Image:
        if not self._car.sees:
            unseen = f"{header.frame_id}/"
            return Image(
                header, POSITION_BYTES, unseen, 0, frame.pose, frame.horizontal_fov_rad, frame
            )
        recorded, size_bytes = f"{header.frame_id}/{frame.digest}", self._camera.size_bytes
        size_bytes = frame.size_bytes if size_bytes is None else size_bytes
        return Image(
            header, size_bytes, recorded, frame.dhash, frame.pose, frame.horizontal_fov_rad, frame
        )
