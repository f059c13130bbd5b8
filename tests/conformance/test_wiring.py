"""A method whose topics reach nobody is told before the run."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.folder import run_in_memory
from genie_sim.sim.method import IMAGES, OBJECTS, REMOTE_UPLINK, HostConfig, UplinkTopics
from tests.conformance import own, small

UP, DOWN = IMAGES + "-up", OBJECTS + "-up"


class Relay(own.Interceptor):
    """Subscribes to and publishes what a test chooses, and does nothing."""

    def __init__(self, host, *topics):
        self.name = f"{host}/relay"
        self.topics = topics

    def subscriptions(self):
        return self.topics[0]

    def publications(self):
        return self.topics[1]

    def on_message(self, topic, message, now_ns, sender=None):
        return []


def relay(subscriptions, publications, host="car1"):
    return lambda *_: Relay(host, subscriptions, publications)


MISTAKES = {
    "nothing on the car": (HostConfig(), None, "frames of car1 go to no node: nothing there"),
    "a subscription": (
        HostConfig(interceptor=relay(("/images",), (OBJECTS,))),
        None,
        "frames of car1 go to no node: nothing there subscribes to /image_raw",
    ),
    "up": (
        HostConfig(interceptor=relay((IMAGES, DOWN), (OBJECTS, UP)), uplink=REMOTE_UPLINK),
        None,
        "frames of car1 do not go up: its uplink takes /image_raw-remote, which nothing",
    ),
    "down": (
        HostConfig(interceptor=relay((IMAGES,), (OBJECTS, UP)), uplink=UplinkTopics(UP, DOWN)),
        None,
        "answers to car1 go to no node: its uplink brings .*objects-up, to which nothing",
    ),
    "nothing on the edge": (
        HostConfig(uplink=UplinkTopics(IMAGES, OBJECTS)),
        HostConfig(),
        "frames of car1 go to no node: nothing on edge1 subscribes to /image_raw",
    ),
    "no answers from the edge": (
        HostConfig(uplink=UplinkTopics(IMAGES, OBJECTS)),
        lambda host: HostConfig(interceptor=relay((IMAGES,), ("/else",), host.name)),
        "car1 gets no answers: nothing on edge1 publishes .*/objects",
    ),
    "a detector without frames": (
        HostConfig(detector=True, interceptor=relay((IMAGES, OBJECTS + "-local"), (OBJECTS,))),
        None,
        "frames of car1 do not reach its detector: nothing publishes /image_raw-local",
    ),
    "a detector without a listener": (
        HostConfig(detector=True, interceptor=relay((IMAGES,), (OBJECTS, IMAGES + "-local"))),
        None,
        "answers of car1's detector go to no node: nothing subscribes to .*-local",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_topic_that_reaches_nobody_is_one_line(mistake: str, monkeypatch: pytest.MonkeyPatch):
    car, edge, message = MISTAKES[mistake]
    monkeypatch.setattr(own.Wired, "car", car)
    if edge is not None:
        monkeypatch.setattr(own.Wired, "edge", edge)
    with pytest.raises(UserError, match=f"^wired: {message}") as error:
        run_in_memory(small.scenario(["tests.conformance.own:Wired"]))
    assert "\n" not in str(error.value)


def test_a_method_that_connects_a_car_without_an_edge_is_one_line():
    lonely = small.car(1)
    del lonely["edge"], lonely["link"]
    scenario = small.scenario(["tests.conformance.own:Again"], cars=[lonely, small.car(2)])
    with pytest.raises(UserError, match=r"^again and again: car1 has an uplink, but no edge$"):
        run_in_memory(scenario)


def test_a_timer_wakes_its_node_once_at_each_deadline(monkeypatch: pytest.MonkeyPatch):
    """One comes before any frame, and the other a second after the last of them."""
    deadlines_ns, woken = [1_000_000, 3_000_000_000], {}

    def on_deadline(node, now_ns):
        woken.setdefault(node.name, []).append(now_ns)
        return []

    def next_deadline_ns(node):
        count = len(woken.get(node.name, ()))
        return deadlines_ns[count] if count < len(deadlines_ns) else None

    monkeypatch.setattr(own.Latest, "next_deadline_ns", next_deadline_ns, raising=False)
    monkeypatch.setattr(own.Latest, "on_deadline", on_deadline, raising=False)
    small.tables(small.scenario(["tests.conformance.own:Again"]))
    assert woken == {"car1/again": deadlines_ns, "car2/again": deadlines_ns}
