"""Own classes that give what they should not, as it is seen before a run."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from genie_sim.core.messages import Publish
from genie_sim.sim.method import IMAGES, OBJECTS, HostConfig
from tests.conformance import own, small

OWN = "tests.conformance.own"


FAULT = {"fault": f"{OWN}:Blackout", "target": "edge1", "begin": "0.5 s", "end": "0.8 s"}


METHOD = {"methods": [f"{OWN}:Again"]}


def returns(value: Any) -> Any:
    return lambda *_: value


STREET = {"methods": ["local"]}
FEW = {"methods": ["genie"], "genie": {"eviction": f"{OWN}:OwnEviction", "capacity": "2 entries"}}
ALIKE = {"methods": ["genie"], "genie": {"similarity": f"{OWN}:OwnSimilarity"}}
RADIO = {
    "methods": ["remote"],
    "cars": [small.car(i, link={"model": f"{OWN}:Radio", "slot_ms": 0.5}) for i in (1, 2)],
}
STRUCK = {"methods": ["remote"], "faults": [{**FAULT, "begin": "0.1 s", "end": "0.2 s"}]}

CASES = {
    "title": (METHOD, own.Again, "title", None, "title is None, but must be text"),
    "check": (
        {"faults": [FAULT]},
        own.Blackout,
        "check",
        staticmethod(returns(3)),
        "TypeError: 'int' object is not iterable",
    ),
    "no check": ({"faults": [FAULT]}, own.Blackout, "check", "x", "TypeError: 'str' object is not"),
    "duration": ({"faults": [FAULT]}, own.Blackout, "duration_ns", "1 s", "duration_ns is '1 s'"),
    "open": (
        {},
        own.Street,
        "open",
        returns(None),
        "what open() returns: must be of a subclass of Drives",
    ),
    "drive": (
        {},
        own.Street,
        "drive",
        returns("x"),
        "what drive() returns: must be of a subclass of Drive",
    ),
    "no frames": (
        {},
        own.Street,
        "_frames",
        returns([]),
        "drive().frames['left'] is [], but must be a sequence with at least one item",
    ),
    "frame": (
        {},
        own.Street,
        "_frame",
        returns(SimpleNamespace(stamp_ns=0, pose=None)),
        "drive().frames['left'][0].pose is None, but must be a CameraPose",
    ),
    "one stamp": (
        {},
        own.Street,
        "_frame",
        lambda street, camera, number, frame=own.Street._frame: frame(street, camera, 0),
        "drive().frames['left'][1].stamp_ns is 0, but must be above 0",
    ),
    "digests": ({}, own.Street, "digests", returns(["x"]), "digests() is ['x'], but must be a"),
    "digests later": (
        {},
        own.Street,
        "digests",
        lambda street: {"street": None},
        "digests() is {'street': None}, but must be a mapping from name to text",
    ),
    "provenance": (
        {},
        own.Street,
        "provenance",
        returns({"street": {"by": object}}),
        "provenance() is {'street': {'by': <class 'object'>}}, but must be a mapping from name",
    ),
    "text for a time": (
        RADIO,
        own.RadioTransmitter,
        "occupied_ns",
        returns("5"),
        "occupied_ns() is '5'",
    ),
    "true for a time": (
        RADIO,
        own.RadioTransmitter,
        "occupied_ns",
        returns(True),
        "() is True, but",
    ),
    "half a nanosecond": (
        RADIO,
        own.RadioTransmitter,
        "delay_ns",
        returns(1.5),
        "delay_ns() is 1.5",
    ),
    "ages": (
        RADIO,
        own.RadioTransmitter,
        "delay_ns",
        returns(2**70),
        "delay_ns() is 1180591620717411",
    ),
    "before now": (FEW, own.OwnEviction, "expires_ns", returns(-1), "expires_ns() is -1, but must"),
    "never": (FEW, own.OwnEviction, "expires_ns", returns(math.nan), "expires_ns() is nan"),
    "no effect": (METHOD, own.Latest, "on_message", returns(["x"]), "on_message() has 'x', but"),
    "no deadline": (METHOD, own.Latest, "next_deadline_ns", returns(math.inf), "() is inf, but"),
    "no answer": (
        METHOD,
        own.Latest,
        "on_message",
        lambda node, topic, message, *_: [Publish(OBJECTS, message)] if topic == IMAGES else [],
        "objects: publishes Image(",
    ),
    "no host": (METHOD, own.Latest, "__init__", own.nameless, "name is 'again', but must"),
    "a topic for topics": (
        METHOD,
        own.Again,
        "on_edge",
        returns(HostConfig(detector=True, neighbour_topics=OBJECTS)),
        "but must be a tuple of topics",
    ),
    "befalls": (
        {"faults": [{**FAULT, "fault": f"{OWN}:Crash"}]},
        own.Crash,
        "befalls",
        "edge",
        "unknown befalls 'edge'",
    ),
    "after its end": (STRUCK, own.Blackout, "strike", own.strikes_twice, "yields again after"),
    "a stranger": (FEW, own.OwnEviction, "victim", returns("x"), "victim() is 'x', but must be a"),
}


# What the simulator asks of each kind of own class: settings, class and the names asked for.
HOOKS = (
    (STREET, own.Street, "open drive digests provenance _frames _frame seeded truth_of extent_m"),
    ({**STREET, "image_encoding": "jpeg80"}, own.Street, "encoded"),
    (STREET, own.StreetDrive, "name position duration_ns frames"),
    (FEW, own.OwnEviction, "stored used removed victim expires_ns"),
    (ALIKE, own.OwnSimilarity, "key index"),
    (STRUCK, own.Blackout, "strike check duration_ns dropped_by"),
    (RADIO, own.Radio, "transmitter digests"),
    (RADIO, own.RadioTransmitter, "occupied_ns delay_ns transmit"),
    (METHOD, own.Again, "on_car on_edge title baseline feature wire"),
    (METHOD, own.Latest, "on_message subscriptions publications void name"),
)
