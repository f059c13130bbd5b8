"""A detector that serves several pictures at once, as the dynamic batcher of an inference server.

The semantics are those of NVIDIA's Triton [S: docs.nvidia.com, Triton Inference Server, Batchers]:
an idle detector takes as many pictures as wait, at most a full batch. If there are fewer, it may
wait for more, until the oldest has waited for the longest time allowed.
"""

from collections import Counter
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from itertools import islice
from operator import attrgetter

from genie_sim.messages import Message
from genie_sim.monitor import Span, SpanLabel
from genie_sim.sim.nodes import DetectorNode
from genie_sim.sim.ros_graph import Graph
from genie_sim.sim.settings import Serving


@dataclass(slots=True, eq=False)
class Picture:
    """A picture at the detector: the queue that it waits in, and when it arrived."""

    queue: Hashable
    arrived_ns: int
    topic: str
    message: Message
    sender: str
    path: Span | None

    @property
    def stamp_ns(self) -> int:
        return self.message.header.stamp_ns


class BatchingDetectorNode(DetectorNode):
    """A detector of an edge server with the settings ``serving``.

    Parameters
    ----------
    name : str
        Such as ``edge1/detector``.
    graph : Graph
        The graph that it registers with.
    subscribes, publishes : iterable of str
        Its topics.
    serving : Serving
        The size of a batch, how long one waits for it, queues, order and admission.
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
        super().__init__(name, graph, subscribes, publishes)
        self._serving = serving
        self._pictures: list[Picture] = []  # that wait, in the order of their arrival
        self._in_queue: Counter[Hashable] = Counter()  # how many wait in each queue
        self._free_ns = 0.0  # when the batch in service is done, by mean times
        self._timer_set = False
        self._accelerator_queueing = SpanLabel("queueing", self.host.accelerator.name)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """A picture joins its queue, where the oldest makes room if it is full, or is refused."""
        header = message.header
        per_camera = self._serving.queue == "per_camera"
        queue = (topic, header.origin, header.frame_id) if per_camera else topic
        now_ns = self.clock.now
        picture = Picture(
            queue=queue,
            arrived_ns=now_ns,
            topic=topic,
            message=message,
            sender=sender,
            path=self.clock.path,
        )
        oldest = None
        if self._in_queue[queue] >= self.graph.queue_length:
            oldest = next(waiting for waiting in self._pictures if waiting.queue == queue)
        if not self._is_admitted(picture, oldest):
            self._lose(picture, f"{self.name}:late")
            return
        if oldest is not None:
            self._take_out(oldest)
            self._lose(oldest, f"{self.name}:{topic}")
        self._pictures.append(picture)
        self._in_queue[queue] += 1
        self.queued += 1
        self._begin()

    def void(self, where: str) -> None:
        for picture in self._pictures:
            self._lose(picture, where)
        self._pictures.clear()
        self._in_queue.clear()
        self._free_ns = 0.0
        super().void(where)

    def _is_admitted(self, picture: Picture, replaced: Picture | None) -> bool:
        """Whether the detection of a picture would end in time, by mean times. ``replaced`` leaves
        the queue for it.
        """
        serving = self._serving
        if serving.admit is None:
            return True
        ahead = len(self._pictures) - (replaced is not None)
        if serving.order == "edf":
            stamp_ns = picture.stamp_ns
            ahead = sum(
                waiting is not replaced and waiting.stamp_ns <= stamp_ns
                for waiting in self._pictures
            )
        batches, beside = divmod(ahead, serving.batch)
        end_ns = max(self.clock.now, self._free_ns)
        if self._idle_threads and beside + 1 < serving.batch:
            oldest_ns = self._pictures[0].arrived_ns if self._pictures else self.clock.now
            end_ns = max(end_ns, oldest_ns + serving.wait_ns)
        end_ns += batches * self.host.mean_batch_ns(serving.batch)
        end_ns += self.host.mean_batch_ns(beside + 1)
        return end_ns <= picture.stamp_ns + serving.admit.deadline_ns

    def _lose(self, picture: Picture, where: str) -> None:
        self.drops += 1
        self.graph.dropped(picture.message, where)

    def _take_out(self, picture: Picture) -> None:
        self._pictures.remove(picture)
        self._in_queue[picture.queue] -= 1
        self.queued -= 1

    def _begin(self) -> None:
        """An idle detector takes a batch, or waits for more pictures."""
        if not self._idle_threads or not self._pictures:
            return
        serving, now_ns = self._serving, self.clock.now
        begin_ns = self._pictures[0].arrived_ns + serving.wait_ns
        if len(self._pictures) < serving.batch and now_ns < begin_ns:
            if not self._timer_set:
                self._timer_set = True
                self.clock.after(begin_ns - now_ns, self._on_timer)
            return
        waiting: Iterable[Picture] = self._pictures
        if serving.order == "edf":
            waiting = sorted(waiting, key=attrgetter("stamp_ns"))
        self._serve_batch(list(islice(waiting, serving.batch)))

    def _on_timer(self) -> None:
        self._timer_set = False
        self._begin()

    def _serve_batch(self, batch: list[Picture]) -> None:
        clock, host = self.clock, self.host
        own_path = clock.path
        for picture in batch:
            self._take_out(picture)
            self._in_service.append(picture.message)
            clock.waited(picture.path, self._queueing)
            picture.path = clock.path
        self._idle_threads -= 1
        service_ns = host.batch_ns(len(batch))
        self._free_ns = clock.now + host.mean_batch_ns(len(batch))
        clock.path = batch[0].path
        arguments = (batch, self._generation)
        host.accelerator.run(
            service_ns, self._batch_served, arguments, self.work_label, pictures=len(batch)
        )
        clock.path = own_path

    def _batch_served(self, batch: list[Picture], generation: int) -> None:
        """The batch is done: its answers leave, in its order, and the next one begins."""
        if generation != self._generation:
            return
        clock = self.clock
        first = clock.path
        begin_ns = self._begin_of_service(first)
        for place, picture in enumerate(batch):
            path = picture.path
            if place and path is not None and path.end_ns < begin_ns:
                label = self._accelerator_queueing
                path = Span(label, begin_ns, before=path, header=path.header)
            clock.waited(path if place else first, self.work_label)
            self._in_service.remove(picture.message)
            self.completed += 1
            self.handle(picture.topic, picture.message, picture.sender)
        self._idle_threads += 1
        self._begin()

    def _begin_of_service(self, path: Span | None) -> int:
        """When the batch was begun whose first picture has this path, which ends now. A fault may
        have held it up, or made it slower.
        """
        while path is not None and path.label == self.work_label:
            path = path.before
        return self.clock.now if path is None else path.end_ns
