"""Two Genies over TCP, without ROS: who gets in, what gets through, and that it comes back after a cut."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from genie_sim.errors import UserError
from genie_sim.messages import Header
from genie_sim.ros import link, wire
from genie_sim.ros.gateway import Peer
from genie_sim.ros.link import TcpLinks
from genie_sim.ros.message import RosMessage, WireType
from genie_sim.ros.plan import Plan
from genie_sim.ros.ros1_codec import codec_of
from genie_sim.ros.wire import LENGTH, Handshake, Refused
from tests.ros.conftest import free_port, until

IMAGE = WireType("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743")
KEY = b"a key that is long enough"


def image(second: int, size: int = 1000) -> RosMessage:
    header = struct.pack("<IIII", 0, second, 0, 6) + b"camera"
    return RosMessage.of(header + bytes(size), codec_of(IMAGE), "car1", answer=False)


class Site:
    """One end: its links, and what they have delivered."""

    def __init__(self, folder: Path, name: str, role: str, key: bytes = KEY, **where: object) -> None:
        key_file = folder / f"{name}.key"
        key_file.write_bytes(key)
        key_file.chmod(0o600)
        plan = Plan("/node", name, role, ("/image_raw",), ("/objects",), key_file=str(key_file), **where)
        self.got: list[tuple[Peer, str, RosMessage]] = []
        self.links = TcpLinks(plan, codec_of)
        self.links.start(lambda *message: self.got.append(message))

    def names(self) -> list[str]:
        return [peer.name for peer in self.links.peers()]


@pytest.fixture
def new_site(tmp_path: Path) -> Iterator[Callable[..., Site]]:
    sites: list[Site] = []

    def make(*arguments: object, **where: object) -> Site:
        sites.append(Site(tmp_path, *arguments, **where))
        return sites[-1]

    yield make
    for site in sites:
        site.links.close()


def test_a_message_arrives_as_it_was_sent(new_site: Callable[..., Site]):
    port = free_port()
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    car = new_site("car1", "car", connect=(f"127.0.0.1:{port}",))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    for second in range(1, 4):
        car.links.send("edge1", "/image_raw_remote", image(second, size=1_400_000))
    until(lambda: len(edge.got) == 3, "three images arrive")
    assert [(peer, topic) for peer, topic, _ in edge.got] == [(Peer("car1", "car"), "/image_raw_remote")] * 3
    assert [message.header for *_, message in edge.got] == [Header(n * 10**9, "camera", "car1") for n in (1, 2, 3)]
    assert edge.got[0][2].payload == image(1, size=1_400_000).payload


def test_a_car_dials_again_until_its_edge_is_back(new_site: Callable[..., Site]):
    port = free_port()
    car = new_site("car1", "car", connect=(f"127.0.0.1:{port}",))
    for _ in range(2):
        edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
        until(lambda: car.names() == ["edge1"], "the edge is found")
        car.links.send("edge1", "/image_raw_remote", image(1))
        until(lambda edge=edge: edge.got, "an image arrives")
        edge.links.close()
        until(lambda: car.names() == [], "the cut is noticed")


def test_nobody_gets_in_without_the_key(new_site: Callable[..., Site]):
    port = free_port()
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    stranger = new_site("car1", "car", key=b"another key, also long", connect=(f"127.0.0.1:{port}",))

    for attempt in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 4096, LENGTH.pack(2**31) + b"x", os.urandom(5000)):
        with socket.create_connection(("127.0.0.1", port), timeout=10) as thief, contextlib.suppress(ConnectionError):
            thief.sendall(attempt)
            assert thief.recv(100) == b"", "a stranger learns nothing"

    # Somebody who greets well, and then goes on as if it were trusted.
    with socket.create_connection(("127.0.0.1", port), timeout=10) as thief, contextlib.suppress(ConnectionError):
        fake = Handshake(b"guessed key guessed", Peer("car1", "car"), dialling=True)
        session = wire.Session(b"guess", b"guess")
        body = wire.Writer().bodies("/image_raw_remote", image(1))[-1]
        thief.sendall(LENGTH.pack(len(fake.greeting)) + fake.greeting)
        thief.sendall(LENGTH.pack(32) + bytes(32) + session.seal(body))
        while thief.recv(4096):
            pass
    assert edge.got == [] and edge.names() == [] and stranger.names() == []

    honest = new_site("car2", "car", connect=(f"127.0.0.1:{port}",))
    until(lambda: honest.names() == ["edge1"] and edge.names() == ["car2"], "the honest still get in")


def test_idle_strangers_do_not_lock_out_the_honest(new_site: Callable[..., Site], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(link, "GREETING_S", 0.5)
    port = free_port()
    new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    with contextlib.ExitStack() as idle:
        for _ in range(2 * link.STRANGERS):
            idle.enter_context(socket.create_connection(("127.0.0.1", port)))
        car = new_site("car1", "car", connect=(f"127.0.0.1:{port}",))
        until(lambda: car.names() == ["edge1"], "the strangers have been sent away")


class Tapped:
    """Somebody between car and edge: sees every byte towards the edge, and may change them."""

    def __init__(self, port: int, change: Callable[[bytes], bytes] = bytes) -> None:
        self.seen = b""
        self._port, self._change = port, change
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._server.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            near, _ = self._server.accept()
            far = socket.create_connection(("127.0.0.1", self._port))
            threading.Thread(target=self._copy, args=(near, far, True), daemon=True).start()
            threading.Thread(target=self._copy, args=(far, near, False), daemon=True).start()

    def _copy(self, source: socket.socket, sink: socket.socket, up: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if up:
                    self.seen += data
                    data = self._change(data)
                sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


def test_who_sits_on_the_wire_can_cut_it_but_not_change_it(new_site: Callable[..., Site]):
    port = free_port()
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    tap = Tapped(port, lambda data: data.replace(b"camera", b"CAMERA"))
    car = new_site("car1", "car", connect=(tap.address,))
    until(lambda: edge.names() == ["car1"] and car.names() == ["edge1"], "connected through the tap")
    car.links.send("edge1", "/image_raw_remote", image(1))
    until(lambda: tap.seen.count(b'"nonce"') == 2, "the edge has cut the connection and the car dials again")
    assert edge.got == []


def test_what_was_heard_once_cannot_be_said_again(new_site: Callable[..., Site]):
    port = free_port()
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    tap = Tapped(port)
    car = new_site("car1", "car", connect=(tap.address,))
    until(lambda: car.names() == ["edge1"], "connected through the tap")
    car.links.send("edge1", "/image_raw_remote", image(1))
    until(lambda: len(edge.got) == 1, "the image arrives")
    with socket.create_connection(("127.0.0.1", port), timeout=10) as thief, contextlib.suppress(ConnectionError):
        thief.sendall(tap.seen)
        while thief.recv(4096):
            pass
    assert len(edge.got) == 1
    assert edge.names() == ["car1"], "the true car stays connected"


def test_a_frame_fits_in_one_place_only():
    """Altered, repeated, swapped or reflected frames are refused, whatever they hold."""
    dialler = Handshake(KEY, Peer("car1", "car"), dialling=True)
    listener = Handshake(KEY, Peer("edge1", "edge"), dialling=False)
    listener.meet(dialler.greeting)
    dialler.meet(listener.greeting)
    with pytest.raises(Refused):
        dialler.check(dialler.proof())  # its own proof, sent back
    car, edge = dialler.check(listener.proof()), listener.check(dialler.proof())
    first, second = car.seal(b"first")[LENGTH.size :], car.seal(b"second")[LENGTH.size :]
    for wrong in (second, first[:-1], first[::-1], b"", edge.seal(b"first")[LENGTH.size :]):
        with pytest.raises(Refused):
            edge.open(wrong)
    assert edge.open(first) == b"first"
    with pytest.raises(Refused):
        edge.open(first)
    assert edge.open(second) == b"second"


@pytest.mark.parametrize(
    ("greeting", "reason"),
    [
        (b"[]", "no JSON object"),
        (b'{"genie": 2, "name": "edge1", "role": "edge"}', "version 2"),
        (b'{"genie": 1, "name": "car2", "role": "car"}', "a car has nothing to say to a car"),
        (b'{"genie": 1, "name": "car1", "role": "edge"}', "called 'car1', too"),
        (b'{"genie": 1, "role": "edge"}', "name is missing"),
        (b"[" * 1000, "no JSON"),
    ],
)
def test_a_greeting_must_make_sense(greeting: bytes, reason: str):
    with pytest.raises(Refused, match=reason):
        Handshake(KEY, Peer("car1", "car"), dialling=True).meet(greeting)


def test_a_key_is_long_and_private(tmp_path: Path):
    key_file = tmp_path / "key"
    with pytest.raises(UserError, match="No such file"):
        wire.read_key(str(key_file))
    key_file.write_bytes(KEY)
    key_file.chmod(0o644)
    with pytest.raises(UserError, match="others may read it"):
        wire.read_key(str(key_file))
    key_file.write_bytes(b"short\n")
    key_file.chmod(0o600)
    with pytest.raises(UserError, match="5 bytes are too few"):
        wire.read_key(str(key_file))
