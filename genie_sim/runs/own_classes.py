"""Methods, link models, faults and frame sources of the user's own, checked while they run: what
their methods return must be what the simulator needs (``contracts``).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from genie_sim.base.contracts import (
    BOOLEAN,
    MAPPING,
    POSITIVE,
    SEQUENCE,
    SHARE,
    TEXT,
    TEXTS,
    WHOLE,
    Checked,
    Contract,
    has,
    is_number,
    optional,
    require,
)
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.core.messages import Detections, Expired, Forgotten, Image, Observation, Publish
from genie_sim.data.source import Drive, Frames
from genie_sim.sim.method import HostConfig, Interceptor


def _is_effects(value: Any) -> bool:
    if not isinstance(value, list | tuple):
        return False
    for effect in value:
        if isinstance(effect, Publish):
            if not (
                isinstance(effect.topic, str) and isinstance(effect.message, Image | Detections)
            ):
                return False
        elif not isinstance(effect, Observation):
            return False
    return True


def _is_uplink(value: Any) -> bool:
    return TEXTS.holds(value) and len(value) == 2


EFFECTS = Contract("a list of Publish and of observations such as ImageLookup", _is_effects)
CALLABLE = Contract("a function that makes an interceptor", callable)
UPLINK = Contract("an Uplink of two topics", _is_uplink)
CONFIG_FIELDS = {
    "detector": BOOLEAN,
    "interceptor": optional(CALLABLE),
    "uplink": optional(UPLINK),
    "neighbour_topics": TEXTS,
    "key": optional(TEXT),
    "costs_nothing": BOOLEAN,
    "per_entry_ns": WHOLE,
}
INTERCEPTOR_METHODS = {
    "subscriptions": TEXTS,
    "publications": TEXTS,
    "next_deadline_ns": optional(WHOLE),
    "cache_entries": WHOLE,
    "on_void": Contract(
        "a list of Expired and Forgotten",
        lambda value: (
            isinstance(value, list | tuple)
            and all(isinstance(record, Expired | Forgotten) for record in value)
        ),
    ),
}
NOTHING = Contract("None", lambda value: value is None)
EVENT = Contract(
    "an event, such as air.clock.timeout(10**6)", lambda value: hasattr(value, "callbacks")
)
DELAY = optional(WHOLE)
LINK_MODEL_METHODS = {"channel": has({"occupied_ns": WHOLE, "delay_ns": DELAY})}
SENDER = has({"sent": EVENT, "delay_ns": DELAY, "set_up": NOTHING})
MEDIUM_METHODS = {"radio": has({"sender": SENDER})}

POSE = Contract(
    "a CameraPose of four numbers",
    lambda value: isinstance(value, tuple) and len(value) == 4 and all(map(is_number, value)),
)
DETECTIONS = Contract(
    "a tuple of Detection",
    lambda value: (
        isinstance(value, tuple | list)
        and all(hasattr(item, "label") and hasattr(item, "location") for item in value)
    ),
)
FRAME_FIELDS = {
    "stamp_ns": WHOLE,
    "pose": POSE,
    "digest": TEXT,
    "dhash": Contract(
        "a whole number of 64 bits", lambda value: WHOLE.holds(value) or _is_hash(value)
    ),
    "detections": DETECTIONS,
    "size_bytes": WHOLE,
    "horizontal_fov_rad": POSITIVE,
}
TEXT_BY_NAME = Contract(
    "a mapping from name to text",
    lambda value: (
        isinstance(value, Mapping)
        and all(isinstance(item, str) for pair in value.items() for item in pair)
    ),
)
MAPPING_BY_NAME = Contract(
    "a mapping from name to a mapping",
    lambda value: (
        isinstance(value, Mapping)
        and all(
            isinstance(name, str) and isinstance(facts, Mapping) for name, facts in value.items()
        )
    ),
)


TRUTH = Contract(
    "an object with reach_m, range_m, knows, visible and is_there",
    lambda value: all(
        hasattr(value, name) for name in ("reach_m", "range_m", "knows", "visible", "is_there")
    ),
)


def _is_hash(value: Any) -> bool:
    return isinstance(value, int | np.integer) and 0 <= int(value) < 2**64


def checked_method(own: Any, owner: str) -> Any:
    """A method of the user's own; ``owner`` names it in error lines. Raises ``UserError``."""
    require(owner, "title", own.title, TEXT)
    require(owner, "baseline", own.baseline, BOOLEAN)
    return Checked(own, owner, {"on_car": optional(CONFIG), "on_edge": CONFIG})


def _checked_config(config: HostConfig, owner: str, field: str) -> HostConfig:
    for name, contract in CONFIG_FIELDS.items():
        require(owner, f"{field}.{name}", getattr(config, name), contract)
    make = config.interceptor
    if make is None:
        return config

    def checked(subscribed: tuple[str, ...], published: tuple[str, ...]) -> Interceptor:
        node: Any = make(subscribed, published)
        require(owner, "the interceptor's name", getattr(node, "name", None), TEXT)
        interceptor: Interceptor = _checked_interceptor(node, owner)
        return interceptor

    return replace(config, interceptor=checked)


CONFIG = Contract("a HostConfig", lambda value: isinstance(value, HostConfig), _checked_config)


def _checked_interceptor(own: Any, owner: str) -> Any:
    """An interceptor of the user's own, which publishes on its own topics only."""

    def on_its_topics(effects: Any, owner: str, field: str) -> Any:
        for effect in effects:
            if isinstance(effect, Publish) and effect.topic not in topics:
                text = unknown("topic", effect.topic, topics)
                raise UserError(f"{owner}: {field} publishes on an {text}")
        return effects

    effects = EFFECTS._replace(then=on_its_topics)
    methods = {**INTERCEPTOR_METHODS, "on_message": effects, "on_deadline": effects}
    checked = Checked(own, owner, methods)
    topics = frozenset(checked.publications())
    return checked


def check_base(own: Any, what: str, base: type[Any]) -> None:
    """Raises ``UserError`` for an object of the user's own that is of no subclass of ``base``."""
    if not isinstance(own, base):
        raise UserError(
            f"{what}: must be of a subclass of {base.__name__} in {base.__module__}, "
            f"not {short_repr(own)}"
        )


def checked_frames(frames: Any, owner: str) -> Any:
    """What the ``open`` of a frame source of the user's own returned, checked while it is used.
    Raises ``UserError``.
    """
    check_base(frames, f"{owner}: what open() returns", Frames)
    require(owner, "seeded", frames.seeded, BOOLEAN)
    contracts = {
        "digests": TEXT_BY_NAME,
        "provenance": MAPPING_BY_NAME,
        "truth_of": optional(TRUTH),
    }
    return Checked(frames, owner, contracts)


def check_drive(drive: Any, owner: str) -> None:
    """Checks a drive of an own source, frame by frame. Raises ``UserError``."""
    check_base(drive, f"{owner}: what drive() returns", Drive)
    require(owner, "drive().name", getattr(drive, "name", None), TEXT)
    recordings = require(owner, "drive().frames", getattr(drive, "frames", None), MAPPING)
    for recording, frames in recordings.items():
        require(owner, "a key of drive().frames", recording, TEXT)
        field = f"drive().frames[{recording!r}]"
        require(owner, field, frames, SEQUENCE)
        for index, frame in enumerate(frames):
            _check_frame(frame, owner, f"{field}[{index}]")
            if index and frame.stamp_ns <= frames[index - 1].stamp_ns:
                raise UserError(
                    f"{owner}: {field}[{index}].stamp_ns is {frame.stamp_ns}, but must be above "
                    f"{frames[index - 1].stamp_ns}, that of the frame before"
                )


def _check_frame(frame: Any, owner: str, field: str) -> None:
    for name, contract in FRAME_FIELDS.items():
        require(owner, f"{field}.{name}", getattr(frame, name, None), contract)
    for detection in frame.detections:
        require(owner, f"{field}.detections: label", detection.label, TEXT)
        require(owner, f"{field}.detections: score", detection.score, SHARE)
