"""A detector that serves several pictures at once, as the dynamic batcher of an inference server.

The semantics are those of NVIDIA's Triton [S: docs.nvidia.com, Triton Inference Server, Batchers]:
an idle detector takes as many pictures as wait, at most a full batch. If there are fewer, it may
wait for more, until the oldest has waited for the longest time allowed.
"""

from collections.abc import Hashable, Iterable

import simpy

from genie_sim.core.messages import Message
from genie_sim.sim.clock import Steps
from genie_sim.sim.monitor import Span, SpanLabel
from genie_sim.sim.nodes import DetectorNode
from genie_sim.sim.ros_graph import Graph, Waiting, camera_flow
from genie_sim.sim.settings import Serving


class BatchingDetectorNode(DetectorNode):
    """A detector of an edge server with the settings ``serving``.

    Parameters
    ----------
    name : str
        Such as ``edge1/vision_darknet_detect``.
    graph : Graph
        The graph that it registers with.
    subscribes, publishes : iterable of str
        Its topics.
    serving : Serving
        The size of a batch, how long one waits for it, and the queues.
    """

    def __init__(
        self,
        name: str,
        graph: Graph,
        subscribes: Iterable[str],
        publishes: Iterable[str],
        *,
        serving: Serving,
    ) -> None:
        self._serving = serving
        self._arrived = graph.clock.event()  # happens when the next picture joins the queue
        super().__init__(name, graph, subscribes, publishes)
        self._accelerator_queueing = SpanLabel("queueing", self.host.accelerator.name)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        super().deliver(topic, message, sender)
        if not self._arrived.triggered:
            self._arrived.succeed()

    def flow(self, topic: str, message: Message) -> Hashable:
        """Pictures wait by camera where ``serving`` says so, else all together."""
        return camera_flow(topic, message) if self._serving.queue == "per_camera" else topic

    def _thread(self) -> Steps:
        """The detector's process: it gathers a batch, runs it, and sends its answers."""
        while True:
            yield from self._gather()
            batch = self._take_batch()
            try:
                yield from self._run(batch)
            except simpy.Interrupt:  # a crash
                continue
            self._answer(batch)

    def _gather(self) -> Steps:
        """Waits until there is a full batch, or the oldest picture has waited for as long as it
        may.
        """
        clock, serving, pictures = self.clock, self._serving, self._waiting.items
        while True:
            self._arrived = clock.event()
            if not pictures:
                yield self._arrived
                continue
            left_ns = pictures[0].arrived_ns + serving.wait_ns - clock.now
            if len(pictures) >= serving.batch or left_ns <= 0:
                return
            yield clock.timeout(left_ns) | self._arrived

    def _take_batch(self) -> list[Waiting]:
        """The oldest pictures wait no more; the path of each goes on."""
        batch = []
        for picture in self._waiting.items[: self._serving.batch]:
            self._waiting.take(picture)
            self.clock.waited(picture.path, self._queueing)
            batch.append(picture._replace(path=self.clock.path))
        return batch

    def _run(self, batch: list[Waiting]) -> Steps:
        clock, host = self.clock, self.host
        self._working[clock.active_process] = tuple(picture.message for picture in batch)
        service_ns = host.detection_ns(batch[0].message.header, len(batch))
        clock.path = batch[0].path
        yield from host.accelerator.serve(service_ns, self.work_label, pictures=len(batch))

    def _answer(self, batch: list[Waiting]) -> None:
        """The batch is done: its answers leave, in its order."""
        clock = self.clock
        del self._working[clock.active_process]
        first = clock.path
        begin_ns = self._begin_of_service(first)
        for number, picture in enumerate(batch):
            path = picture.path
            if number and path is not None and path.end_ns < begin_ns:
                label = self._accelerator_queueing
                path = Span(label, begin_ns, before=path, header=path.header)
            clock.waited(path if number else first, self.work_label)
            self.completed += 1
            self.handle(picture.topic, picture.message, picture.sender)

    def _begin_of_service(self, path: Span | None) -> int:
        """When the batch was begun whose first picture has this path, which ends now. A fault may
        have held it up, or made it slower.
        """
        while path is not None and path.label == self.work_label:
            path = path.before
        return self.clock.now if path is None else path.end_ns
