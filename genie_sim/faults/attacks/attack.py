"""Attacks: cars or edge servers that tell others what is not so.

Threats enter at two places: a car sends pictures and poses, never objects; an edge sends answers,
looks and tracks. An attack is a bend at the border of the attacker, so every method meets it, and
it notes what it forged, so that what others hold can be traced to it.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

from genie_sim.base.settings import Share
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image, Look, Message
from genie_sim.faults.targets import unknown_targets
from genie_sim.sim.bends import Bend, Objects, bent
from genie_sim.sim.fault import AffectedNetwork, TimedFault


class AttackedScene(NamedTuple):
    """What a message with objects is about.

    Parameters
    ----------
    header : Header
        The frame.
    pose : CameraPose
        Where its camera stood.
    horizontal_fov_rad : float
        What the camera sees.
    source : str
        ``picture``: what a detector will find; ``look``: what it found; else that of the answer.
    attacker : str
        Who sends the message.
    now_ns : int
        The time [ns].
    """

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float
    source: str
    attacker: str
    now_ns: int


Forge = Callable[..., Objects]  # the objects of a picture, and by what they are replaced, if known


@dataclass(kw_only=True)
class Attack:
    """The base of all attacks: ``forge`` says what becomes of the objects of a message.

    A class of your own may have more settings, and ``start`` to draw what it needs.
    """

    target: str | tuple[str, ...] = ()
    """The attackers: a car, an edge, or several."""

    share: Share | None = None
    """Instead of `target`, the share of all cars that attack. They are drawn; a larger share has
    those of a smaller one and more."""

    applied: bool = True
    """`false`: what would be forged is recorded, and nothing is changed. Metrics of attacks then
    have their values without an attack."""

    duration_ns = None  # for good, if nothing says when it ends
    _bends: dict[str, Bend] = field(default_factory=dict, init=False, repr=False, compare=False)
    _scenes: dict[tuple[str, str], AttackedScene] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def dropped_by(self) -> str:
        return type(self).__name__.lower()  # it drops nothing

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        """The objects of a message as the attacker tells them."""
        raise NotImplementedError

    def start(self, network: AffectedNetwork, attacker: str) -> None:
        """Called for every attacker when the attack begins."""

    def drawn_targets(self, network: AffectedNetwork) -> Sequence[str]:
        """The attackers."""
        if self.share is None:
            return (self.target,) if isinstance(self.target, str) else self.target
        cars = network.cars
        if network.forgeries.order is None:
            network.forgeries.order = network.stream("attackers").permutation(len(cars)).tolist()
        order = network.forgeries.order
        return [cars[i] for i in sorted(order[: round(self.share * len(cars))])]

    def begin(self, network: AffectedNetwork) -> None:
        self._scenes.clear()
        for attacker in self.drawn_targets(network):
            self.start(network, attacker)
            inward = partial(self._overhear, attacker)
            outward = partial(self._tell, network, attacker)
            self._bends[attacker] = Bend(inward, outward, self.dropped_by)
            network.bend(attacker, self._bends[attacker])

    def end(self, network: AffectedNetwork) -> None:
        for attacker, bend in self._bends.items():
            network.unbend(attacker, bend)
        self._bends.clear()

    def _overhear(self, attacker: str, message: Message, other: str) -> Message:
        """An edge learns from their pictures where its cars are."""
        if isinstance(message, Image):
            _, frame_id, origin = message.header
            self._scenes[origin, frame_id] = _scene_of(message, attacker, message.header.stamp_ns)
        return message

    def _tell(
        self, network: AffectedNetwork, attacker: str, message: Message, other: str
    ) -> Message:
        """What leaves the attacker's host."""
        now_ns = network.clock.now
        if isinstance(message, Image):
            scene = _scene_of(message, attacker, now_ns)
            picture = self.forge_picture(message, partial(self._noted, network, scene, other))
            looks = tuple(self._tell_look(network, attacker, look, other) for look in message.looks)
            return replace(picture, looks=looks)
        if isinstance(message, Detections):
            return self._tell_objects(network, attacker, message, other)
        return message

    def forge_picture(self, image: Image, forge: Forge) -> Image:
        """A picture in which detectors find what ``forge`` makes of its objects."""
        return replace(image, content=bent(image.content, forge))

    def _tell_objects(
        self, network: AffectedNetwork, attacker: str, answer: Detections, other: str
    ) -> Detections:
        """An answer, a look or a list of tracks."""
        header, look, now_ns = answer.header, answer.look, network.clock.now
        scene = self._scenes.get((header.origin, header.frame_id))
        if look is not None:
            scene = _scene_of(look, attacker, now_ns)
            look = self._tell_look(network, attacker, look, other)
        if scene is None:  # nobody knows where this car is
            return answer
        scene = scene._replace(header=header, source=answer.source, now_ns=now_ns)
        objects = answer.objects
        if look is None or objects:  # a look that travels alone has no objects beside it
            true = set(objects)
            objects = tuple(
                item if item in true else _unsigned(item)
                for item in self._noted(network, scene, other, objects)
            )
        return replace(answer, objects=objects, look=look)

    def _tell_look(self, network: AffectedNetwork, attacker: str, look: Look, other: str) -> Look:
        """A look as it is told. Only its own car can sign one that is forged."""
        scene = _scene_of(look, attacker, network.clock.now)
        detections = self._noted(network, scene, other, look.detections)
        signed = look.signed and (look.header.origin == attacker or detections == look.detections)
        return look._replace(detections=detections, signed=signed)

    def _noted(
        self,
        network: AffectedNetwork,
        scene: AttackedScene,
        receiver: str,
        objects: Objects,
        forged: Objects | None = None,
    ) -> Objects:
        """The forged objects, which are noted.

        Parameters
        ----------
        network : AffectedNetwork
            Has the clock, and gets what is forged.
        scene : AttackedScene
            What the message is about.
        receiver : str
            The host that it goes to.
        objects : tuple of Detection
            What it should tell.
        forged : tuple of Detection, optional
            What it tells; by default what ``forge`` makes of the objects.
        """
        if forged is None:
            forged = self.forge(objects, scene)
        network.forgeries.note(
            self.dropped_by,
            attacker=scene.attacker,
            receiver=receiver,
            before=objects,
            after=forged,
            now_ns=network.clock.now,
        )
        return forged if self.applied else objects

    @staticmethod
    def check(
        faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Yields each problem of the scenario's attacks of this kind."""
        hosts = [*edge_of, *edges]
        for index, timed in enumerate(faults):
            attack = timed.fault
            assert isinstance(attack, Attack)
            is_targeted = isinstance(attack.target, str) or len(attack.target) > 0
            yield from unknown_targets(index, attack.target, "car or edge", hosts)
            if attack.share is not None and is_targeted:
                yield index, "share", "has no effect beside 'target'"
            if attack.share is None and not is_targeted:
                yield index, "target", "missing; or give 'share', of all cars"


def with_score(item: Detection, score: float) -> Detection:
    """An object that its sender is as sure of as the score says."""
    motion = item.motion
    if motion is not None:
        motion = motion._replace(existence=score)
    return replace(item, score=score, confidence=score, motion=motion)


def _unsigned(item: Detection) -> Detection:
    """A forged track: nobody's signatures hold for it."""
    motion = item.motion
    return item if motion is None else replace(item, motion=motion._replace(signed=False))


def _scene_of(about: Look | Image, attacker: str, now_ns: int) -> AttackedScene:
    """What a look or a picture shows."""
    return AttackedScene(
        header=about.header,
        pose=about.pose,
        horizontal_fov_rad=about.horizontal_fov_rad,
        source="look" if isinstance(about, Look) else "picture",
        attacker=attacker,
        now_ns=now_ns,
    )
