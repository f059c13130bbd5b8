"""Own classes that give what they should not, as it is seen before a run."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from tests.conformance import own

OWN = "tests.conformance.own"


FAULT = {"fault": f"{OWN}:Blackout", "target": "edge1", "begin": "0.5 s", "end": "0.8 s"}


METHOD = {"methods": [f"{OWN}:Again"]}


def returns(value: Any) -> Any:
    return lambda *_: value


CASES = {
    "title": (METHOD, own.Again, "title", None, "title is None, but must be text"),
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
}
