"""Two Genies over TLS, without ROS: who gets in, what gets through, and that it comes back after a
cut.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import re
import resource
import select
import shutil
import signal
import socket
import ssl
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from genie_sim.errors import UserError
from genie_sim.messages import CameraPose, Header
from genie_sim.ros import connection, frames, link, listener
from genie_sim.ros.certificates import Credentials
from genie_sim.ros.codec import WireType, codec_of
from genie_sim.ros.gateway import Peer
from genie_sim.ros.genie_process import OneLine
from genie_sim.ros.link import TlsLinks
from genie_sim.ros.message import RosMessage
from genie_sim.ros.plan import AttachPlan
from tests.ros.conftest import HERE, REPOSITORY, Keys, free_port, until

IMAGE = codec_of(WireType("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"), 1)
SCAN = codec_of(WireType("my_msgs/Scan", "0" * 32), 1)
CODECS = {"/image_raw": IMAGE, "/objects": SCAN}
REQUEST = "/image_raw_remote"
NOTICED_S, BACK_S = 12.0, 9.0  # the link takes 5 s and 1.5 s; the rest is for a machine under load


def image(second: int, size: int = 1000, codec: object = IMAGE) -> RosMessage:
    header = struct.pack("<IIII", 0, second, 0, 6) + b"camera"
    return RosMessage.of(header + bytes(size), codec, "car1", answer=False)


def plan_of(keys: Keys, name: str, role: str, **fields: object) -> AttachPlan:
    fields.setdefault("key_file", keys(name, role))
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
        self.links = TlsLinks(plan, CODECS.get)
        self.links.start(self._hear)

    def _hear(self, *message: object) -> None:
        self.got.append(message)
        self.then(*message)

    def names(self) -> list[str]:
        return [peer.name for peer in self.links.peers()]


@pytest.fixture
def new_site(keys: Keys) -> Iterator[Callable[..., Site]]:
    sites: list[Site] = []

    def make(name: str, role: str, **where: object) -> Site:
        sites.append(Site(plan_of(keys, name, role, **where)))
        return sites[-1]

    yield make
    for site in sites:
        site.links.close()


@pytest.fixture
def edge(new_site: Callable[..., Site]) -> Site:
    """An edge that listens at ``edge.port``."""
    port = free_port()
    site = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
    site.port, site.address = port, f"edge1@127.0.0.1:{port}"
    return site


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level(logging.INFO, logger="genie_sim.ros.link")
    return lambda: [
        record.getMessage() for record in caplog.records if record.levelno == logging.WARNING
    ]


def tls(
    port: int,
    pem: str,
    certificate: str | None = None,
    newest: ssl.TLSVersion = ssl.TLSVersion.TLSv1_3,
) -> ssl.SSLSocket:
    """A hand-made client with the certificate of a key file, or another ``certificate`` for its
    key.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.load_cert_chain(certificate or pem, pem)
    context.maximum_version = newest
    client = context.wrap_socket(socket.create_connection(("127.0.0.1", port), timeout=10))
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return client


def framed(*bodies: bytes) -> bytes:
    return b"".join(frames.LENGTH.pack(len(body)) + body for body in bodies)


def said(text: object, payload: bytes = b"") -> bytes:
    encoded = text if isinstance(text, bytes) else json.dumps(text).encode()
    return frames.LENGTH.pack(len(encoded)) + encoded + payload


# What gets through


def test_a_message_arrives_as_it_was_sent(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
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


def test_no_small_message_waits_for_an_acknowledgement(edge: Site, new_site: Callable[..., Site]):
    """Without TCP_NODELAY a small message right behind another one may wait for 44 ms; on both
    sides.
    """
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    ends = [*car.links._connections.values(), *edge.links._connections.values()]
    for end in ends:
        sock = end._transport.get_extra_info("socket")
        assert sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_both_directions_at_once_under_load(edge: Site, new_site: Callable[..., Site]):
    """OpenSSL serves one thread at a time; a reader and a writer that forget it break the
    connection.
    """
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    connections = [*car.links._connections.values(), *edge.links._connections.values()]
    deadline, second = time.monotonic() + 3, 0
    while time.monotonic() < deadline:
        second += 1
        car.links.send("edge1", REQUEST, image(second, size=300_000))
        edge.links.send("car1", "/objects", image(second, 300_000, SCAN))
        time.sleep(0.001)
    assert [*car.links._connections.values(), *edge.links._connections.values()] == connections, (
        "never cut"
    )
    for site in (car, edge):
        seconds = [message.header.stamp_ns for *_, message in site.got]
        assert len(seconds) > 50 and seconds == sorted(set(seconds)), "in order, none twice"


def test_one_thread_uses_a_connection(
    edge: Site, new_site: Callable[..., Site], monkeypatch: pytest.MonkeyPatch
):
    """OpenSSL says that a connection must not be used by two threads at once; what then happens is
    not defined.
    """
    users: set[int] = set()
    for name in ("_proceed", "_write", "end"):
        whole = getattr(connection.Connection, name)

        def noted(self: object, *given: object, whole: Callable[..., None] = whole) -> None:
            users.add(threading.get_ident())
            whole(self, *given)

        monkeypatch.setattr(connection.Connection, name, noted)
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    for second in range(1, 50):
        car.links.send("edge1", REQUEST, image(second, size=100_000))
        edge.links.send("car1", "/objects", image(second, 100_000, SCAN))
    until(lambda: car.got and edge.got, "both have heard")
    car.links.close()
    assert users == {car.links._thread.ident, edge.links._thread.ident}


def test_a_slow_link_holds_two_images_and_the_newest_ones(
    edge: Site, new_site: Callable[..., Site]
):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "connected")
    (link_to_edge,) = car.links._connections.values()
    car.links._call(link_to_edge.pause_writing)  # as slow as can be: nothing leaves
    for second in range(1, 9):
        car.links.send("edge1", REQUEST, image(second))
        car.links.send("edge1", "/objects", image(second, 10, SCAN))
    until(
        lambda: link_to_edge._queue and link_to_edge._queue[-1][1].header.stamp_ns == 8 * 10**9, ""
    )
    queue = list(link_to_edge._queue)
    held = [(topic, message.header.stamp_ns // 10**9) for topic, message in queue]
    assert [second for topic, second in held if topic == REQUEST] == [7, 8]
    assert len([second for topic, second in held if topic == "/objects"]) >= 7, "answers are small"


def test_a_slow_receiver_holds_the_sender_back(edge: Site, keys: Keys):
    """While a message is being delivered nothing more is read, and the sender notices."""
    release = threading.Event()
    edge.then = lambda peer, topic, message: release.wait(20)
    frame = framed(frames.encode(REQUEST, image(1, size=1_000_000)))
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(frames.PING) + frame)
        until(lambda: edge.got, "the receiver is busy")
        car.settimeout(1.0)
        sent_bytes = 0
        with contextlib.suppress(TimeoutError):
            while sent_bytes < 100e6:
                car.sendall(frame)
                sent_bytes += len(frame)
        assert sent_bytes < 40e6, "what the sockets hold"
        assert edge.names() == ["car1"] and len(edge.got) == 1
        release.set()
        until(lambda: len(edge.got) > 2, "it goes on")


def test_a_peer_that_speaks_and_never_reads_is_cut_off(
    edge: Site, keys: Keys, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    caplog.set_level(logging.INFO, logger="genie_sim.ros.link")
    monkeypatch.setattr(connection, "SILENCE_S", 1.0)
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(frames.PING))
        until(lambda: edge.names() == ["car1"], "it is up")
        for second in range(1, 11):
            edge.links.send("car1", "/objects", image(second, 5_000_000, SCAN))
        begun = time.monotonic()
        with contextlib.suppress(OSError):
            while edge.names() and time.monotonic() < begun + 10:
                car.sendall(framed(frames.PING))
                time.sleep(0.1)
    assert 0.9 < time.monotonic() - begun < 9.0
    assert "car1 is cut: reads nothing for 1 s" in caplog.text


def test_a_car_dials_again_until_its_edge_is_back(keys: Keys, new_site: Callable[..., Site]):
    port = free_port()
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{port}",))
    for _ in range(2):
        edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}")
        until(lambda: car.names() == ["edge1"], "the edge is found", BACK_S)
        car.links.send("edge1", REQUEST, image(1))
        until(lambda edge=edge: edge.got, "an image arrives")
        edge.links.close()
        until(lambda: car.names() == [], "the cut is noticed")


def test_a_link_on_which_nothing_is_said_stays(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    held = [*car.links._connections.values(), *edge.links._connections.values()]
    time.sleep(connection.SILENCE_S + 1.5)
    assert [*car.links._connections.values(), *edge.links._connections.values()] == held


@pytest.mark.parametrize(("stable_s", "is_dialled_at_once"), [(0.2, True), (1000.0, False)])
def test_a_link_that_was_stable_is_dialled_again_at_once(
    edge: Site,
    new_site: Callable[..., Site],
    monkeypatch: pytest.MonkeyPatch,
    stable_s: float,
    is_dialled_at_once: bool,
):
    """One that never lasts is not: two sides that shut each other out would dial without end."""
    monkeypatch.setattr(link, "RETRY_S", (0.05, 60.0))
    monkeypatch.setattr(link, "STABLE_S", stable_s)
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    time.sleep(0.4)
    (first,) = car.links._connections.values()
    car.links._call(first.end, ConnectionAbortedError("cut"))
    until(lambda: first not in car.links._connections.values(), "it is cut")
    if is_dialled_at_once:
        until(lambda: car.names() == ["edge1"], "it is dialled again")
    else:
        time.sleep(1.0)
        assert car.names() == []


def test_two_edges_that_dial_each_other_settle_on_one_connection(new_site: Callable[..., Site]):
    at = [f"127.0.0.1:{free_port()}" for _ in range(2)]
    edges = [
        new_site("edge0", "edge", listen=at[0], connect=(f"edge1@{at[1]}",)),
        new_site("edge1", "edge", listen=at[1], connect=(f"edge0@{at[0]}",)),
    ]
    until(lambda: [edge.names() for edge in edges] == [["edge1"], ["edge0"]], "both are connected")
    time.sleep(2.0)
    settled = [list(edge.links._connections.values()) for edge in edges]
    time.sleep(2.0)
    assert [list(edge.links._connections.values()) for edge in edges] == settled and len(
        settled[0]
    ) == 1


# Who gets in


def test_who_has_no_certificate_learns_nothing(edge: Site, warnings: Callable[[], list[str]]):
    for attempt in (
        b"GET / HTTP/1.1\r\n\r\n",
        b"\xff" * 4096,
        struct.pack(">I", 2**31) + b"x",
        os.urandom(5000),
    ):
        with (
            socket.create_connection(("127.0.0.1", edge.port), timeout=10) as thief,
            contextlib.suppress(OSError),
        ):
            thief.sendall(attempt)
            assert len(thief.recv(100)) <= 7, "an alert at most"
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    plain = socket.create_connection(("127.0.0.1", edge.port), timeout=10)
    with context.wrap_socket(plain) as thief, contextlib.suppress(OSError):
        thief.sendall(framed(frames.PING, frames.encode(REQUEST, image(1))))
        assert thief.recv(100) == b""
    until(lambda: len(warnings()) == 5, "a line for each of them")
    assert edge.got == [] and edge.names() == []
    assert all(
        "\n" not in line and line.startswith("link: refused 127.0.0.1:") for line in warnings()
    )


def test_older_tls_is_refused(edge: Site, keys: Keys):
    with pytest.raises(ssl.SSLError, match="PROTOCOL_VERSION"):
        tls(edge.port, keys("car1", "car"), newest=ssl.TLSVersion.TLSv1_2)


@pytest.mark.parametrize(
    ("case", "line"),
    [
        (
            "another authority",
            "unable to get local issuer certificate|self-signed certificate in certificate chain",
        ),
        ("expired", "certificate has expired"),
        ("no name", "a certificate that names no Genie"),
        ("two names", "a certificate that names no Genie"),
        ("a host's", "a certificate that names no Genie"),
        ("a newline in its name", "a certificate that names no Genie"),
        ("the listener's own name", "both sides are called edge1"),
    ],
)
def test_a_wrong_certificate_is_refused_with_one_line(
    edge: Site, keys: Keys, warnings: Callable[[], list[str]], case: str, line: str
):
    names = {
        "no name": "",
        "two names": "URI:genie:car/car1,URI:genie:edge/car1",
        "a host's": "DNS:car1",
        "a newline in its name": "URI:genie:car/car1\\nlink: x",
    }
    pem, certificate = keys("car1", "car"), None
    if case == "another authority":
        pem = keys.other("car1", "car")
    elif case == "the listener's own name":
        pem = keys("edge1", "edge")
    else:
        certificate = keys.certificate(
            pem, names.get(case, "URI:genie:car/car1"), -1 if case == "expired" else 1
        )
    with contextlib.suppress(OSError), tls(edge.port, pem, certificate) as thief:
        thief.sendall(framed(frames.PING, frames.encode(REQUEST, image(1))))
        while thief.recv(4096):
            pass
    until(warnings, "a line")
    time.sleep(0.2)
    assert len(warnings()) == 1 and "\n" not in warnings()[0]
    assert re.search(line, warnings()[0]), warnings()
    assert edge.got == [] and edge.names() == []


class Listener:
    """Somebody at the address that a car dials, with the certificate of a key file."""

    def __init__(self, pem: str) -> None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(pem)
        self.heard = b""
        self._server = socket.create_server(("127.0.0.1", 0))
        self._context = context
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                sock, _ = self._server.accept()
                with (
                    contextlib.suppress(OSError),
                    self._context.wrap_socket(sock, server_side=True) as secure,
                ):
                    secure.sendall(framed(frames.PING))
                    while data := secure.recv(4096):
                        self.heard += data

    def close(self) -> None:
        socket.socket.shutdown(self._server, socket.SHUT_RDWR)
        self._server.close()


@pytest.mark.parametrize(
    ("name", "role", "line"),
    [
        ("edge2", "edge", "it is edge edge2, not edge1"),  # right authority, another name
        # a car that poses as an edge
        ("edge1", "car", "edge1 is a car; cars do not connect to cars"),
        (
            "elsewhere",
            "edge",
            "unable to get local issuer certificate|self-signed certificate in certificate chain",
        ),
    ],
)
def test_a_car_checks_whom_it_has_reached(
    *,
    keys: Keys,
    new_site: Callable[..., Site],
    warnings: Callable[[], list[str]],
    name: str,
    role: str,
    line: str,
):
    pem = keys.other("edge1", "edge") if name == "elsewhere" else keys(name, role, f"{name}-{role}")
    impostor = Listener(pem)
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{impostor.port}",))
    until(warnings, "a line")
    time.sleep(1.0)  # it dials again and again, and says so once
    car.links.send("edge1", REQUEST, image(1))
    impostor.close()
    assert re.search(line, warnings()[0]) and len(set(warnings())) == len(warnings())
    assert sum(bool(re.search(line, text)) for text in warnings()) == 1
    assert impostor.heard == b"" and car.names() == []


def test_a_genie_that_says_it_is_what_its_certificate_does_not_say_does_not_start(keys: Keys):
    car = keys("car1", "car")
    with pytest.raises(UserError, match="key: of car car1; this Genie is edge car1"):
        TlsLinks(plan_of(keys, "car1", "edge", key_file=car, listen="127.0.0.1:0"), CODECS.get)
    with pytest.raises(UserError, match="key: of car car1; this Genie is car car2"):
        TlsLinks(
            plan_of(keys, "car2", "car", key_file=car, connect=("edge1@127.0.0.1:1",)), CODECS.get
        )
    with pytest.raises(UserError, match="does not say whom to connect to; write name@host:port"):
        TlsLinks(plan_of(keys, "car1", "car", connect=("127.0.0.1:1",)), CODECS.get)


def hear(sock: ssl.SSLSocket) -> bytes:
    """All that comes until the other side hangs up."""
    heard = b""
    with contextlib.suppress(OSError):
        while data := sock.recv(4096):
            heard += data
    return heard


def test_the_certificate_that_was_issued_last_has_the_name(
    edge: Site, keys: Keys, warnings: Callable[[], list[str]]
):
    """So a renewed key takes over, and a copy of the old one is kept out and told why."""

    def dial(pem: str) -> ssl.SSLSocket:
        client = tls(edge.port, pem)
        client.sendall(framed(frames.PING))
        return client

    def new_connection(*older: object) -> object:
        return until(
            lambda: (now := edge.links._connections.get("car1")) not in (None, *older) and now,
            "it counts",
        )

    keys("car1", "car")
    time.sleep(1.1)  # certificates count seconds
    keys("car1", "car", "renewed")
    with dial(keys("car1", "car")) as old:
        first = new_connection()
        with dial(keys("car1", "car", "renewed")) as renewed:
            second = new_connection(first)
            hear(old)
            with dial(keys("car1", "car")) as old_again:
                assert b"car car1 is connected with another certificate" in hear(old_again)
            (line,) = until(warnings, "a line")
            assert "car car1 is connected with another certificate" in line
            assert edge.links._connections["car1"] is second
            with dial(keys("car1", "car", "renewed")):
                new_connection(first, second)
                hear(renewed)
                assert edge.names() == ["car1"], "the end of the older does not end the newer"


def serial(pem: str) -> str:
    """The serial number of a key file's certificate."""
    shown = subprocess.run(
        ["openssl", "x509", "-in", pem, "-noout", "-serial"], capture_output=True, text=True
    )
    return shown.stdout.strip().removeprefix("serial=")


@pytest.mark.parametrize(
    ("case", "line"),
    [
        ("an older certificate", "it refuses: car car1 is connected with another certificate"),
        ("revoked", "it refuses: the certificate of car1 is revoked"),
    ],
)
def test_who_is_refused_learns_why_and_waits(
    *,
    new_site: Callable[..., Site],
    keys: Keys,
    warnings: Callable[[], list[str]],
    tmp_path: Path,
    case: str,
    line: str,
):
    old, port, revoked = keys("car1", "car"), free_port(), tmp_path / "revoked.txt"
    revoked.write_text(serial(old) if case == "revoked" else "# nothing\n")
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}", revoked_file=str(revoked))
    if case == "an older certificate":
        time.sleep(1.1)  # certificates count seconds
        newer = keys("car1", "car", "newer")
        new_site("car1", "car", connect=(f"edge1@127.0.0.1:{port}",), key_file=newer)
        until(lambda: edge.names() == ["car1"], "the newer one is connected")
    between = Wire(port)
    new_site("car1", "car", connect=(f"edge1@127.0.0.1:{between.port}",), key_file=old)
    until(
        lambda: any(f"edge1@127.0.0.1:{between.port}: {line}" in text for text in warnings()), line
    )
    time.sleep(4.0)
    assert between.connections == 1, "it waits"


def test_tls_says_why_to_a_certificate_of_another_authority(edge: Site, keys: Keys):
    with tls(edge.port, keys.other("car1", "car")) as car:
        with contextlib.suppress(OSError):
            car.sendall(bytes(100_000))  # it is not lost among what nobody has read
        with pytest.raises(ssl.SSLError, match="UNKNOWN_CA"):
            car.recv(100)


def test_who_is_refused_is_not_reset(edge: Site):
    """A reset could overtake what says why. The edge hangs up a second later."""
    with socket.create_connection(("127.0.0.1", edge.port), timeout=10) as stranger:
        stranger.sendall(b"GET / HTTP/1.1\r\n\r\n")
        while stranger.recv(100):
            pass
        for _ in range(3):
            stranger.sendall(b"more")
            time.sleep(0.1)
        assert edge.links._open, "it waits"
        until(lambda: not edge.links._open, "but not for long", 3.0)


def test_a_revoked_certificate_is_cut_off_and_others_stay(
    new_site: Callable[..., Site], keys: Keys, warnings: Callable[[], list[str]], tmp_path: Path
):
    """The list is read again when it changes; one that cannot be read changes nothing."""
    port, revoked = free_port(), tmp_path / "revoked.txt"
    revoked.write_text("# none yet\n")
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}", revoked_file=str(revoked))
    for name in ("car1", "car2"):
        new_site(name, "car", connect=(f"edge1@127.0.0.1:{port}",))
    until(lambda: sorted(edge.names()) == ["car1", "car2"], "both are connected")
    held = edge.links._connections["car2"]
    revoked.write_text(f"# stolen\n{serial(keys('car1', 'car')).lower()}  # on the way home\n")
    until(lambda: edge.names() == ["car2"], "car1 is cut off", 2.0)
    revoked.write_text("0123\nno number\n")
    until(lambda: any("line 2: 'no number' is no serial number" in text for text in warnings()), "")
    revoked.unlink()
    until(lambda: any("revoked: No such file" in text for text in warnings()), "it is said")
    with contextlib.suppress(OSError), tls(port, keys("car1", "car")) as car:
        car.sendall(framed(frames.PING))
        assert b"the certificate of car1 is revoked" in hear(car)
    time.sleep(1.2)  # it is said once
    assert edge.links._connections == {"car2": held}
    assert sum("the list that was read before still counts" in text for text in warnings()) == 2


def test_keys_are_renewed_without_a_gap(
    new_site: Callable[..., Site],
    keys: Keys,
    warnings: Callable[[], list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    """First the car's file is replaced, then the edge's; images flow on, and each side is always
    connected.
    """
    monkeypatch.setattr(link, "RENEW_EVERY_S", 0.5)
    files = {"car1": tmp_path / "car1.pem", "edge1": tmp_path / "edge1.pem"}
    for name, role in (("car1", "car"), ("edge1", "edge")):
        shutil.copy(keys(name, role), files[name])
    time.sleep(1.1)  # certificates count seconds
    port = free_port()
    edge = new_site("edge1", "edge", listen=f"127.0.0.1:{port}", key_file=str(files["edge1"]))
    car = new_site("car1", "car", connect=(f"edge1@127.0.0.1:{port}",), key_file=str(files["car1"]))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")

    def renew(name: str, role: str) -> None:
        shutil.copy(keys(name, role, "renewed"), tmp_path / "beside")
        (tmp_path / "beside").replace(files[name])

    second, gaps, serials = 0, 0, set()
    begun = time.monotonic()
    while len(serials) < 4 and time.monotonic() < begun + 10:
        second += 1
        if second == 20:
            renew("car1", "car")
        elif second == 200:
            new_serial = int(serial(keys("car1", "car", "renewed")), 16)
            assert edge.links._connections["car1"].certificate.serial == new_serial
            monkeypatch.setattr(link, "RENEW_S", 366 * 86_400.0)  # the edge's ends soon
            renew("edge1", "edge")
        gaps += car.names() != ["edge1"] or edge.names() != ["car1"]
        for site in (car, edge):
            ends = site.links._connections.values()
            serials |= {end.certificate.serial for end in ends}
        car.links.send("edge1", REQUEST, image(second))
        time.sleep(0.01)
    until(lambda: edge.got[-1][2].header.stamp_ns == second * 10**9, "the last one arrives")
    assert len(serials) == 4 and gaps == 0 and warnings() == []
    assert len(edge.got) > 0.98 * second, "an image on its way may be lost with the old connection"
    (tmp_path / "beside").write_text("no key")
    (tmp_path / "beside").chmod(0o600)
    (tmp_path / "beside").replace(files["car1"])
    until(
        lambda: any("the key that was read before still counts" in text for text in warnings()), ""
    )
    time.sleep(1.2)  # it is said once
    assert car.names() == ["edge1"] and len(warnings()) == 1


def test_what_is_too_long_for_a_frame_is_not_sent(
    edge: Site, new_site: Callable[..., Site], warnings: Callable[[], list[str]]
):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"], "connected")
    (held,) = car.links._connections.values()
    car.links.send("edge1", REQUEST, image(1, size=frames.MAX_FRAME_BYTES))
    car.links.send("edge1", REQUEST, image(2))
    until(lambda: edge.got, "the next one arrives")
    assert "cannot be written" in warnings()[0] and len(edge.got) == 1
    assert list(car.links._connections.values()) == [held]


def test_a_peer_counts_from_its_first_frame(edge: Site, keys: Keys):
    with tls(edge.port, keys("car1", "car")) as quiet:
        time.sleep(0.5)
        assert edge.names() == []
        assert len(edge.links._limiter.pending) == 1
        quiet.sendall(framed(frames.PING))
        until(lambda: edge.names() == ["car1"], "now it is up")
        assert not edge.links._limiter.pending


def test_a_connection_ends_with_its_certificate(
    edge: Site, keys: Keys, monkeypatch: pytest.MonkeyPatch
):
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(frames.PING))
        until(lambda: edge.names() == ["car1"], "it is up")
        later_s = time.time() + 366 * 86_400
        monkeypatch.setattr(connection.time, "time", lambda: later_s)
        car.sendall(framed(frames.PING))
        until(lambda: edge.names() == [], "it is cut", 2.0)


def test_a_clock_that_goes_back_cuts_nothing(
    edge: Site, new_site: Callable[..., Site], monkeypatch: pytest.MonkeyPatch
):
    """Only the end of a certificate is looked up in the time of day; everything else is counted by
    a steady clock.
    """
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    held, now_s = (
        [*car.links._connections.values(), *edge.links._connections.values()],
        [time.time()],
    )

    def back() -> float:
        now_s[0] -= 3600
        return now_s[0]

    monkeypatch.setattr(time, "time", back)
    for second in (3, 2, 1):  # and so do the stamps of what is sent
        car.links.send("edge1", REQUEST, image(second))
        until(lambda second=second: len(edge.got) == 4 - second, "an image arrives")
    time.sleep(connection.PING_S + 0.2)
    assert [*car.links._connections.values(), *edge.links._connections.values()] == held
    assert [message.header.stamp_ns // 10**9 for *_, message in edge.got] == [3, 2, 1]


@pytest.mark.nightly
def test_a_million_frames_arrive_in_order_and_nothing_piles_up(
    edge: Site, new_site: Callable[..., Site]
):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "both are connected")
    seen, begun, grown = [0], time.monotonic(), [0]
    edge.then = lambda peer, topic, message: (
        seen.append(message.header.stamp_ns // 10**9) or edge.got.clear()
    )
    for sent in range(1, 1_000_001):
        car.links.send("edge1", REQUEST, image(sent))
        while sent - seen[-1] > 1:  # two may wait, so none is dropped
            time.sleep(0)
        if sent in (100_000, 1_000_000):
            grown.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    until(lambda: len(seen) > 1_000_000, "the last one arrives")
    assert seen == list(range(1_000_001)), "in order, none twice, none lost"
    growth_mb = (grown[2] - grown[1]) / 1024
    print(
        f"a million frames in {time.monotonic() - begun:.0f} s, {growth_mb:.0f} MB more meanwhile"
    )
    assert growth_mb < 100, "the list of what was seen, 36 MB, and little else"


# What a peer may say

PAYLOAD = image(1).payload
MESSAGE = {
    "topic": REQUEST,
    "type": IMAGE.type[:2],
    "origin": "car1",
    "source": "detector",
    "served_by": "",
}


def other(**fields: object) -> bytes:
    """A good message but for these fields."""
    return said({**MESSAGE, **fields}, PAYLOAD)


NONSENSE = [
    b"",
    b"\0\0",
    said(b"["),
    said([]),
    said({}),
    said(7),
    said(b"[" * 100_000),
    struct.pack(">I", 2**32 - 1) + b"{}",
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
    said(MESSAGE),
    said(MESSAGE, b"short"),
    said(MESSAGE, struct.pack("<IIII", 0, 1, 2**32 - 1, 0)),
]


def test_nonsense_of_a_peer_costs_it_the_message_and_a_line(
    edge: Site, keys: Keys, warnings: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(link, "WARNINGS_PER_S", 1000)
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(*NONSENSE, frames.encode(REQUEST, image(1))))
        until(lambda: edge.got, "after all that an image is heard")
    assert len(edge.got) == 1 and len(warnings()) == len(NONSENSE)
    assert all(
        "\n" not in line and line.startswith("link: dropped a message of car1: ")
        for line in warnings()
    )


def test_definitions_do_not_travel():
    typed = codec_of(WireType("my_msgs/Thing", "1" * 32, "Header header\nint32 x\n"), 1)
    assert b"int32 x" not in frames.encode(REQUEST, image(1, 4, typed))


def test_a_dialler_dials_again_whatever_has_happened(
    edge: Site, new_site: Callable[..., Site], monkeypatch: pytest.MonkeyPatch
):
    """Also what nobody has thought of: every way of an attempt to end is an end of this attempt
    only.
    """
    met, raised = (
        [],
        [RuntimeError("x"), ValueError("y"), OverflowError("z"), MemoryError(), OSError(5, "w")],
    )
    whole = link.check

    def check(*arguments: object) -> None:
        met.append(arguments)
        if (
            raised
            and threading.current_thread() is not threading.main_thread()
            and arguments[2] is not None
        ):
            raise raised.pop()
        whole(*arguments)

    monkeypatch.setattr(link, "check", check)
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"], "connected in the end")
    assert not raised


def test_what_the_receiver_raises_ends_nothing(edge: Site, new_site: Callable[..., Site]):
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"] and edge.names() == ["car1"], "connected")

    def then(peer: Peer, topic: str, message: RosMessage) -> None:
        raise (UserError("no hash for this"), KeyError("x"), ValueError("short"))[len(edge.got) % 3]

    edge.then = then
    held = list(edge.links._connections.values())
    for second in range(1, 7):
        car.links.send("edge1", REQUEST, image(second))
        until(lambda second=second: len(edge.got) == second, "the next one is heard")
    assert list(edge.links._connections.values()) == held


def test_a_frame_that_is_too_long_cuts_the_link(edge: Site, keys: Keys):
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(frames.PING))
        until(lambda: edge.names() == ["car1"], "it is up")
        car.sendall(struct.pack(">I", frames.MAX_FRAME_BYTES + 1))
        until(lambda: edge.names() == [], "it is cut", 2.0)


def test_the_first_frame_is_a_short_one(edge: Site, keys: Keys):
    """Nobody may fill the memory before anything is known but a certificate."""
    with tls(edge.port, keys("car1", "car")) as car:
        car.sendall(framed(bytes(1000)))
        assert b"a frame of 1000 bytes; the limit is 260" in hear(car)
    assert edge.names() == []


# Strangers


def reachable(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
        return True
    return False


def attack(keys: Keys, tmp_path: Path, seconds: float) -> list[float]:
    """How long a right client needs to get in [s], while 400 sit there and 200 a second throw
    bytes.
    """
    port = free_port()
    log = (tmp_path / "edge.log").open("w")
    edge = peer_process(plan_of(keys, "edge1", "edge", listen=f"127.0.0.1:{port}"), stderr=log)
    until(lambda: reachable(port), "the edge listens")
    strangers = subprocess.Popen(
        [sys.executable, HERE / "strangers.py", str(port), str(seconds + 5)],
        stdout=subprocess.PIPE,
        text=True,
    )
    took_s = []
    try:
        assert strangers.stdout is not None and strangers.stdout.readline() == "busy\n"
        deadline = time.monotonic() + seconds
        plan = plan_of(keys, "car1", "car", connect=(f"edge1@127.0.0.1:{port}",))
        while time.monotonic() < deadline:
            begun = time.monotonic()
            car = Site(plan)
            until(lambda car=car: car.names() == ["edge1"], "the right client gets in")
            took_s.append(time.monotonic() - begun)
            car.links.close()
            time.sleep(0.2)
        assert edge.poll() is None
    finally:
        for process in (edge, strangers):
            process.kill()
            process.wait()
        log.close()
    assert (tmp_path / "edge.log").stat().st_size < 1000 * (seconds + 10) * link.WARNINGS_PER_S, (
        "the disk is safe"
    )
    return took_s


@pytest.mark.parametrize("seconds", [5, pytest.param(60, marks=pytest.mark.nightly)])
def test_strangers_do_not_keep_a_right_client_out(keys: Keys, tmp_path: Path, seconds: int):
    took_s = attack(keys, tmp_path, seconds)
    median_s, most_s = statistics.median(took_s), max(took_s)
    print(f"{len(took_s)} times in, after {median_s:.3f} s, at most {most_s:.3f} s")
    assert len(took_s) >= 3 and median_s < 1.0, sorted(took_s)[-10:]


def test_a_dozen_peers_behind_one_address_get_in_at_a_time(edge: Site, keys: Keys):
    """Cars in one network share an address; that all of them come back at once is how an edge
    begins its day.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.load_cert_chain(keys("car1", "car"))
    waiting = [socket.create_connection(("127.0.0.1", edge.port), timeout=10) for _ in range(12)]
    time.sleep(0.3)  # all of them are in their handshake
    for sock in waiting:
        with context.wrap_socket(sock) as secure:
            assert secure.recv(8) == framed(frames.PING), (
                "it is heard, and told that somebody is there"
            )


def test_no_more_strangers_than_allowed_and_the_oldest_makes_room(edge: Site):
    with contextlib.ExitStack() as stack:
        socks = []
        for _ in range(listener.MAX_PENDING_OF_ONE_HOST + 5):
            socks.append(
                stack.enter_context(socket.create_connection(("127.0.0.1", edge.port), timeout=10))
            )
            time.sleep(0.02)
        assert set(select.select(socks, [], [], 0.3)[0]) == set(socks[:5]), "these are gone"
        held = edge.links._limiter.pending
        for host in range(2, 8):  # other hosts have their own share, up to what all have together
            for _ in range(listener.MAX_PENDING_OF_ONE_HOST):
                sock = stack.enter_context(socket.socket())
                sock.bind((f"127.0.0.{host}", 0))
                sock.connect(("127.0.0.1", edge.port))
        time.sleep(0.2)
        assert len(held) == listener.MAX_PENDING


def memory_bytes(pid: int, name: str) -> int:
    """``VmRSS``, what a process holds, or ``VmHWM``, the most that it has held."""
    text = Path(f"/proc/{pid}/status").read_text()
    return int(re.search(rf"{name}:\s+(\d+) kB", text)[1]) * 1024


@pytest.mark.parametrize("first", [(), (frames.PING,)], ids=["at once", "after its first frame"])
def test_announced_frames_take_no_memory(keys: Keys, tmp_path: Path, first: tuple[bytes, ...]):
    """40 connections with one car's key announce 64 MB each and then send a byte now and then."""
    port = free_port()
    with (tmp_path / "edge.log").open("w") as log:
        edge = peer_process(plan_of(keys, "edge1", "edge", listen=f"127.0.0.1:{port}"), stderr=log)
    try:
        until(lambda: reachable(port), "the edge listens")
        before = memory_bytes(edge.pid, "VmRSS")
        with contextlib.ExitStack() as stack:
            greedy = []
            for _ in range(40):
                with contextlib.suppress(OSError):
                    greedy.append(stack.enter_context(tls(port, keys("car1", "car"))))
                    greedy[-1].sendall(framed(*first) + frames.LENGTH.pack(frames.MAX_FRAME_BYTES))
            for sock in greedy:
                with contextlib.suppress(OSError):
                    sock.sendall(b"x")
            begun = time.monotonic()
            car = Site(plan_of(keys, "car2", "car", connect=(f"edge1@127.0.0.1:{port}",)))
            until(lambda: car.names() == ["edge1"], "the right client gets in")
            took_s = time.monotonic() - begun
            car.links.close()
            descriptors = len(list(Path(f"/proc/{edge.pid}/fd").iterdir()))
        peak = memory_bytes(edge.pid, "VmHWM")
        print(f"{before >> 20} MB, at most {peak >> 20} MB; the right client after {took_s:.3f} s")
        assert peak < 200 * 10**6 and peak - before < 20 * 10**6
        assert took_s < 10.0, "greedy connections hold it up"
        assert descriptors < 20, "few connections of one certificate are held"
        assert edge.poll() is None
    finally:
        edge.kill()
        edge.wait()


def test_few_connections_of_one_certificate_wait(edge: Site, keys: Keys):
    with contextlib.ExitStack() as stack:
        quiet = [stack.enter_context(tls(edge.port, keys("car1", "car"))) for _ in range(6)]
        until(lambda: len(edge.links._limiter.pending) == 2, "the others had to go")
        assert [sock for sock in quiet if sock in select.select(quiet[:4], [], [], 0.5)[0]]
        quiet[-1].sendall(framed(frames.PING))
        until(lambda: edge.names() == ["car1"], "the newest one counts")


def test_a_frame_has_a_deadline(
    edge: Site, keys: Keys, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    """A byte now and then keeps no connection alive, whether the frame is its first or not."""
    caplog.set_level(logging.INFO, logger="genie_sim.ros.link")
    monkeypatch.setattr(connection, "FRAME_S", 1.0)
    for beginning in (framed(frames.PING) + frames.LENGTH.pack(1000), frames.LENGTH.pack(100)):
        begun = time.monotonic()
        with tls(edge.port, keys("car1", "car")) as slow:
            slow.sendall(beginning)
            with contextlib.suppress(OSError):
                while time.monotonic() < begun + 10:
                    slow.sendall(b"x")
                    time.sleep(0.2)
        assert 0.9 < time.monotonic() - begun < 9.0
    until(lambda: caplog.text.count("a frame that takes more than 1 s") == 2, "it is said")


def test_a_stranger_has_two_seconds(edge: Site):
    with socket.create_connection(("127.0.0.1", edge.port), timeout=10) as idle:
        begun = time.monotonic()
        with contextlib.suppress(ConnectionError):
            idle.recv(1)
        assert 1.5 < time.monotonic() - begun < 9.0


def test_nothing_ends_the_loop_that_accepts(
    edge: Site, new_site: Callable[..., Site], warnings: Callable[[], list[str]]
):
    """The process runs out of descriptors; when it has some again, the next client gets in."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    port = edge.port
    waiting = [socket.socket() for _ in range(3)]
    taken = [os.dup(0)]
    resource.setrlimit(resource.RLIMIT_NOFILE, (taken[0] + 1, hard))
    try:
        with contextlib.suppress(OSError):
            while True:
                taken.append(os.dup(0))
        for sock in waiting:
            sock.connect(("127.0.0.1", port))
        until(
            lambda: any("cannot accept: Too many open files" in line for line in warnings()),
            "it has run out",
        )
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for number in taken:
            os.close(number)
        for sock in waiting:
            sock.close()
    car = new_site("car1", "car", connect=(edge.address,))
    until(lambda: car.names() == ["edge1"], "the next one gets in", 1.0)


# Sides that die, stand still, or are cut off without a word


def peer_process(
    plan: AttachPlan, *arguments: object, stderr: object = None
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.ros.link_peer", plan.to_json(), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
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

    def await_line(self, side: str, line: str, since: float, patience_s: float = 20.0) -> float:
        found = until(
            lambda: [
                at
                for at, its, text in list(self.lines)
                if (its, text) == (side, line) and at >= since
            ],
            f"{side}: {line}",
            patience_s,
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
    assert pair.await_line(other, f"down {line}", killed) < NOTICED_S
    before = len(pair.got())
    begun = time.monotonic()
    pair.start(dies)
    ready = begun + pair.await_line(dies, "ready", begun)
    assert begun + pair.await_line(other, f"up {line}", begun) < ready + BACK_S
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
    assert pair.await_line(other, f"down {line}", stopped) < NOTICED_S
    time.sleep(3.0)  # it has dialled in vain for a while
    assert link.RETRY_S[1] < BACK_S
    before, back = len(pair.got()), time.monotonic()
    pair.processes[stops].send_signal(signal.SIGCONT)
    assert pair.await_line(other, f"up {line}", back) < BACK_S
    until(lambda: len(pair.got()) > before + 5, "images go on")
    assert len(set(pair.got())) == len(pair.got()), "nothing is delivered twice"


class Wire:
    """A proxy that can forget its connections without closing them, lose bytes, or change them."""

    def __init__(self, target: int) -> None:
        self.target = target
        self.dead = threading.Event()
        self.change: Callable[[bytes], bytes] = bytes
        self.connections = 0
        self._held: list[socket.socket] = []
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            near, _ = self._server.accept()
            self.connections += 1
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
        """What is connected now hears nothing more, not even an end; new connections work."""
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


@pytest.mark.alone
def test_a_half_open_link_is_noticed_by_both_and_comes_back(keys: Keys):
    between = Wire(free_port())
    pair = Pair(keys, between.target, between.port)
    try:
        cut = time.monotonic()
        between.cut_in_silence()
        noticed = [
            pair.await_line("car", "down edge1", cut),
            pair.await_line("edge", "down car1", cut),
        ]
        assert max(noticed) < NOTICED_S
        assert pair.await_line("car", "up edge1", cut) - noticed[0] < BACK_S
        before = len(pair.got())
        until(lambda: len(pair.got()) > before + 5, "images go on")
        assert len(set(pair.got())) == len(pair.got()), "nothing is delivered twice"
    finally:
        pair.close()


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
    until(lambda: edge.names() == ["car1"], "and the car dials again", BACK_S)
    assert edge.got == []
    assert not any(b"camera" in data or REQUEST.encode() in data for data in seen), (
        "nothing is readable"
    )


# The key file, and what is said of all this


def test_the_numbers_of_the_security_page_are_those_of_the_code():
    page = " ".join((REPOSITORY / "docs" / "explanation" / "security.md").read_text().split())
    for told in (
        f"after {connection.HANDSHAKE_S:.0f} s. At most {listener.MAX_PENDING} of them",
        f"{listener.MAX_PENDING_OF_ONE_HOST} from one address",
        f"at most {link.WARNINGS_PER_S} a second",
        f"more than {frames.MAX_FRAME_BYTES // 2**20} MB",
        f"Each ends after {connection.SILENCE_S:.0f} s",
        f"within {connection.SILENCE_S + connection.PING_S:.0f} s",
        f"dials again after {link.REFUSED_S:.0f} s at most",
        f"hold {frames.MAX_FIRST_FRAME_BYTES} bytes",
        f"only {listener.MAX_PENDING_OF_ONE_CERTIFICATE} such connections",
        f"more than {connection.FRAME_S:.0f} s ends the connection",
    ):
        assert told in page, told
    assert (listener.MAX_PENDING, listener.MAX_PENDING_OF_ONE_HOST, connection.HANDSHAKE_S) == (
        64,
        16,
        2.0,
    ), "a change is a decision"


def test_a_line_of_the_log_is_one_line_whatever_it_quotes():
    quoted = "a\nlink: edge1 is connected\x1b[2J\u2028"
    record = logging.LogRecord("x", logging.WARNING, "", 0, "refused: %s", (quoted,), None)
    assert OneLine().format(record) == "refused: a\\nlink: edge1 is connected\\x1b[2J\\u2028"


def test_a_key_file_is_private_and_whole(tmp_path: Path, keys: Keys):
    path = tmp_path / "car1.pem"
    with pytest.raises(UserError, match="No such file"):
        Credentials(str(path))
    text = Path(keys("car1", "car")).read_text()
    path.write_text(text)
    path.chmod(0o644)
    with pytest.raises(UserError, match="others may read it; chmod 600"):
        Credentials(str(path))
    path.chmod(0o600)
    assert Credentials(str(path)).owner == Peer("car1", "car")
    for wrong, line in (
        ("", "0 certificates, not 2"),
        ("\xff", "no PEM file"),
        (text.replace("M", "N", 3), "key: "),
    ):
        path.write_bytes(wrong.encode("latin-1"))
        with pytest.raises(UserError, match=line):
            Credentials(str(path))
    expired = Path(keys.certificate(keys("car1", "car"), "URI:genie:car/car1", -1)).read_text()
    mark = "-----BEGIN CERTIFICATE-----"
    path.write_text(text.split(mark)[0] + expired + mark + text.split(mark)[2])
    with pytest.raises(UserError, match="certificate has expired"):
        Credentials(str(path))
