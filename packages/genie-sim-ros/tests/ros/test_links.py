"""Two Genies linked by Zenoh, without ROS: who gets in, what gets through, and that it comes back
after a cut.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import math
import os
import signal
import socket
import ssl
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Header
from genie_sim_ros import links, wire
from genie_sim_ros.codec import WireType, codec_of
from genie_sim_ros.gateway import Peer
from genie_sim_ros.keys import why_unreachable
from genie_sim_ros.links import Links, Outbox, configuration
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan
from tests.ros.conftest import ADD_ON, HERE, PATIENCE_S, PYTHONPATH, Keys, free_port, until

IMAGE = codec_of(WireType("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"), 1)
SCAN = codec_of(WireType("my_msgs/Scan", "0" * 32), 1)
CODECS = {"/image_raw": IMAGE, "/objects": SCAN}
REQUEST = "/image_raw_remote"


def image(second: int, size: int = 1000, codec: object = IMAGE) -> RosMessage:
    header = struct.pack("<IIII", 0, second, 0, 6) + b"camera"
    return RosMessage.of(header + bytes(size), codec, "car1", answer=False)


def plan_of(keys: Keys, name: str, role: str, /, **fields: Any) -> AttachPlan:
    fields.setdefault("keys", keys(name))
    if "listen" in fields and role == "edge":
        fields.setdefault("cars", ("car1", "car2", "expired"))
    return AttachPlan(
        node="/node",
        name=name,
        role=role,
        requests=("/image_raw",),
        answers=("/objects",),
        **fields,
    )


class Site:
    """One end: its links, and what they have delivered."""

    def __init__(self, plan: AttachPlan) -> None:
        self.got: list[tuple[Peer, str, RosMessage]] = []
        self.then: Callable[[Peer, str, RosMessage], None] = lambda peer, topic, message: None
        self.links = Links(plan, CODECS.get)
        self.links.start(self._hear)

    def _hear(self, *message: Any) -> None:
        self.got.append(message)
        self.then(*message)

    def names(self) -> list[str]:
        return [peer.name for peer in self.links.peers()]

    def seconds(self) -> list[int]:
        """The stamps of what has come [s]."""
        return [message.header.stamp_ns // 10**9 for *_, message in self.got]


@pytest.fixture
def new_site(keys: Keys) -> Iterator[Callable[..., Site]]:
    sites: list[Site] = []

    def make(name: str, role: str, **where: Any) -> Site:
        sites.append(Site(plan_of(keys, name, role, **where)))
        return sites[-1]

    yield make
    for site in sites:
        site.links.close()


@pytest.fixture
def edge(new_site: Callable[..., Site]) -> Site:
    """An edge that listens at ``edge.address`` for car1 and car2."""
    port = free_port()
    site = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    site.port, site.address = port, f"edge1@127.0.0.1:{port}"
    return site


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, logger="genie_sim_ros.links")
    return lambda: [
        record.getMessage() for record in caplog.records if record.levelno == logging.WARNING
    ]


def connected(car: Site, edge: Site, name: str = "car1") -> None:
    until(lambda: car.names() == ["edge1"] and name in edge.names(), "both are connected")


@contextlib.contextmanager
def intruder(keys: Keys, name: str, port: int, authority: str = "ours") -> Iterator[Any]:
    """A session of Zenoh with the certificate of ``name``, and with no rules of its own."""
    address = f"edge1@127.0.0.1:{port}"
    fields = configuration(
        plan_of(keys, name, "car", connect=(address,), keys=keys(name, authority))
    )
    del fields["access_control"]
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(fields)))
    try:
        yield session
    finally:
        session.close()


def put(session: Any, key: str, message: RosMessage, topic: str = REQUEST) -> None:
    text, payload = wire.encode(topic, message)
    session.put(
        key,
        payload,
        attachment=text,
        congestion_control=zenoh.CongestionControl.BLOCK,
        allowed_destination=zenoh.Locality.REMOTE,
    )


# What gets through


def test_a_message_arrives_as_it_was_sent(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    pose = CameraPose(1.0, 2.0, 3.0, 0.5)
    for second in range(1, 4):
        sent = replace(image(second, size=1_400_000), pose=pose, horizontal_fov_rad=1.4)
        car.links.send("edge1", REQUEST, sent)
        until(lambda second=second: len(edge.got) == second, "the image arrives")
    assert [(peer, topic) for peer, topic, _ in edge.got] == [(Peer("car1", "car"), REQUEST)] * 3
    assert [message.header for *_, message in edge.got] == [
        Header(n * 10**9, "camera", "car1") for n in (1, 2, 3)
    ]
    assert {(message.pose, message.horizontal_fov_rad) for *_, message in edge.got} == {(pose, 1.4)}
    assert edge.got[0][2].payload == image(1, size=1_400_000).payload


def test_both_directions_at_once_under_load(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    second = 0
    while min(len(car.got), len(edge.got)) < 50:
        second += 1
        car.links.send("edge1", REQUEST, image(second, size=300_000))
        edge.links.send("car1", "/objects", image(second, 300_000, SCAN))
        time.sleep(0.001)
    for site in (car, edge):
        seconds = site.seconds()  # once: more may arrive at any time
        assert seconds == sorted(set(seconds)), "in order, none twice"


def test_a_slow_link_holds_two_images_and_the_newest_ones():
    outbox = Outbox(frozenset([REQUEST]))
    for second in range(1, 14):
        outbox.put(REQUEST, image(second))
        outbox.put("/objects", image(second, 10, SCAN))
    outbox.put("/end", image(0))
    held: dict[str, list[int]] = {}
    while (entry := outbox.take()) is not None:
        topic, message = entry
        held.setdefault(topic, []).append(message.header.stamp_ns // 10**9)
        if topic == "/end":
            outbox.close()
    assert held == {REQUEST: [12, 13], "/objects": list(range(4, 14)), "/end": [0]}


def test_a_slow_receiver_holds_up_one_peer_and_hears_its_newest(
    edge: Site, new_site: Callable[..., Site]
):
    cars = [new_site(name, "car", connect=(edge.address,)) for name in ("car1", "car2")]
    for car, name in zip(cars, ("car1", "car2"), strict=True):
        connected(car, edge, name)
    release = threading.Event()
    edge.then = lambda peer, topic, message: peer.name == "car1" and release.wait(PATIENCE_S)
    cars[0].links.send("edge1", REQUEST, image(1))
    until(lambda: edge.got, "the receiver is busy")
    for second in range(2, 40):
        cars[0].links.send("edge1", REQUEST, image(second))
        cars[1].links.send("edge1", REQUEST, image(second))
        time.sleep(0.02)
    until(lambda: edge.seconds()[-1] == 39, "the other car is heard")
    assert [peer.name for peer, *_ in edge.got].count("car1") == 1
    release.set()

    def heard() -> list[int]:
        first = [message for peer, _, message in edge.got if peer.name == "car1"]
        return [message.header.stamp_ns // 10**9 for message in first]

    until(lambda: heard()[-1] == 39, "it goes on")
    assert heard() == sorted(set(heard())) and len(heard()) < 30


def test_a_car_dials_again_until_its_edge_is_back(keys: Keys, new_site: Callable[..., Site]):
    port = free_port()
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{port}",))
    for _ in range(2):
        edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
        until(lambda: car.names() == ["edge1"], "the edge is found")
        car.links.send("edge1", REQUEST, image(1))
        until(lambda edge=edge: edge.got, "an image arrives")
        edge.links.close()
        until(lambda: car.names() == [], "the cut is noticed")


def test_two_edges_that_dial_each_other_settle(new_site: Callable[..., Site]):
    """Whatever becomes of the two connections, nothing is heard twice."""
    at = [f"127.0.0.1:{free_port()}" for _ in range(2)]
    edges = [
        new_site("edge0", "edge", listen=at[0], cars=(), connect=(f"edge1@{at[1]}",)),
        new_site("edge1", "edge", listen=at[1], cars=(), connect=(f"edge0@{at[0]}",)),
    ]
    seconds = itertools.count(1)

    def ten_heard() -> bool:
        second = next(seconds)
        edges[0].links.send("edge1", "/objects", image(second, 10, SCAN))
        edges[1].links.send("edge0", "/objects", image(second, 10, SCAN))
        return min(len(edge.got) for edge in edges) >= 10

    until(ten_heard, "they are connected")
    for edge in edges:
        heard = edge.seconds()
        assert heard == sorted(set(heard)), "in order, none twice"


def test_a_message_of_nobody_who_is_there_is_dropped(edge: Site, new_site: Callable[..., Site]):
    """Nothing is queued for a link that is down: the past is of no use when it is back."""
    edge.links.send("car1", "/objects", image(1, 10, SCAN))
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    edge.links.send("car1", "/objects", image(2, 10, SCAN))
    until(lambda: car.got, "it arrives")
    assert car.seconds() == [2]


def test_what_is_too_long_is_not_sent(
    edge: Site, new_site: Callable[..., Site], warnings: Callable[[], list[str]]
):
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    car.links.send("edge1", REQUEST, image(1, size=wire.MAX_MESSAGE_BYTES))
    car.links.send("edge1", "x" * 5000, image(1))
    until(lambda: len(warnings()) == 2, "it is said")
    car.links.send("edge1", REQUEST, image(2))
    until(lambda: edge.got, "the next one arrives")
    assert all("cannot be sent" in line for line in warnings()) and edge.seconds() == [2]


# Who gets in


def test_a_wrong_certificate_gets_nobody_in(edge: Site, keys: Keys):
    """Neither one of another authority, nor one that has expired."""
    keys("expired", days=-1)
    for name, authority in (("car1", "others"), ("expired", "ours")):
        with intruder(keys, name, edge.port, authority) as session:
            time.sleep(1.0)
            put(session, f"genie/edge1/{name}", image(1))
            time.sleep(0.5)
    with intruder(keys, "car1", edge.port) as session:
        until(lambda: put(session, "genie/edge1/car1", image(2)) or edge.got, "a right one does")
    assert set(edge.seconds()) == {2}


def test_who_has_no_certificate_learns_nothing(edge: Site, new_site: Callable[..., Site]):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    for attempt in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 4096, os.urandom(5000), None):
        with (
            socket.create_connection(("127.0.0.1", edge.port), timeout=10) as thief,
            contextlib.suppress(OSError),
        ):
            if attempt is not None:
                thief.sendall(attempt)
                assert len(thief.recv(100)) <= 7, "an alert at most"
            else:
                with context.wrap_socket(thief) as secure:
                    secure.sendall(bytes(100))
                    assert secure.recv(100) == b""
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)


def test_nobody_speaks_under_another_name_or_hears_what_is_not_for_it(
    edge: Site, new_site: Callable[..., Site], keys: Keys
):
    """Not even on keys with wildcards, which would reach those who listen for another name."""
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    with intruder(keys, "car2", edge.port) as session:
        heard: list[str] = []
        session.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
        session.declare_subscriber("genie/car1/edge1", lambda sample: heard.append("car1's"))
        token = session.liveliness().declare_token("genie/expired")
        until(lambda: put(session, "genie/edge1/car2", image(1)) or edge.got, "it is heard")
        for key in ("genie/edge1/car1", "genie/edge1/*", "genie/edge1/c$*1", "genie/**", "**"):
            put(session, key, image(2))
        edge.links.send("car1", "/objects", image(3, 10, SCAN))
        car.links.send("edge1", REQUEST, image(4))
        until(lambda: car.got and 4 in edge.seconds(), "the link works")
        time.sleep(0.5)
        assert edge.names() == ["car1"]
        token.undeclare()
    assert heard == [] and car.seconds() == [3]
    assert set(edge.seconds()) == {1, 4}
    assert {peer.name for peer, _, message in edge.got if message.header.stamp_ns == 10**9} == {
        "car2"
    }


def test_a_right_certificate_with_a_name_that_nobody_expects_is_told_and_not_heard(
    edge: Site, keys: Keys, warnings: Callable[[], list[str]]
):
    with intruder(keys, "mallory", edge.port) as session:
        until(warnings, "a line")
        put(session, "genie/edge1/mallory", image(1))
        put(session, "genie/edge1/car1", image(1))
        time.sleep(0.5)
    (line,) = warnings()
    assert line.startswith("link: mallory at tls/127.0.0.1:") and edge.got == []
    assert line.endswith(" is none of car1, car2, expired: nothing is exchanged with it")


@pytest.mark.parametrize(("name", "authority"), [("edge2", "ours"), ("edge1", "others")])
def test_a_car_gives_nothing_to_another_than_its_edge(
    *,
    keys: Keys,
    new_site: Callable[..., Site],
    warnings: Callable[[], list[str]],
    name: str,
    authority: str,
):
    port = free_port()
    fields = configuration(
        plan_of(keys, name, "edge", listen=f"127.0.0.1:{port}", keys=keys(name, authority))
    )
    del fields["access_control"]
    impostor, heard = zenoh.open(zenoh.Config.from_json5(json.dumps(fields))), []
    impostor.declare_subscriber("**", lambda sample: heard.append(sample.key_expr))
    token = impostor.liveliness().declare_token("genie/edge1")
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{port}",))
    until(warnings, "it is told whom it has reached")
    if authority == "ours":
        assert warnings()[0].startswith(f"link: edge2 at tls/127.0.0.1:{port} is none of edge1:")
    else:
        assert warnings()[0].startswith(f"link: edge1@127.0.0.1:{port}: ")
        assert "certificate" in warnings()[0]
    car.links.send("edge1", REQUEST, image(1))
    time.sleep(0.5)
    assert heard == [] and car.names() == []
    token.undeclare()
    impostor.close()


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("nobody", "Connection refused"),
        ("mute", "timed out"),
        ("expired", "sslv3 alert certificate expired"),
    ],
)
def test_a_car_says_once_why_it_does_not_reach_its_edge(
    *,
    edge: Site,
    keys: Keys,
    new_site: Callable[..., Site],
    warnings: Callable[[], list[str]],
    monkeypatch: pytest.MonkeyPatch,
    case: str,
    reason: str,
):
    looks: list[str] = []

    def look(address: str, *where: Any) -> str | None:
        looks.append(address)
        return why_unreachable(address, *where)

    monkeypatch.setattr(links, "COMPLAIN_S", 0.2)
    monkeypatch.setattr(links, "why_unreachable", look)
    name = "car1"
    if case == "expired":
        name, address = "expired", edge.address
        keys(name, days=-1)
    else:
        address = f"edge1@127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as stack:
        if case == "mute":
            port = int(address.rpartition(":")[2])
            stack.enter_context(socket.create_server(("127.0.0.1", port)))
        new_site(name, "car", connect=(address,))
        until(lambda: any(reason in line for line in warnings()), "a line")
        told = len(looks)
        until(lambda: len(looks) > told + 3, "it looks again")
    assert all(line.startswith(f"link: {address}: ") for line in warnings())
    assert sum(reason in line for line in warnings()) == 1


def test_an_address_that_is_taken_is_named(keys: Keys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(UserError, match=rf"link: {address}: .*[Aa]ddress.*in use") as raised:
            Links(plan_of(keys, "edge1", "edge", listen=address), CODECS.get)
    assert "\n" not in str(raised.value)


# What a peer may say

PAYLOAD = image(1).payload
MESSAGE = {
    "topic": REQUEST,
    "type": IMAGE.type[:2],
    "origin": "car1",
    "source": "detector",
    "served_by": "",
}


def other(**fields: object) -> tuple[bytes, bytes]:
    """A good message but for these fields."""
    return json.dumps({**MESSAGE, **fields}).encode(), PAYLOAD


NONSENSE = [
    (None, PAYLOAD),
    (b"", PAYLOAD),
    (b"\0\0", PAYLOAD),
    (b"[", PAYLOAD),
    (b"[]", PAYLOAD),
    (b"{}", PAYLOAD),
    (b"7", PAYLOAD),
    (b"[" * wire.MAX_TEXT_BYTES, PAYLOAD),
    other(topic=5),
    other(topic="/x\nlink: edge edge9 is connected"),
    other(topic="/cmd_vel"),
    other(origin="x" * 300),
    other(type=["sensor_msgs/Image", "1" * 32]),
    other(type=["my_msgs/Image", IMAGE.type[1]]),
    other(type=None),
    other(pose=[1, 2, 3, math.nan]),
    other(pose=[math.inf, 2, 3, 4]),
    other(pose=[1, 2]),
    other(pose="here"),
    other(pose=[10**400, 2, 3, 4]),
    other(fov_rad=10**400),
    other(fov_rad=math.nan),
    other(fov_rad=None),
    (other()[0], b""),
    (other()[0], b"short"),
    (other()[0], struct.pack("<IIII", 0, 1, 2**32 - 1, 0)),
]


def test_nonsense_of_a_peer_costs_it_the_message_and_a_line(
    edge: Site,
    keys: Keys,
    warnings: Callable[[], list[str]],
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(links, "DROPPED_S", 0.0)
    with intruder(keys, "car1", edge.port) as session:
        until(lambda: put(session, "genie/edge1/car1", image(1)) or edge.got, "it is heard")
        for count, (text, payload) in enumerate(NONSENSE, start=1):
            session.put("genie/edge1/car1", payload, attachment=text)
            until(lambda count=count: len(warnings()) == count, f"a line for {text!r}")
        before = len(edge.got)
        put(session, "genie/edge1/car1", image(2))
        until(lambda: len(edge.got) > before, "after all that an image is heard")
    assert all(
        "\n" not in line and line.startswith("link: dropped a message of car1: ")
        for line in warnings()
    )


def test_who_sends_nonsense_again_and_again_is_not_heard_for_a_while(
    edge: Site,
    new_site: Callable[..., Site],
    keys: Keys,
    warnings: Callable[[], list[str]],
    monkeypatch: pytest.MonkeyPatch,
):
    now_s = 0.0
    monkeypatch.setattr(links, "time", SimpleNamespace(monotonic=lambda: now_s))
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    with intruder(keys, "car2", edge.port) as session:
        until(lambda: put(session, "genie/edge1/car2", image(1)) or edge.got, "it is heard")
        deaf = f"link: car2 is not heard for {links.DEAF_S:.0f} s"
        for _ in range(links.MAX_DROPPED):
            before = len(warnings())
            session.put("genie/edge1/car2", PAYLOAD, attachment=b"[")
            until(lambda before=before: len(warnings()) > before, "a line")
        until(lambda: deaf in warnings(), "it is told")
        assert len(warnings()) == links.MAX_DROPPED + 1
        put(session, "genie/edge1/car2", image(2))
        car.links.send("edge1", REQUEST, image(3))
        until(lambda: 3 in edge.seconds(), "the other car is heard")
        assert 2 not in edge.seconds()
        now_s += links.DEAF_S
        until(
            lambda: put(session, "genie/edge1/car2", image(4)) or 4 in edge.seconds(),
            "it is heard again",
        )


def test_a_bomb_of_json_is_measured_before_it_is_read(
    edge: Site, keys: Keys, warnings: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
):
    """A text that takes 9 s and a gigabyte to parse."""
    bomb = b"{" + b",".join(b'"%d":0' % number for number in range(5_000_000)) + b"}"
    texts: list[bytes] = []

    def decode(text: bytes, *more: Any) -> tuple[str, RosMessage]:
        texts.append(text)
        return wire.decode(text, *more)

    monkeypatch.setattr(links, "decode", decode)
    with intruder(keys, "car2", edge.port) as session:
        until(lambda: put(session, "genie/edge1/car2", image(0)) or edge.got, "it is heard")
        session.put(
            "genie/edge1/car2",
            PAYLOAD,
            attachment=bomb,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
        until(warnings, "a line")
        put(session, "genie/edge1/car2", image(1))
        until(lambda: 1 in edge.seconds(), "the next one is heard")
    assert max(map(len, texts)) <= wire.MAX_TEXT_BYTES


def test_definitions_do_not_travel():
    typed = codec_of(WireType("my_msgs/Thing", "1" * 32, "Header header\nint32 x\n"), 1)
    assert b"int32 x" not in b"".join(wire.encode(REQUEST, image(1, 4, typed)))


def test_a_message_of_too_many_objects_is_not_read():
    """Objects are read one by one, in Python."""
    markers = codec_of(WireType("visualization_msgs/MarkerArray", "1" * 32), 2)
    text = json.dumps({**MESSAGE, "topic": "/objects", "type": markers.type[:2]}).encode()
    with pytest.raises(ValueError, match="5000000 bytes; the limit is 4194304"):
        wire.decode(text, bytes(5_000_000), lambda topic: markers)


def test_what_the_receiver_raises_ends_nothing(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)

    def then(peer: Peer, topic: str, message: RosMessage) -> None:
        raise (UserError("no hash for this"), KeyError("x"), ValueError("short"))[len(edge.got) % 3]

    edge.then = then
    for second in range(1, 7):
        car.links.send("edge1", REQUEST, image(second))
        until(lambda second=second: len(edge.got) == second, "the next one is heard")
    assert edge.names() == ["car1"]


# Strangers


def test_strangers_do_not_disturb_a_link_that_is_up(edge: Site, new_site: Callable[..., Site]):
    """400 connections sit there in silence, and 200 a second send random bytes."""
    car = new_site("car1", "car", connect=(edge.address,))
    connected(car, edge)
    strangers = subprocess.Popen(
        [sys.executable, HERE / "strangers.py", str(edge.port), "5"], stdout=subprocess.PIPE
    )
    second = 0
    while strangers.poll() is None:
        second += 1
        car.links.send("edge1", REQUEST, image(second))
        time.sleep(0.05)
    until(lambda: edge.seconds()[-1] == second, "the last image arrives")
    until(lambda: edge.names() == ["car1"], "it is there")


# Sides that die, stand still, or are cut off without a word


def peer_process(
    plan: AttachPlan, *arguments: object, stderr: object = None
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.ros.link_peer", plan.to_json(), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        cwd=ADD_ON,
        env={**os.environ, "PYTHONPATH": PYTHONPATH},
    )


class Pair:
    """An edge and a car that sends 20 images a second, each in a process of its own, and what they
    have printed.
    """

    def __init__(self, keys: Keys, port: int | None = None, dialled: int | None = None) -> None:
        self.port = port or free_port()
        self.plans = {
            "edge": plan_of(keys, "edge1", "edge", listen=f"127.0.0.1:{self.port}"),
            "car": plan_of(
                keys, "car1", "car", connect=(f"edge1@127.0.0.1:{dialled or self.port}",)
            ),
        }
        self.lines: list[tuple[float, str, str]] = []
        self.processes: dict[str, subprocess.Popen[str]] = {}
        for side in self.plans:
            self.start(side)
        self.await_line("edge", "up car1", 0.0)
        self.await_line("car", "up edge1", 0.0)
        until(lambda: self.got(), "images arrive")

    def start(self, side: str) -> None:
        process = peer_process(
            self.plans[side], *([20] if side == "car" else []), stderr=subprocess.DEVNULL
        )
        self.processes[side] = process
        threading.Thread(target=self._read, args=(side, process), daemon=True).start()

    def _read(self, side: str, process: subprocess.Popen[str]) -> None:
        for line in process.stdout or ():
            self.lines.append((time.monotonic(), side, line.strip()))

    def await_line(self, side: str, line: str, since: float) -> float:
        found = until(
            lambda: [
                at
                for at, its, text in list(self.lines)
                if (its, text) == (side, line) and at >= since
            ],
            f"{side}: {line}",
        )
        return found[0] - since

    def got(self) -> list[int]:
        return [
            int(text.split()[1])
            for _, side, text in list(self.lines)
            if side == "edge" and text.startswith("got")
        ]

    def close(self) -> None:
        for process in self.processes.values():
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


@pytest.fixture
def pair(keys: Keys) -> Iterator[Pair]:
    pair = Pair(keys)
    yield pair
    pair.close()


@pytest.mark.parametrize(
    ("dies", "other", "line"), [("edge", "car", "edge1"), ("car", "edge", "car1")]
)
def test_a_side_that_is_killed_is_noticed_and_comes_back(
    pair: Pair, dies: str, other: str, line: str
):
    killed = time.monotonic()
    pair.processes[dies].kill()
    pair.processes[dies].wait()
    pair.await_line(other, f"down {line}", killed)
    before, begun = len(pair.got()), time.monotonic()
    pair.start(dies)
    pair.await_line(other, f"up {line}", begun)
    until(lambda: len(pair.got()) > before + 5, "images go on")
    if dies == "edge":
        assert len(set(pair.got())) == len(pair.got()), "nothing is delivered twice"


@pytest.mark.parametrize(
    ("stops", "other", "line"), [("edge", "car", "edge1"), ("car", "edge", "car1")]
)
def test_a_side_that_stands_still_is_noticed_and_comes_back(
    pair: Pair, stops: str, other: str, line: str
):
    stopped = time.monotonic()
    pair.processes[stops].send_signal(signal.SIGSTOP)
    pair.await_line(other, f"down {line}", stopped)
    time.sleep(3.0)  # it has dialled in vain for a while
    before, back = len(pair.got()), time.monotonic()
    pair.processes[stops].send_signal(signal.SIGCONT)
    pair.await_line(other, f"up {line}", back)
    until(lambda: len(pair.got()) > before + 5, "images go on")
    assert len(set(pair.got())) == len(pair.got()), "nothing is delivered twice"


class Wire:
    """A proxy that can forget its connections without closing them, lose bytes, or change them."""

    def __init__(self, target: int) -> None:
        self.target = target
        self.dead = threading.Event()
        self.change: Callable[[bytes], bytes] = bytes
        self.connections = 0
        self.is_open = True
        self._held: list[socket.socket] = []
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            near, _ = self._server.accept()
            self.connections += 1
            if not self.is_open:
                near.close()
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self.target))
            except OSError:
                near.close()
                continue
            self._held += [near, far]
            dead = self.dead
            for source, sink in ((near, far), (far, near)):
                threading.Thread(target=self._copy, args=(source, sink, dead), daemon=True).start()

    def cut_in_silence(self) -> None:
        """What is connected now hears nothing more, not even an end; new connections work where
        it ``is_open``.
        """
        old, self.dead = self.dead, threading.Event()
        old.set()

    def _copy(self, source: socket.socket, sink: socket.socket, dead: threading.Event) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if not dead.is_set():
                    sink.sendall(self.change(data))
        if not dead.is_set():
            for end in (source, sink):
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)


def test_a_half_open_link_is_noticed_by_both_and_comes_back(keys: Keys):
    """The car cannot dial before both have noticed: a side whose peer is back sooner has nothing to
    notice.
    """
    between = Wire(free_port())
    pair = Pair(keys, between.target, between.port)
    try:
        cut = time.monotonic()
        between.is_open = False
        between.cut_in_silence()
        for side, line in (("car", "down edge1"), ("edge", "down car1")):
            pair.await_line(side, line, cut)
        opened = time.monotonic()
        between.is_open = True
        pair.await_line("car", "up edge1", opened)
        before = len(pair.got())
        until(lambda: len(pair.got()) > before + 5, "images go on")
        assert len(set(pair.got())) == len(pair.got()), "nothing is delivered twice"
    finally:
        pair.close()


def test_a_car_that_comes_back_before_its_dead_link_is_noticed_stays(keys: Keys):
    """The edge forgets the old link after 5 s, and not the new one with it."""
    between = Wire(free_port())
    pair = Pair(keys, between.target, between.port)
    try:
        between.cut_in_silence()
        pair.processes["car"].kill()
        pair.processes["car"].wait()
        begun = time.monotonic()
        pair.start("car")
        pair.await_line("car", "up edge1", begun)
        time.sleep(links.SILENCE_S + 3.0)
        before = len(pair.got())
        until(lambda: len(pair.got()) > before + 5, "images go on")
        told = [text for _, side, text in list(pair.lines) if side == "edge"]
        assert [text for text in told if not text.startswith("got")][-1] == "up car1"
    finally:
        pair.close()


@pytest.mark.slow
def test_large_images_arrive_over_a_slow_link_the_newest_next(
    edge: Site, new_site: Callable[..., Site]
):
    """An image of 1.4 MB takes a second, and 20 a second are sent; what is in between the sockets
    arrives, and the newest two.
    """
    between = Wire(edge.port)
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{between.port}",))
    connected(car, edge)

    def slowly(data: bytes) -> bytes:
        time.sleep(len(data) / 1_400_000)
        return data

    between.change = slowly
    for second in range(1, 41):
        car.links.send("edge1", REQUEST, image(second, size=1_400_000))
        time.sleep(0.05)
    until(lambda: edge.got and edge.seconds()[-1] == 40, "the newest arrives")
    assert edge.seconds()[-2:] == [39, 40] and len(edge.got) < 40
    seconds = edge.seconds()
    assert seconds == sorted(seconds) and car.names() == ["edge1"]


def test_who_sits_on_the_wire_can_cut_it_but_not_change_it(
    edge: Site, new_site: Callable[..., Site]
):
    between = Wire(edge.port)
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{between.port}",))
    until(
        lambda: edge.names() == ["car1"] and car.names() == ["edge1"], "connected through the wire"
    )
    seen: list[bytes] = []

    def flip(data: bytes) -> bytes:
        seen.append(data)
        return data[:-1] + bytes([data[-1] ^ 1])

    between.change = flip
    car.links.send("edge1", REQUEST, image(1))
    until(lambda: edge.names() == [], "the edge has cut the connection")
    between.change = bytes
    until(lambda: edge.names() == ["car1"], "and the car dials again")
    assert edge.got == []
    assert not any(b"camera" in data or REQUEST.encode() in data for data in seen), (
        "nothing is readable"
    )


# What is said of all this


def test_the_numbers_of_the_security_page_are_those_of_the_code():
    page = " ".join((ADD_ON / "docs" / "security.md").read_text().split())
    for told in (
        f"after {links.HANDSHAKE_S:.0f} s",
        f"more than {wire.MAX_MESSAGE_BYTES // 2**20} MB",
        f"more than {wire.MAX_TEXT_BYTES // 1024} kB",
        f"more than {wire.MAX_OBJECTS_BYTES // 2**20} MB",
        f"{links.MAX_DROPPED} messages within {links.DROPPED_S:.0f} s",
        f"not heard for {links.DEAF_S:.0f} s",
        f"silent for {links.SILENCE_S:.0f} s",
        f"{links.QUEUED_RECEIVED} messages of each peer",
    ):
        assert told in page, told
