"""Cameras: they replay what was recorded, at its own stamps."""

from collections.abc import Callable, Sequence
from itertools import count

from genie_sim.core.header import Header
from genie_sim.core.messages import Frame, Image
from genie_sim.sim.bends import Sense
from genie_sim.sim.clock import Steps
from genie_sim.sim.frame_rate import thinned
from genie_sim.sim.method import IMAGES
from genie_sim.sim.ros_graph import Graph, Node
from genie_sim.sim.settings import Camera, Car

POSITION_BYTES = 81  # geometry_msgs/PoseStamped: 16 of header, 9 of frame_id, 7 doubles
Published = Callable[[Image, int, int], None]  # image, running number, lap


class CameraNode(Node):
    """One camera stream of a car: a window of a recording, driven ``laps`` times.

    ``frames`` are those of its recording; ``published`` is called with each before it is
    published, and ``senses`` are what faults make of it, with what drops those that are lost. Two
    streams are two cameras even if one recording stands for both: their images are never byte for
    byte the same. Of a car without cameras, each frame is only its position (Section V-F), which
    its localisation knows.
    """

    def __init__(
        self,
        camera: Camera,
        car: Car,
        graph: Graph,
        *,
        frames: Sequence[Frame],
        published: Published,
        senses: Sequence[tuple[Sense, str]] = (),
    ) -> None:
        super().__init__(f"{car.name}/{camera.name}", graph, subscribes=(), publishes=(IMAGES,))
        self._camera = camera
        self._car = car
        self._route = route = car.route
        self._published = published
        self._senses = senses
        self._frames = frames  # of a map they are computed on the way: a list would hold them all
        begin_ns, end_ns = route.window_of(frames)
        if route.window_ns is not None:
            self._frames = [frame for frame in frames if begin_ns <= frame.stamp_ns < end_ns]
        if camera.rate is not None:
            self._frames = thinned(self._frames, camera.rate)
        self._offset_ns = route.start_ns + camera.phase_ns - begin_ns
        self._lap_ns = end_ns - begin_ns + route.pause_ns

    @property
    def last_stamp_ns(self) -> int:
        """When the last frame is taken."""
        return self._stamp_ns(self._route.laps - 1, self._frames[-1]) if self._frames else 0

    def run(self) -> Steps:
        """The camera's process: takes one frame after the other, at their stamps."""
        clock, numbers = self.clock, count()
        for lap in range(self._route.laps):
            for frame in self._frames:
                stamp_ns = self._stamp_ns(lap, frame)
                yield clock.timeout(stamp_ns - clock.now)
                image = self._image(Header(stamp_ns, self._camera.name, self._car.name), frame)
                clock.begin(image.header)
                self._published(image, next(numbers), lap)
                self._publish(image)

    def _stamp_ns(self, lap: int, frame: Frame) -> int:
        return int(self._offset_ns + lap * self._lap_ns + frame.stamp_ns)

    def _publish(self, image: Image) -> None:
        """Publishes what faults leave of an image."""
        for sense, cause in self._senses:
            seen_image = sense(image)
            if seen_image is None:
                self.drops += 1
                self.graph.dropped(image, f"{self.name}:{cause}")
                return
            image = seen_image
        self.publish(IMAGES, image)

    def _image(self, header: Header, frame: Frame) -> Image:
        if self._car.cameras:
            own_size = self._camera.size_bytes
            size_bytes = frame.size_bytes if own_size is None else own_size
            digest, dhash = f"{header.frame_id}/{frame.digest}", frame.dhash
        else:
            size_bytes = POSITION_BYTES
            digest, dhash = f"{header.frame_id}/", 0
        return Image(
            header,
            size_bytes,
            digest,
            dhash,
            pose=frame.pose,
            horizontal_fov_rad=frame.horizontal_fov_rad,
            content=frame,
        )
