"""A real link beside the simulated one: TCP between two network namespaces, shaped by tbf (needs
root).

``python reality_link.py receive PORT COUNT`` and ``send HOST PORT SIZE COUNT`` are its two ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

PORT = 7412
REPEATED = 5  # transfers of a kind; their median counts, and their range is the machine's noise
NS_PER_MS = 10**6
# tbf counts Ethernet, IP and TCP headers with time stamps; it knows nothing of preamble, gap and
# check sequence.
TBF_OVERHEAD_BYTES = 14 + 20 + 32
BURST_BYTES = 1600  # one packet: what the token bucket lets through at once
Netns = tuple[str, str]


def why_not() -> str | None:
    """Why there can be no namespaces here; ``None``: there can."""
    try:
        with namespaces(10**8):
            return None
    except (OSError, subprocess.CalledProcessError) as error:
        told = getattr(error, "stderr", "") or str(error)
        return f"no shaped link between network namespaces: {told.strip().splitlines()[-1]}"


@contextlib.contextmanager
def namespaces(rate_bps: int) -> Iterator[Netns]:
    """Two network namespaces joined by a veth pair; what the first one sends is shaped to
    ``rate_bps``.
    """
    car, edge = f"genie-car-{os.getpid()}", f"genie-edge-{os.getpid()}"

    def ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True, text=True)

    try:
        for name in (car, edge):
            ip("netns", "add", name)
        ip(
            "link",
            "add",
            "veth0",
            "netns",
            car,
            "type",
            "veth",
            "peer",
            "name",
            "veth0",
            "netns",
            edge,
        )
        for name, address in ((car, "10.99.0.1/24"), (edge, "10.99.0.2/24")):
            ip("-n", name, "address", "add", address, "dev", "veth0")
            ip("-n", name, "link", "set", "veth0", "up")
        filter_ = f"tbf rate {rate_bps}bit burst {BURST_BYTES} limit 10000000"
        shape = f"qdisc add dev veth0 root {filter_}".split()
        subprocess.run(["tc", "-n", car, *shape], check=True, capture_output=True, text=True)
        yield car, edge
    finally:
        for name in (car, edge):
            subprocess.run(["ip", "netns", "delete", name], capture_output=True)


def measured_ms(rate_bps: int, size_bytes: int, count: int) -> list[float]:
    """When each of ``count`` messages, sent at once, has arrived as a whole [ms since the first was
    sent].
    """
    with namespaces(rate_bps) as (car, edge):
        python = [sys.executable, str(Path(__file__).resolve())]
        receive = subprocess.Popen(
            ["ip", "netns", "exec", edge, *python, "receive", str(PORT), str(count)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert receive.stdout is not None
        assert receive.stdout.readline() == "up\n"
        send = [
            "ip",
            "netns",
            "exec",
            car,
            *python,
            "send",
            "10.99.0.2",
            str(PORT),
            str(size_bytes),
            str(count),
        ]
        began_ns = int(
            subprocess.run(send, check=True, capture_output=True, text=True, timeout=60).stdout
        )
        output, _ = receive.communicate(timeout=60)
        _sent_bytes[rate_bps] = _counted_bytes(car)
        return [(int(line) - began_ns) / NS_PER_MS for line in output.splitlines()]


_sent_bytes: dict[int, int] = {}  # by rate: what the shaper itself counted in the last measurement


def _counted_bytes(car: str) -> int:
    told = subprocess.run(
        ["tc", "-n", car, "-s", "-j", "qdisc", "show", "dev", "veth0"],
        check=True,
        capture_output=True,
        text=True,
    )
    return int(json.loads(told.stdout)[0]["bytes"])


def held_rate(rate_bps: int) -> float:
    """Which share of the rate that it was told the host's shaper keeps up, by its own count of
    bytes.
    """
    (took_ms,) = measured_ms(rate_bps, rate_bps // 40, 1)  # of a fifth of a second
    return _sent_bytes[rate_bps] * 8 * 1000 / took_ms / rate_bps


def simulated_ms(rate_bps: int, size_bytes: int, count: int) -> list[float]:
    """The same over the simulator's link."""
    from types import SimpleNamespace

    from genie_sim.base.seeds import Draws
    from genie_sim.core.messages import Detections, Header
    from genie_sim.links.wire import Wire
    from genie_sim.sim.clock import Clock
    from genie_sim.sim.link import Link
    from genie_sim.sim.link_model import LinkEnds

    class Message(Detections):
        size_bytes = property(lambda self: size_bytes)  # type: ignore[assignment]

    wire = Wire(rate_bps, rate_bps, 0, overhead_bytes=TBF_OVERHEAD_BYTES)
    env = Clock()
    network = SimpleNamespace(clock=env, draws=lambda *names: Draws(0, *names))
    sender = wire.transmitter(network, LinkEnds("veth", "car1", "edge1", up=True))
    link = Link(env, "veth", sender, queue_length=count)
    arrived_ms: list[float] = []
    for number in range(count):
        link.send(
            "images",
            Message(Header(number, "", ""), ()),
            lambda: arrived_ms.append(env.now / NS_PER_MS),
        )
    env.run()
    return arrived_ms


def _receive(port: int, count: int) -> None:
    with socket.create_server(("", port)) as server:
        print("up", flush=True)
        with (
            server.accept()[0] as connection,
            connection.makefile("rb", buffering=1 << 20) as stream,
        ):
            for _ in range(count):
                stream.read(int.from_bytes(stream.read(4), "big"))
                print(time.monotonic_ns(), flush=True)


def _send(host: str, port: int, size_bytes: int, count: int) -> None:
    message = (size_bytes - 4).to_bytes(4, "big") + bytes(size_bytes - 4)
    with socket.create_connection((host, port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        time.sleep(0.2)
        print(time.monotonic_ns(), flush=True)
        for _ in range(count):
            connection.sendall(message)


if __name__ == "__main__":
    if sys.argv[1] == "receive":
        _receive(int(sys.argv[2]), int(sys.argv[3]))
    else:
        _send(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5]))
