"""Replay: an attacker tells what was true a while ago, under new stamps."""

from collections import defaultdict, deque
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any

from genie_sim.base.settings import Bounds
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Detection, Header, Image
from genie_sim.faults.attacks.attack import Attack, AttackedScene, Forge
from genie_sim.sim.bends import Objects, bent
from genie_sim.sim.fault import AffectedNetwork


@dataclass(kw_only=True)
class Replay(Attack):
    """What an attacker recorded is sent again, with the stamps of now; a car sends the old pose,
    too. It begins as soon as there is something so old.
    """

    delay_ns: Annotated[int, Bounds(above=0)] = 2 * NS_PER_S
    """How old it is."""

    _recorded: defaultdict[tuple[str, ...], deque[tuple[int, Any]]] = field(
        default_factory=lambda: defaultdict(deque), init=False, repr=False, compare=False
    )

    def start(self, network: AffectedNetwork, attacker: str) -> None:
        for key in [key for key in self._recorded if key[0] == attacker]:
            del self._recorded[key]

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        _, frame_id, car = scene.header
        key = scene.attacker, scene.source, car, frame_id
        recorded: Objects = self._old(key, scene.now_ns, objects)
        return tuple(_seen_now(item, scene.now_ns) for item in recorded)

    def forge_picture(self, image: Image, forge: Forge) -> Image:
        stamp_ns, frame_id, car = image.header
        recorded: Image = self._old((car, "picture", frame_id), stamp_ns, image)
        if recorded is image:
            return image
        forge = partial(forge, forged=recorded.content.detections)
        pose = recorded.pose if self.applied else image.pose
        return replace(image, pose=pose, content=bent(image.content, forge))

    def _old(self, key: tuple[str, ...], now_ns: int, latest: Any) -> Any:
        """The newest that is old enough; until there is one, the latest."""
        recorded = self._recorded[key]
        recorded.append((now_ns, latest))
        while len(recorded) > 1 and recorded[1][0] <= now_ns - self.delay_ns:
            recorded.popleft()
        time_ns, old = recorded[0]
        return old if time_ns <= now_ns - self.delay_ns else latest


def _seen_now(item: Detection, now_ns: int) -> Detection:
    """A track that was seen a while ago, as if it were seen now."""
    if item.motion is None:
        return item
    _, frame_id, car = item.motion.seen
    return replace(item, motion=item.motion._replace(seen=Header(now_ns, frame_id, car)))
