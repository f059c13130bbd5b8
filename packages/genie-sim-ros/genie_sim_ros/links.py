"""Links between Genies: sessions of Zenoh over mutual TLS.

What Genie FROM says to Genie TO is put on the key ``genie/TO/FROM``; the key ``genie/NAME`` is
alive as long as Genie NAME is. Zenoh's access control denies everything but the keys that belong
to the two names, this Genie's and the one in the certificate of the other side: nobody speaks
under another's name, or hears what is meant for another.
"""

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError, first_line
from genie_sim_ros.gateway import REMOTE, Peer
from genie_sim_ros.keys import key_files, why_unreachable
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan
from genie_sim_ros.wire import MAX_MESSAGE_BYTES, MAX_TEXT_BYTES, CodecOf, decode, encode

if TYPE_CHECKING:
    import zenoh
    from zenoh.handlers import Handler

log = logging.getLogger(__name__)
RETRY_S = (0.2, 1.5)  # first and longest wait before dialling again
HANDSHAKE_S = 2.0  # until the other side has shown its certificate
COMPLAIN_S = 3.0  # between two looks at the edges that cannot be reached
SILENCE_S = 5.0  # after which a link counts as cut
QUEUED_REQUESTS = 2  # of a topic: images that a slow link holds; the oldest goes first
QUEUED_ANSWERS = 10
QUEUED_RECEIVED = 10  # messages of a peer that wait for a slow receiver; the oldest goes first
# a peer that sends so many messages within so long that are dropped is not heard for a while
MAX_DROPPED, DROPPED_S, DEAF_S = 20, 10.0, 60.0
MESSAGES = ["put", "declare_subscriber", "liveliness_token", "declare_liveliness_subscriber"]

OnMessage = Callable[[Peer, str, RosMessage], None]


class Links:
    """All links of one Genie; those that are cut come back. Raises UserError for an address at
    which it cannot listen. The plan has been checked (``plan.check``).
    """

    def __init__(self, plan: AttachPlan, codec_of: CodecOf) -> None:
        self._name, self._plan = plan.name, plan
        self._peers = plan.peers()
        self._codec_of = codec_of
        self._connected: dict[str, Peer] = {}  # the one that has been there for longest comes first
        self._lock = threading.Lock()  # of _connected
        requests = frozenset(topic + REMOTE for topic in plan.requests)
        self._outboxes = {name: Outbox(requests) for name in self._peers}
        self._strangers: set[str] = set()
        self._ended = threading.Event()
        self._session = _open(plan) if plan.has_links() else None

    def start(self, on_message: OnMessage) -> None:
        """From now on ``on_message`` is called, from a thread of each peer; what it raises is
        logged.
        """
        if self._session is None:
            return
        from zenoh.handlers import RingChannel

        self._on_message = on_message
        self._session.info.declare_link_events_listener(self._on_link, history=True)
        liveliness = self._session.liveliness()
        for name, peer in self._peers.items():
            heard = self._session.declare_subscriber(
                f"genie/{self._name}/{name}", RingChannel(QUEUED_RECEIVED)
            )
            threading.Thread(target=self._hear, args=(peer, heard), daemon=True).start()
            threading.Thread(target=self._speak, args=(name,), daemon=True).start()
            liveliness.declare_subscriber(f"genie/{name}", self._on_liveliness, history=True)
        threading.Thread(target=self._complain, daemon=True).start()
        self._token = liveliness.declare_token(f"genie/{self._name}")

    def peers(self) -> list[Peer]:
        """The Genies that are connected now."""
        with self._lock:
            return list(self._connected.values())

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        """Sends without waiting; drops the message if the peer is not connected."""
        with self._lock:
            if peer in self._connected:
                self._outboxes[peer].put(topic, message)

    def close(self) -> None:
        """Ends all links. The address is free when this returns. A process whose links have been
        started ends only after this.
        """
        self._ended.set()
        for outbox in self._outboxes.values():
            outbox.close()
        if self._session is not None:
            self._session.close()

    # In threads of Zenoh

    def _on_liveliness(self, sample: "zenoh.Sample") -> None:
        from zenoh import SampleKind

        peer = self._peers[str(sample.key_expr).rpartition("/")[2]]
        with self._lock:
            if sample.kind == SampleKind.PUT:
                self._connected[peer.name] = peer
                log.info("link: %s %s is connected", peer.role, peer.name)
            else:
                self._connected.pop(peer.name, None)
                self._outboxes[peer.name].clear()
                log.info("link: %s is cut", peer.name)

    def _on_link(self, event: "zenoh.LinkEvent") -> None:
        """Names those who have a right certificate and no place in the plan, once each."""
        name = str(event.link.auth_identifier)
        if name not in self._peers and name not in self._strangers:
            self._strangers.add(name)
            log.warning(
                "link: %s at %s is none of %s: nothing is exchanged with it",
                name[:64],
                event.link.dst,
                ", ".join(self._peers),
            )

    # In threads of their own

    def _hear(self, peer: Peer, heard: "zenoh.Subscriber[Handler[zenoh.Sample]]") -> None:
        """Hands over what a peer says, until the session ends."""
        dropped_s: deque[float] = deque(maxlen=MAX_DROPPED)
        deaf_until_s = 0.0
        for sample in heard:
            now_s = time.monotonic()
            if now_s < deaf_until_s:
                continue
            try:
                topic, message = self._decoded(sample)
                self._on_message(peer, topic, message)
            except Exception as error:  # a peer's message must not end anything here
                reason = str(error) or type(error).__name__
                log.warning("link: dropped a message of %s: %s", peer.name, reason)
                dropped_s.append(now_s)
                if len(dropped_s) == MAX_DROPPED and now_s < dropped_s[0] + DROPPED_S:
                    dropped_s.clear()
                    deaf_until_s = now_s + DEAF_S
                    log.warning("link: %s is not heard for %.0f s", peer.name, DEAF_S)

    def _decoded(self, sample: "zenoh.Sample") -> tuple[str, RosMessage]:
        """Topic and message of a sample, which is measured before it is copied. Raises
        ValueError.
        """
        text = sample.attachment
        if text is None or len(text) > MAX_TEXT_BYTES or len(sample.payload) > MAX_MESSAGE_BYTES:
            raise ValueError("no text beside it, or one that is too long")
        return decode(text.to_bytes(), sample.payload.to_bytes(), self._codec_of)

    def _complain(self) -> None:
        """Says why an edge cannot be reached, once for each reason."""
        assert self._plan.keys is not None
        said: dict[str, str | None] = {}
        while not self._ended.wait(COMPLAIN_S):
            for text in self._plan.connect:
                name, _, address = text.partition("@")
                if name in self._connected:
                    said[text] = None
                    continue
                reason = why_unreachable(address, Path(self._plan.keys), self._name, HANDSHAKE_S)
                if reason is not None and reason != said.get(text):
                    said[text] = reason
                    log.warning("link: %s: %s", text, reason)

    def _speak(self, name: str) -> None:
        """Sends what waits for a peer. Waits while the link is slow."""
        from zenoh import CongestionControl

        assert self._session is not None
        outbox = self._outboxes[name]
        while (entry := outbox.take()) is not None:
            try:
                text, payload = encode(*entry)
                self._session.put(
                    f"genie/{name}/{self._name}",
                    payload,
                    attachment=text,
                    congestion_control=CongestionControl.BLOCK,
                )
            except Exception as error:  # what cannot be sent does not end the link
                log.warning("link: a message to %s cannot be sent: %s", name, error)


class Outbox:
    """Messages that wait for a link. Where it is slow, the oldest of a topic makes room."""

    def __init__(self, requests: frozenset[str]) -> None:
        self._requests = requests
        self._waiting: deque[tuple[str, RosMessage]] = deque()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, topic: str, message: RosMessage) -> None:
        """Appends a message."""
        limit = QUEUED_REQUESTS if topic in self._requests else QUEUED_ANSWERS
        with self._changed:
            same_topic = [entry for entry in self._waiting if entry[0] == topic]
            if len(same_topic) >= limit:
                self._waiting.remove(same_topic[0])
            self._waiting.append((topic, message))
            self._changed.notify()

    def take(self) -> tuple[str, RosMessage] | None:
        """The oldest message, as soon as there is one; ``None`` after ``close``."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closed)
            return None if self._closed else self._waiting.popleft()

    def clear(self) -> None:
        """Drops what waits."""
        with self._changed:
            self._waiting.clear()

    def close(self) -> None:
        """Ends ``take``."""
        with self._changed:
            self._closed = True
            self._changed.notify()


def _open(plan: AttachPlan) -> "zenoh.Session":
    """A session of Zenoh. Raises UserError where it cannot listen."""
    import zenoh

    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration(plan))))
    except zenoh.ZError as error:
        raise UserError(f"link: {plan.listen or plan.name}: {first_line(error)}") from error


def configuration(plan: AttachPlan) -> dict[str, Any]:
    """Zenoh's configuration: a peer that finds nobody by itself, trusts the authority in the
    plan's keys, and exchanges messages with the plan's peers alone.
    """
    assert plan.keys is not None
    authority, certificate, key = map(str, key_files(Path(plan.keys), plan.name))
    handshake_ms = round(HANDSHAKE_S * 1000)
    listen = [] if plan.listen is None else [f"tls/{plan.listen}"]
    return {
        "mode": "peer",
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "open": {"return_conditions": {"connect_scouted": False, "declares": False}},
        "listen": {"endpoints": [f"{at}#tls_handshake_timeout_ms={handshake_ms}" for at in listen]},
        "connect": {
            "endpoints": [f"tls/{address.partition('@')[2]}" for address in plan.connect],
            "retry": {
                "period_init_ms": round(RETRY_S[0] * 1000),
                "period_max_ms": round(RETRY_S[1] * 1000),
                "period_increase_factor": 2,
            },
        },
        "transport": {
            "unicast": {
                "open_timeout": handshake_ms,
                "accept_timeout": handshake_ms,
                "qos": {"enabled": False},  # one priority, and fragments of one message at a time
            },
            "shared_memory": {"enabled": False},
            "link": {
                "protocols": ["tls"],
                "tx": {"lease": round(SILENCE_S * 1000)},
                "rx": {"max_message_size": MAX_MESSAGE_BYTES + MAX_TEXT_BYTES + 1024},
                "tls": {
                    "root_ca_certificate": authority,
                    "enable_mtls": True,
                    "verify_name_on_connect": False,  # names are Genies', not hosts'
                    "close_link_on_expiration": True,
                    "listen_certificate": certificate,
                    "listen_private_key": key,
                    "connect_certificate": certificate,
                    "connect_private_key": key,
                },
            },
        },
        "access_control": _access_control(plan.name, list(plan.peers())),
    }


def _access_control(own: str, peers: list[str]) -> dict[str, Any]:
    """Who has the certificate of a peer may exchange, with this Genie, what belongs to the two
    names; everything else is denied.
    """
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {
                "id": name,
                "messages": MESSAGES,
                "flows": ["ingress", "egress"],
                "permission": "allow",
                "key_exprs": [
                    f"genie/{own}",
                    f"genie/{name}",
                    f"genie/{own}/{name}",
                    f"genie/{name}/{own}",
                ],
            }
            for name in peers
        ],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in peers],
        "policies": [{"rules": [name], "subjects": [name]} for name in peers],
    }
