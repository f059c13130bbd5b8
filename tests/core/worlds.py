"""A small world for tests of the pure Genie: frames of known places, what was seen there, Genies to
tell it to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from genie_sim.core.eviction import Eviction
from genie_sim.core.message_cache import MessageCache
from genie_sim.core.messages import (
    Detection,
    Detections,
    Effect,
    Header,
    Publish,
)
from genie_sim.core.node import GenieNode
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import Capacity, GenieRules, ObjectMapRules
from genie_sim.core.similarity import PoseGrid, Similarity

IMAGES, OBJECTS = "/image_raw", "/objects"


# Where frames are taken, all looking east; each its own cell of the pose grid, out of sight of the
# others.
@dataclass(frozen=True)
class Lanes:
    """An answer that holds no objects, such as a lane detector's."""

    header: Header
    lanes: int
    source: str = "detector"
    served_by: str = ""
    objects: None = None
    size_bytes: int = 100
    look: None = None
    valid_ns: None = None

    def restamped(self, header: Header) -> Lanes:
        return replace(self, header=header)

    def with_objects(self, objects: Sequence[Detection]) -> Lanes:
        raise AssertionError("lanes hold no objects")

    def credited(self, source: str, by: str, header: Header | None = None) -> Lanes:
        return replace(
            self, source=source, served_by=by, header=self.header if header is None else header
        )


def object_map(view_cell_m: float = 50.0, **rules: Any) -> ObjectMap:
    """An empty object map; ``rules`` are those of ``ObjectMapRules``."""
    return ObjectMap(ObjectMapRules(**rules), view_cell_m)


def genie(
    objects: ObjectMap | None = None,
    similarity: Similarity | None = None,
    new_eviction: Callable[[], Eviction] = Eviction,
    capacity: Capacity | None = None,
    published: tuple[str, ...] = (OBJECTS,),
    name: str = "edge1/genie",
    names_changes: bool = True,
    **rules: Any,
) -> GenieNode:
    """A Genie before an object detector; ``rules`` are those of ``GenieRules``."""
    chosen = GenieRules(**rules)
    same = similarity if similarity is not None else PoseGrid()
    return GenieNode(
        name,
        (IMAGES,),
        published,
        chosen,
        key=same.key,
        new_cache=lambda: MessageCache(same.index(), new_eviction(), capacity),
        new_keys=same.index,
        object_map=objects if objects is not None else object_map(),
        make_answer=Detections,
        names_changes=names_changes,
    )


def publications(effects: Iterable[Effect]) -> list[Publish]:
    """What was published, without the facts for the log."""
    return [effect for effect in effects if isinstance(effect, Publish)]


def facts(effects: Iterable[Effect], kind: type) -> list[Any]:
    """The facts of one kind, for the log."""
    return [effect for effect in effects if isinstance(effect, kind)]


def answers(effects: Iterable[Effect], topic: str = OBJECTS) -> list[Any]:
    """The answers published on ``topic``."""
    return [effect.message for effect in publications(effects) if effect.topic == topic]


def labels(message: Any) -> list[str]:
    """The classes of an answer's objects."""
    return [one.label for one in message.objects]
