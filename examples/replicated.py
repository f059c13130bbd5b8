"""Each frame goes up several uplinks to as many edges, and the first answer counts.

After FogROS2-FT (K. Chen, K. Hari, T. Chung et al., IROS 2024, arXiv:2412.05408), which sends each
request to replicas of a stateless service on several clouds, and FogROS2-PLR (K. Chen, N. Tian,
C. Juette et al., 2024, arXiv:2410.05562), which sends it over several network interfaces. Both
return the first answer and drop the later ones. FT cuts the 99th percentile of the latency of
object detection by 2.0 under slow networks and contended servers, PLR by up to 3.7 beside one 5G
provider.

What differs: PLR chooses interfaces and servers so that the fewest deadlines are missed; here the
scenario names them. Nobody cancels the other copies.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from genie_sim.extend import (
    LINK,
    LOWER,
    REMOTE,
    REMOTE_UPLINK,
    Choice,
    Costs,
    Effect,
    Header,
    HostConfig,
    HostContext,
    Interceptor,
    Message,
    Method,
    Metric,
    Network,
    Publish,
    response_ms,
    share_of,
)

DEADLINE_MS = 200.0
REMEMBERED = 100  # answered frames of which later copies are known


@dataclass(frozen=True)
class FurtherUplink:
    """A link of every car to an edge besides its own."""

    edge: str
    """The edge."""

    link: Annotated[Choice, LINK]
    """The link to it, with the settings of `edge_network`."""


class Replicated(Method):
    """Every frame goes to several edges; the consumer gets the first answer."""

    title = "replicated"

    def __init__(self, further: tuple[FurtherUplink, ...] = ()) -> None:
        """``further``: links to further edges, over which each frame goes, too."""
        self._further = further

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        if not host.has_edge:
            return HostConfig()
        return HostConfig(
            interceptor=partial(FirstAnswer, f"{host.name}/replicator"),
            uplink=REMOTE_UPLINK,
            costs=Costs(is_free=True),
        )

    def wire(self, network: Network) -> None:
        for further in self._further:
            model = LINK.make(further.link)
            for car, connection in network.connections.items():
                upwards, _ = connection.make_bridges(
                    further.edge, model, network.add_interface(car)
                )
                connection.also_send_over(upwards)


class FirstAnswer(Interceptor):
    """Sends every frame up, and passes the first answer to each on."""

    def __init__(self, name: str, subscribed: tuple[str, ...], published: tuple[str, ...]) -> None:
        self.name = name
        (self._images,) = subscribed
        (self._objects,) = published
        self._answered: dict[Header, None] = {}  # the newest last

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + REMOTE

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + REMOTE

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic == self._images:
            return [Publish(self._images + REMOTE, message)]
        if message.header in self._answered:
            return []
        self._answered[message.header] = None
        if len(self._answered) > REMEMBERED:
            del self._answered[next(iter(self._answered))]
        return [Publish(self._objects, message)]


missed_deadline = Metric(
    "deadline missed",
    "%",
    LOWER,
    meaning="Share of all published frames without an answer within 200 ms: what PLR makes small.",
    formula=lambda frames: share_of(frames, ~(response_ms(frames, "first") <= DEADLINE_MS)),
)
