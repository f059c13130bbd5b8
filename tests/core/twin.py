"""A second Genie, as simple and as slow as can be: Algorithms 1 and 2 under the default readings of
the paper.

It was written from the readings, not from ``genie_sim.core``: lists instead of indices, every
object looked at. What it does is told in plain words, so that both can be compared:

    ("asks node", header)  ("asks others", header)  ("expires", header)
    ("looks up", header, outcome, who asked)
    ("tells clients" | "tells others" | "tells" neighbour, header, source, served by, objects)
    ("sights", requests, hits, updates, boost)  ("boosts", requests, hits)
"""

from __future__ import annotations

import math
from typing import Any

from genie_sim.core.messages import (
    Detection,
    Detections,
    Effect,
    Expired,
    Header,
    Image,
    ImageLookup,
    Publish,
)
from tests.core.worlds import IMAGES, OBJECTS
from tests.make import S

C_T, RATE, GATE_M, VIEW_M, EXPIRY_NS = 0.60, 0.1, 1.0, 50.0, 2 * S
Deed = tuple[Any, ...]


class Twin:
    """The Genie of an edge, under the default readings."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.cache: dict[Any, Detections] = {}  # picture -> answer
        self.waiting: list[dict[str, Any]] = []  # requests that have not expired
        self.map: list[dict[str, Any]] = []  # objects

    def hears(
        self, now_ns: int, topic: str, message: Image | Detections, sender: str
    ) -> list[Deed]:
        deeds = self.forgets(now_ns)
        if isinstance(message, Image):
            requester = "client" if topic == IMAGES else sender
            return deeds + self.is_asked(now_ns, message, requester)
        return deeds + self.is_told(message, own=topic == f"{OBJECTS}-local")

    def forgets(self, now_ns: int) -> list[Deed]:
        """A request that the detector dropped expires, and everyone of ours who waited for it
        knows.
        """
        late = [one for one in self.waiting if now_ns >= one["since_ns"] + EXPIRY_NS]
        self.waiting = [one for one in self.waiting if one not in late]
        return [
            ("expires", header) for one in late if not one["answered"] for header in one["clients"]
        ]

    def is_asked(self, now_ns: int, image: Image, requester: str) -> list[Deed]:
        header, picture = image.header, picture_of(image)
        role = "client" if requester == "client" else "neighbour"
        if picture in self.cache:
            return [("looks up", header, "hit", role), *self.replays(picture, header, requester)]
        same = [one for one in self.waiting if header in (one["header"], *one["clients"])]
        if any(one["clients"] or role == "neighbour" for one in same):
            return []  # the seen-set
        self.waiting = [one for one in self.waiting if one not in same]  # a neighbour's, noted
        request = {
            "since_ns": now_ns,
            "header": header,
            "picture": picture,
            "clients": [],
            "answered": False,
        }
        if role == "neighbour":  # hits only: no processing, no re-broadcast
            self.waiting.append(request)
            return [("looks up", header, "miss", role)]
        for one in self.waiting:
            if one["picture"] == picture and one["clients"] and not one["answered"]:
                one["clients"].append(header)
                return [("looks up", header, "coalesced", role), self.shows_map(image)]
        request["clients"] = [header]
        self.waiting.append(request)
        deeds = [("looks up", header, "miss", role), ("asks node", header), ("asks others", header)]
        return [*deeds, self.shows_map(image)]

    def shows_map(self, image: Image) -> Deed:
        """At once, the high-confidence map objects in view; may be none."""
        visible = [
            Detection(one["label"], one["score"], None, one["location"], one["confidence"])
            for one in self.map
            if in_view(image, one["location"])
        ]
        return self.publishes(
            "tells clients", Detections(image.header, tuple(visible), "map", self.name)
        )

    def is_told(self, answer: Detections, own: bool) -> list[Deed]:
        """The first answer is delivered to all who wait for it, a later one only overwrites what is
        stored.
        """
        answer, sights = self.sights(answer)
        deeds = [sights]
        for one in self.waiting:
            if one["header"] == answer.header:
                self.cache[one["picture"]] = answer
                if not one["answered"]:
                    deeds += [
                        self.publishes("tells clients", answer.restamped(header))
                        for header in one["clients"]
                    ]
                one["answered"] = True
        if own:  # the other edges store it
            deeds.append(self.publishes("tells others", answer))
        return deeds

    def replays(self, picture: Any, header: Header, requester: str) -> list[Deed]:
        """The stored answer under the request's header, and what else the map knows about its
        places, once.
        """
        requests = hits = 0
        objects, others, included = [], [], []
        for one in self.cache[picture].objects:
            if one.location is None:
                objects.append(one)
                continue
            confident = [
                stored for stored in self.near(one.location) if stored["confidence"] >= C_T
            ]
            requests, hits = requests + 1, hits + (1 if confident else 0)
            stored = self.same(one)
            included.append(stored)
            objects.append(as_seen(one, stored["confidence"]))
            others += confident
        for stored in others:
            if stored not in included:
                included.append(stored)
                objects.append(
                    as_seen(
                        Detection(stored["label"], 0, None, stored["location"], 0),
                        stored["confidence"],
                    )
                )
        answer = Detections(header, tuple(objects), "cache", self.name)
        verb = "tells clients" if requester == "client" else f"tells {requester}"
        return [("boosts", requests, hits), self.publishes(verb, answer)]

    def sights(self, answer: Detections) -> tuple[Detections, Deed]:
        """noisy_or: C += lambda * M.C * (1 - C)."""
        requests = hits = updates = 0
        boost, objects = 0.0, []
        for seen in answer.objects:
            if seen.location is None:
                objects.append(seen)
                continue
            requests += 1
            stored = self.same(seen)
            if stored is None:
                stored = {"label": seen.label, "location": seen.location, "score": seen.score}
                stored["confidence"] = seen.confidence
                self.map.append(stored)
            else:
                before = stored["confidence"]
                stored["confidence"] = before + RATE * seen.confidence * (1 - before)
                hits += 1 if before >= C_T else 0
                updates += 1
                boost += stored["confidence"] - before
            objects.append(as_seen(seen, stored["confidence"]))
        return answer.with_objects(objects), ("sights", requests, hits, updates, round(boost, 9))

    def near(self, location: Any) -> list[dict[str, Any]]:
        return [one for one in self.map if math.dist(one["location"][:2], location[:2]) <= GATE_M]

    def same(self, seen: Detection) -> dict[str, Any] | None:
        """The nearest of the class within the gate."""
        alike = [one for one in self.near(seen.location) if one["label"] == seen.label]
        return min(
            alike, key=lambda one: math.dist(one["location"][:2], seen.location[:2]), default=None
        )

    def publishes(self, verb: str, answer: Detections) -> Deed:
        """Only objects with C >= C_T leave a Genie."""
        return told(
            verb, answer.with_objects([one for one in answer.objects if one.confidence >= C_T])
        )


def picture_of(image: Image) -> Any:
    """Cell of the camera's position and heading: "arrives at the same spot"."""
    heading = round(math.degrees(image.pose.heading_rad) / 15) % 24
    return (
        image.header.frame_id,
        math.floor(image.pose.east_m),
        math.floor(image.pose.north_m),
        heading,
    )


def in_view(image: Image, location: Any) -> bool:
    east_m, north_m = location[0] - image.pose.east_m, location[1] - image.pose.north_m
    off_axis = (math.atan2(north_m, east_m) - image.pose.heading_rad + math.pi) % (
        2 * math.pi
    ) - math.pi
    return math.hypot(east_m, north_m) <= VIEW_M and abs(off_axis) <= image.horizontal_fov_rad / 2


def as_seen(one: Detection, confidence: float) -> Detection:
    return Detection(one.label, one.score, one.box, one.location, confidence)


def told(verb: str, answer: Detections) -> Deed:
    objects = [(one.label, str(one.location), round(one.confidence, 9)) for one in answer.objects]
    return verb, answer.header, answer.source, answer.served_by, sorted(objects)


def deed(effect: Effect) -> Deed:
    """An effect of the real Genie in the twin's words."""
    if isinstance(effect, Publish):
        if isinstance(effect.message, Image):
            return {f"{IMAGES}-local": "asks node", f"{IMAGES}-remote": "asks others"}[
                effect.topic
            ], effect.message.header
        if effect.topic == OBJECTS:
            return told("tells clients", effect.message)
        return told(f"tells {effect.to or 'others'}", effect.message)
    record = effect
    if isinstance(record, Expired):
        return "expires", record.header
    if isinstance(record, ImageLookup):
        return "looks up", record.header, record.outcome, record.requester
    if record.kind == "boost":
        return "boosts", record.requests, record.hits
    return "sights", record.requests, record.hits, record.updates, round(record.boost_sum, 9)
