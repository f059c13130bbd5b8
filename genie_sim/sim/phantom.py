"""Vision-assisted driving (Section V-F): phantom Genies for a car that has neither cameras nor a detector.

The car knows where it is. Its local phantom Genie takes requests that hold a position instead of a picture, answers
what is in its cache, and asks the remote phantom on the edge for the rest. That one answers with the confident objects
in view of its map, which the other cars' edges fill, and with what their caches hold for the same spot. Both follow
Algorithm 1 as every Genie does; they only have nothing encapsulated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from genie_sim.core.genies import make_genie
from genie_sim.messages import Fact
from genie_sim.perception.trace import TraceFrame
from genie_sim.recording.log import Log
from genie_sim.scenario.genie_settings import GenieSettings
from genie_sim.sim.device import Host
from genie_sim.sim.nodes import Genie
from genie_sim.sim.ros_graph import Graph

POSITION_BYTES = 81  # geometry_msgs/PoseStamped: 16 of header, 9 of frame_id, 7 doubles

# The remote phantom has no detector that could answer later: it gives what its map holds at once. The local one waits
# for it, because its own map holds no more than what the remote one has sent before.
MISS_POLICY = {"local": "blocking", "remote": "immediate"}

Place = tuple[Graph, Host, str]  # a master, the host it runs on, and the role of a Genie there


class Coordinator:
    """The coordinator server: finds places where nothing detects objects and assigns each a phantom Genie."""

    def __init__(self, settings: GenieSettings, queue_length: int, log: Log) -> None:
        self._settings = settings
        self._queue_length = queue_length
        self._log = log

    def assign(self, images: str, objects: str, *places: Place) -> Iterator[Genie]:
        """Starts a phantom Genie with the detector's topics wherever the master knows no publisher of ``objects``."""
        for graph, host, role in places:
            if not graph.has_publisher(objects):
                yield self._phantom(graph, host, role, images, objects)

    def _phantom(self, graph: Graph, host: Host, role: str, images: str, objects: str) -> Genie:
        node = make_genie(
            self._settings,
            f"{graph.name}/genie",
            (images,),
            (objects,),
            on_edge=role == "remote",
            miss_policy=MISS_POLICY[role],
            tells_changes=self._log.wants_changes,
        )

        def observe(genie: Genie, record: Fact) -> None:
            self._log.observe(genie.name, record, "edge" if role == "remote" else "car", graph.env.now)

        return Genie(node, host, graph, self._queue_length, observe, self._log.dropped)


def positions(frames: Sequence[TraceFrame]) -> tuple[TraceFrame, ...]:
    """A drive as the car's localisation knows it: where each view is and when, without what it shows."""
    return tuple(replace(frame, digest="", dhash=0, detections=()) for frame in frames)
