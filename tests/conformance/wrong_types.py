"""Own classes whose methods return what they should not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from genie_sim.core.messages import Publish
from genie_sim.sim.method import HostConfig
from tests.conformance import own, small

OWN = "tests.conformance.own"


RADIO = {"model": f"{OWN}:Radio", "slot_ms": 1.0}


FAULT = {"fault": f"{OWN}:Blackout", "target": "edge1", "begin": "0.5 s", "end": "0.8 s"}


METHOD = {"methods": [f"{OWN}:Again"]}


LINK = {"methods": ["remote"], "cars": [small.car(1, link=RADIO), small.car(2)]}


MEDIUM = {
    "methods": ["remote"],
    "cars": [small.car(1, link={"model": f"{OWN}:OneAtATime", "rate": "1 Gbit/s"}), small.car(2)],
}


SIMILAR = {"methods": ["genie"], "genie": {"similarity": f"{OWN}:OwnSimilarity"}}


EVICTION = {
    "methods": ["genie"],
    "genie": {"eviction": f"{OWN}:OwnEviction", "capacity": "1 entries"},
}


POLICY = {"methods": ["genie"], "genie": {"object_map": {"freshness": f"{OWN}:OwnPolicy"}}}


def returns(value: Any) -> Any:
    return lambda *_: value


class Index(set):
    """Finds what nobody has stored."""

    def find(self, key):
        return "nothing"


CASES = {
    "no config": (METHOD, own.Again, "on_edge", returns(None), "on_edge() is None, but must be a"),
    "config": (METHOD, own.Again, "on_car", returns("x"), "on_car() is 'x', but must be a"),
    "detector": (
        METHOD,
        own.Again,
        "on_edge",
        returns(HostConfig(detector="yes")),  # type: ignore[arg-type]
        "on_edge().detector is 'yes', but must be True or False",
    ),
    "topics": (
        METHOD,
        own.Again,
        "on_edge",
        returns(HostConfig(neighbour_topics="/images")),  # type: ignore[arg-type]
        "on_edge().neighbour_topics is '/images', but must be a tuple of texts",
    ),
    "interceptor": (
        METHOD,
        own.Again,
        "on_car",
        returns(HostConfig(interceptor=returns(None))),
        "the interceptor's name is None, but must be text",
    ),
    "subscriptions": (
        METHOD,
        own.Latest,
        "subscriptions",
        returns("/image_raw"),
        "subscriptions() is '/image_raw', but must be a tuple of texts",
    ),
    "no effects": (METHOD, own.Latest, "on_message", returns(None), "on_message() is None, but"),
    "no message": (
        METHOD,
        own.Latest,
        "on_message",
        returns([Publish("/objects", None)]),  # type: ignore[arg-type]
        "on_message() is ",
    ),
    "deadline": (
        METHOD,
        own.Latest,
        "next_deadline_ns",
        returns(0.5),
        "next_deadline_ns() is 0.5, but must be a whole number, 0 or more, or None",
    ),
    "title": (METHOD, own.Again, "title", None, "title is None, but must be text"),
    "channel": (
        LINK,
        own.Radio,
        "channel",
        returns(None),
        "channel() is None, but must be an object with occupied_ns and delay_ns",
    ),
    "occupied": (
        LINK,
        own.RadioChannel,
        "occupied_ns",
        returns(1.5),
        "occupied_ns() is 1.5, but must be a whole number, 0 or more",
    ),
    "delay": (LINK, own.RadioChannel, "delay_ns", returns(-1), "delay_ns() is -1, but must be a"),
    "radio": (
        MEDIUM,
        own.OneAtATime,
        "radio",
        returns(None),
        "radio() is None, but must be an object with sender",
    ),
    "sender": (
        MEDIUM,
        own.Turns,
        "sender",
        returns(None),
        "sender() is None, but must be an object with sent, delay_ns and set_up",
    ),
    "sender's delay": (
        MEDIUM,
        own.Turn,
        "delay_ns",
        returns(-1),
        "delay_ns() is -1, but must be a",
    ),
    "check": (
        {"faults": [FAULT]},
        own.Blackout,
        "check",
        staticmethod(returns(3)),
        "check() is 3, but must be something to iterate over",
    ),
    "no check": ({"faults": [FAULT]}, own.Blackout, "check", "x", "check is 'x', but must be a"),
    "duration": ({"faults": [FAULT]}, own.Blackout, "duration_ns", "1 s", "duration_ns is '1 s'"),
    "open": (
        {},
        own.Street,
        "open",
        returns(None),
        "what open() returns: must be of a subclass of Frames",
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
    "digests": ({}, own.Street, "digests", returns(["x"]), "digests() is ['x'], but must be a"),
    "truth": ({}, own.Street, "truth_of", returns(1), "truth_of() is 1, but must be an object"),
    "no truth": ({}, own.Street, "truth_of", 5, "truth_of is 5, but must be a method"),
    "key": (SIMILAR, own.OwnSimilarity, "key", returns([]), "key() is [], but must be hashable"),
    "index": (SIMILAR, own.OwnSimilarity, "index", returns(1), "index() is 1, but must be an"),
    "find": (
        SIMILAR,
        own.OwnSimilarity,
        "index",
        lambda _: Index(),
        "find() is 'nothing', but must be a held key, or None",
    ),
    "victim": (EVICTION, own.OwnEviction, "victim", returns(7), "victim() is 7, but must be a"),
    "expires": (EVICTION, own.OwnEviction, "expires_ns", returns("x"), "expires_ns() is 'x', but"),
    "policy": (POLICY, own.OwnPolicy, "expires_ns", returns("x"), "expires_ns() is 'x', but must"),
    "huge": (POLICY, own.OwnPolicy, "expires_ns", returns(10**400), "expires_ns() is 1000000"),
    "serves": (POLICY, own.OwnPolicy, "serves", returns(None), "serves() is None, but must be"),
}
