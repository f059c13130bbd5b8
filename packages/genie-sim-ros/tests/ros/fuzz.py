"""What comes from ROS and from other Genies: bags, messages, what a link carries, key files. From
the checkout's root: ``PYTHONPATH=packages/genie-sim-ros python -m tests.ros.fuzz --cases 10000``.
"""

from __future__ import annotations

import contextlib
import json
import random
import struct
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import rigid
from genie_sim.core.messages import Header
from genie_sim.data.trace import read_trace, write_trace
from genie_sim_ros import wire
from genie_sim_ros.bags import perceive_bag
from genie_sim_ros.codec import CHANNELS, IMAGE, MARKER, MARKERS, OBJECTS, Codec, WireType, codec_of
from genie_sim_ros.gateway import Gateway, Peer, plain
from genie_sim_ros.keys import check_keys, key_files
from genie_sim_ros.message import RosMessage, checked_pose
from genie_sim_ros.plan import ROLES, AttachPlan, make_gateway
from genie_sim_ros.poses import POSE_TYPES, Poses
from genie_sim_ros.typestore import message, time, typestore
from tests.ros import bag_files
from tests.ros.bag_files import BagWriter
from tests.ros.conftest import HERE, Keys
from tools.fuzz.__main__ import main
from tools.fuzz.harness import Case, Target
from tools.fuzz.mutation import VALUES, broken, changed

DEFINITION = (HERE / "objects.txt").read_text()


def small_street(path: Path) -> BagWriter:
    """Two small frames with all that a bag can say."""
    bag = BagWriter(path)
    bag.camera_info(bag_files.START_NS, np.array([[70.0, 0, 32], [0, 70, 18], [0, 0, 1]]), (64, 36))
    bag.transform(bag_files.START_NS, "imu_link", bag_files.CAMERA, bag_files.IMU_SE3_CAMERA)
    bag.transform(bag_files.START_NS, "imu_link", "velo_link", rigid(np.eye(3), (0.0, 0.0, 0.8)))
    for number in range(2):
        stamp_ns = bag_files.START_NS + number * bag_files.STEP_NS
        bag.position(stamp_ns, bag_files.ORIGIN, (0.0, 0.0, 0.1 * number))
        bag.image(stamp_ns, np.full((36, 64, 3), 10 * number, np.uint8))
        bag.scan(
            stamp_ns + 2_000_000,
            np.array([(20.0, y / 2, 0.0) for y in range(-6, 6)]),
            late_ns=70_000_000,
        )
        bag.objects(
            stamp_ns, {"label": "car", "score": 0.75, "x": 28, "y": 15, "width": 8, "height": 6}
        )
    return bag


def bags(folder: Path) -> Case:
    """Half of them: the file broken anywhere. Half: whole files in which one message is broken."""
    streets = {kind: small_street(folder / f"street.{kind}") for kind in ("bag", "mcap", "ros2")}
    whole = {kind: bag.write() for kind, bag in streets.items()}
    files = {kind: path.read_bytes() for kind, path in whole.items() if path.is_file()}
    parts = {path: path.read_bytes() for path in sorted(whole["ros2"].iterdir())}
    path = folder / "broken"

    def of_messages(rng: random.Random) -> Path:
        kind = rng.choice(("bag", "mcap"))
        path = folder / f"broken.{kind}"
        path.unlink(missing_ok=True)
        bag = streets[kind]
        at, count = rng.randrange(len(bag.messages)), iter(range(10**6))
        serialize = "serialize_ros1" if kind == "bag" else "serialize_cdr"
        original = getattr(bag.store, serialize)

        def written(message: Any, name: str) -> bytes:
            whole = bytes(original(message, name))
            return broken(whole, rng) if next(count) == at else whole

        made = BagWriter(path)
        made.messages, made.store = bag.messages, _Breaking(bag.store, serialize, written)
        return made.write()

    def case(rng: random.Random) -> None:
        if rng.random() < 0.5:
            made = of_messages(rng)
        elif rng.random() < 0.4:
            made = whole["ros2"]
            part = rng.choice(list(parts))
            part.write_bytes(broken(parts[part], rng))
        else:
            kind = rng.choice(list(files))
            made = path.with_suffix(f".{kind}")
            made.write_bytes(broken(files[kind], rng))
        try:
            write_trace(folder / "trace.parquet", perceive_bag(made, detections=bag_files.OBJECTS))
            read_trace(folder / "trace.parquet")
        finally:
            for part, content in parts.items():
                part.write_bytes(content)

    return case


class _Breaking:
    """A type store of which one method is another."""

    def __init__(self, store: Any, name: str, method: Any) -> None:
        self._store, self._name, self._method = store, name, method

    def __getattr__(self, name: str) -> Any:
        return self._method if name == self._name else getattr(self._store, name)


def _payloads(ros: int) -> list[tuple[Codec, bytes]]:
    """A good message of each type that a Genie reads."""
    store = typestore(1, DEFINITION, OBJECTS) if ros == 1 else typestore(2)
    at, pixels = {"stamp": time(10**9 + 7), "frame_id": "camera"}, np.arange(360).astype(np.uint8)
    good = {
        IMAGE: message(
            store, IMAGE, header=at, width=12, height=10, step=36, encoding="bgr8", data=pixels
        ),
        MARKERS: message(
            store,
            MARKERS,
            markers=[message(store, MARKER, header=at, ns="car", id=n) for n in range(2)],
        ),
    }
    if ros == 1:  # no ROS 2 has it
        detected = message(
            store,
            "autoware_msgs/msg/DetectedObject",
            header=at,
            label="car",
            score=0.5,
            space_frame="map",
        )
        good[OBJECTS] = message(store, OBJECTS, header=at, objects=[detected] * 2)
    write = store.serialize_ros1 if ros == 1 else store.serialize_cdr

    def codec(kind: str) -> Codec:
        return codec_of(
            WireType(kind.replace("/msg/", "/"), "1" * 32, DEFINITION if kind == OBJECTS else ""),
            ros,
        )

    return [(codec(kind), bytes(write(whole, kind))) for kind, whole in good.items()]


def messages(folder: Path) -> Case:
    """What a node of the own network says: read, hashed, given another header and other objects."""
    good = [*_payloads(1), *_payloads(2)]
    readers = [(ros, kind, Poses(ros)) for ros in (1, 2) for kind in POSE_TYPES]
    store = {ros: typestore(ros) for ros in (1, 2)}
    encodings = [name.encode() for name in CHANNELS]

    def case(rng: random.Random) -> None:
        if rng.random() < 0.15:
            ros, kind, poses = rng.choice(readers)
            full = kind.replace("/", "/msg/")
            whole = message(store[ros], full, header={"stamp": time(10**9), "frame_id": "map"})
            write = store[ros].serialize_ros1 if ros == 1 else store[ros].serialize_cdr
            poses.receive(kind, broken(bytes(write(whole, full)), rng))
            return
        codec, payload = rng.choice(good)
        made = broken(payload, rng)
        if rng.random() < 0.2:
            made = made.replace(b"bgr8", rng.choice(encodings)[:4].ljust(4))
        read = RosMessage.of(made, codec, "car1", answer=codec.holds_objects)
        assert len(read.digest) == 64
        if codec.type.name.endswith("Image"):
            assert 0 <= read.dhash < 2**64
        if codec.holds_objects:
            read.with_objects(read.objects[:1] if read.objects else ()).encoded()
        same = Header(read.header.stamp_ns, read.header.frame_id, "car1")
        if 0 <= read.header.stamp_ns < 2**31 * 10**9:
            read.restamped(same).encoded(7)

    return case


def link_messages(folder: Path) -> Case:
    """What a Genie with a valid certificate says over its link."""
    codecs = {f"/{number}": codec for number, (codec, _) in enumerate(_payloads(1))}
    good = []
    for number, (codec, payload) in enumerate(_payloads(1)):
        message = RosMessage.of(payload, codec, "car1", codec.holds_objects)
        good.append(wire.encode(f"/{number}", message))

    def case(rng: random.Random) -> None:
        text, payload = rng.choice(good)
        if rng.random() < 0.6:
            said = changed({**json.loads(text), "pose": [1.0, 2.0, 3.0, 4.0], "fov_rad": 1.4}, rng)
            text = json.dumps(rng.choice(VALUES) if rng.random() < 0.05 else said).encode()
        if rng.random() < 0.25:
            text = broken(text, rng)
        if rng.random() < 0.25:
            payload = broken(payload, rng)
        wire.encode(*wire.decode(text, payload, codecs.get))

    return case


def gateways(folder: Path) -> Case:
    """A car's and an edge's Genie that get twenty messages each, some of them broken, from their
    nodes, their robots and each other. A case is refused if its last message is dropped.
    """
    sides = [_gateway_side(ros, role) for ros in (1, 2) for role in ("car", "edge")]

    def case(rng: random.Random) -> None:
        side = rng.choice(sides)
        gateway, now_ns = side.gateway(rng), 0
        dropped: ValueError | None = None
        for _ in range(20):
            now_ns += rng.choice((0, 10**6, 10**9, 20 * 10**9))
            try:
                if rng.random() < 0.1:
                    gateway.on_timer(now_ns)
                elif rng.random() < 0.6:
                    topic = rng.choice(sorted(gateway.genie.subscriptions()))
                    gateway.from_ros(topic, side.message(topic, rng), now_ns, "/somebody")
                else:
                    topic = rng.choice(("/0_remote", "/1", "/1_remote", "/0"))
                    peer = Peer(rng.choice(("car1", "car2", "edge1")), rng.choice(ROLES))
                    gateway.from_link(peer, topic, side.message(topic, rng), now_ns)
                dropped = None
            except ValueError as error:
                dropped = error
        if dropped is not None:
            raise dropped

    return case


@dataclass
class _Side:
    """What a case needs of one ROS and one role: ``payloads`` by topic, with their codecs."""

    role: str
    payloads: dict[str, tuple[Codec, bytes]]

    def gateway(self, rng: random.Random) -> Gateway:
        """A new Genie with settings of its own."""
        settings: dict[str, Any] = {
            "similarity": rng.choice(("exact", "pose_grid", "dhash")),
            "miss_policy": rng.choice(("blocking", "immediate")),
            "fresh_objects": rng.choice(("all", "confident")),
        }
        plan = AttachPlan(
            node="/node",
            name="car1" if self.role == "car" else "edge1",
            role=self.role,
            requests=("/0",),
            answers=("/1",),
            settings=settings,
            pose_topic="/pose",
            horizontal_fov_rad=1.4,
            connect=("edge1@127.0.0.1:1",),
        )
        links = SimpleNamespace(
            peers=lambda: [Peer("edge2", "edge"), Peer("car1", "car")],
            send=lambda peer, topic, message: wire.encode(topic, message),
        )
        return make_gateway(
            plan,
            publish=lambda topic, message: message.encoded(rng.choice((None, 7))),
            observe=lambda record, now_ns: None,
            links=links,
            object_codec=self.payloads["/1"][0],
        )

    def message(self, topic: str, rng: random.Random) -> RosMessage:
        """A message of a topic, now and then broken, seen from anywhere."""
        codec, payload = self.payloads[plain(topic)]
        if rng.random() < 0.7:  # mostly other stamps, up to those that no message can hold
            stamp_ns = rng.choice((0, 1, 10**9, 10**9 + 1, 2**31 * 10**9 - 1, 2**31 * 10**9))
            with contextlib.suppress(struct.error):
                payload = codec.restamped(payload, stamp_ns, "camera")
        if rng.random() < 0.05:
            payload = broken(payload, rng)
        origin = rng.choice(("car1", "edge1", "car2"))
        message = RosMessage.of(payload, codec, origin, answer=codec.holds_objects)
        if rng.random() < 0.8:
            numbers = rng.choices((0.0, -3.5, 1e7, -4e7, 1e308), (8, 8, 2, 2, 0.1), k=3)
            message = replace(
                message, pose=checked_pose(*numbers, rng.uniform(-9, 9)), horizontal_fov_rad=1.4
            )
        return message


def _gateway_side(ros: int, role: str) -> _Side:
    image, *_, objects = _payloads(ros)
    return _Side(role, {"/0": image, "/1": objects})


def keys(folder: Path) -> Case:
    made = Keys(folder)("car1")
    files = {path: path.read_bytes() for path in key_files(Path(made), "car1")}

    def case(rng: random.Random) -> None:
        path = rng.choice(list(files))
        path.write_bytes(broken(files[path], rng))
        try:
            check_keys(Path(made), "car1")
        finally:
            path.write_bytes(files[path])

    return case


TARGETS = (
    Target("bags", 60, bags),
    Target("messages", 120, messages, (UserError, ValueError)),
    Target("link messages", 90, link_messages, (ValueError,)),
    Target("gateway sequences", 80, gateways, (UserError, ValueError)),
    Target("key files", 30, keys),
)


if __name__ == "__main__":
    sys.exit(main(TARGETS))
