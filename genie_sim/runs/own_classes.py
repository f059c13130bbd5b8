"""Methods, link models, faults and frame sources of the user's own, checked while they run: what
their methods return must be what the simulator needs (``contracts``).
"""

from collections.abc import Callable, Mapping
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
    is_number,
    optional,
    require,
)
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.core.messages import Detections, Expired, Forgotten, Image, Observation, Publish
from genie_sim.data.source import Drive, Frames
from genie_sim.sim.link_models import Air, Channel, LinkEnds, LinkModel, Medium, Radio, Sender
from genie_sim.sim.method import HostConfig, HostContext, Interceptor, Method


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
CONFIG = Contract("a HostConfig", lambda value: isinstance(value, HostConfig))
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
    "on_message": EFFECTS,
    "next_deadline_ns": optional(WHOLE),
    "on_deadline": EFFECTS,
    "cache_entries": WHOLE,
    "on_void": Contract(
        "a list of Expired and Forgotten",
        lambda value: (
            isinstance(value, list | tuple)
            and all(isinstance(record, Expired | Forgotten) for record in value)
        ),
    ),
}
CHANNEL_METHODS = {"occupied_ns": WHOLE, "delay_ns": optional(WHOLE)}
RADIO = Contract("a radio with sender", lambda value: hasattr(value, "sender"))
NOTHING = Contract("None", lambda value: value is None)
EVENT = Contract(
    "an event, such as air.clock.timeout(10**6)", lambda value: hasattr(value, "callbacks")
)
SENDER_METHODS = {"sent": EVENT, "delay_ns": optional(WHOLE), "set_up": NOTHING}

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


class CheckedMethod(Method):
    """A method of the user's own; ``owner`` names it in error lines."""

    def __init__(self, own: Any, owner: str) -> None:
        self._own = own
        self._owner = owner
        self.title = require(owner, "title", own.title, TEXT)
        self.baseline = require(owner, "baseline", own.baseline, BOOLEAN)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_own"], name)

    def on_car(self, host: HostContext) -> HostConfig | None:
        config = require(self._owner, "on_car()", self._own.on_car(host), optional(CONFIG))
        return None if config is None else self._checked_config("on_car()", config)

    def on_edge(self, host: HostContext) -> HostConfig:
        config = require(self._owner, "on_edge()", self._own.on_edge(host), CONFIG)
        return self._checked_config("on_edge()", config)

    def _checked_config(self, field: str, config: HostConfig) -> HostConfig:
        for name, contract in CONFIG_FIELDS.items():
            require(self._owner, f"{field}.{name}", getattr(config, name), contract)
        make = config.interceptor
        if make is None:
            return config

        def checked(subscribed: tuple[str, ...], published: tuple[str, ...]) -> Interceptor:
            node: Any = make(subscribed, published)
            require(self._owner, "the interceptor's name", getattr(node, "name", None), TEXT)
            return CheckedInterceptor(node, self._owner)

        return replace(config, interceptor=checked)


class CheckedInterceptor(Checked):
    """An interceptor of the user's own, which publishes on its own topics only."""

    def __init__(self, own: Interceptor, owner: str) -> None:
        super().__init__(own, owner, INTERCEPTOR_METHODS)
        topics = frozenset(self.publications())
        for name in ("on_message", "on_deadline"):
            if hasattr(self, name):
                own_name = f"{owner}: {name}()"
                self.__dict__[name] = _publishing(getattr(self, name), own_name, topics)


def _publishing(
    method: Callable[..., Any], own_name: str, topics: frozenset[str]
) -> Callable[..., Any]:
    """The same method, whose effects may publish on ``topics`` only."""

    def call(*arguments: Any, **parameters: Any) -> Any:
        effects = method(*arguments, **parameters)
        for effect in effects:
            if isinstance(effect, Publish) and effect.topic not in topics:
                text = unknown("topic", effect.topic, topics)
                raise UserError(f"{own_name} publishes on an {text}")
        return effects

    return call


class CheckedLinkModel:
    """A link model of the user's own; ``owner`` names it in error lines."""

    def __init__(self, own: LinkModel, owner: str) -> None:
        self.own = own
        self._owner = owner

    def channel(self, up: bool, rng: np.random.Generator) -> Channel:
        channel = self.own.channel(up, rng)
        return Checked(channel, self._owner, CHANNEL_METHODS)


class CheckedMedium:
    """A medium of the user's own; ``owner`` names it in error lines."""

    def __init__(self, own: Medium, owner: str) -> None:
        self.own = own
        self._owner = owner

    def radio(self, air: Air) -> Radio:
        return CheckedRadio(
            require(self._owner, "radio()", self.own.radio(air), RADIO), self._owner
        )


class CheckedRadio:
    """The radio of a medium of the user's own."""

    def __init__(self, own: Radio, owner: str) -> None:
        self._own = own
        self._owner = owner

    def sender(self, ends: LinkEnds) -> Sender:
        return Checked(self._own.sender(ends), self._owner, SENDER_METHODS)


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
