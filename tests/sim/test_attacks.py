"""What attackers tell others, and what of it is recorded."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.seeds import stream
from genie_sim.core.messages import (
    SHARED,
    CameraPose,
    Detection,
    Detections,
    Header,
    Image,
    Look,
    Motion,
)
from genie_sim.faults.attacks.attack import AttackedScene
from genie_sim.faults.attacks.inflate import Inflate
from genie_sim.faults.attacks.remove import Remove
from genie_sim.faults.attacks.replay import Replay
from genie_sim.faults.attacks.shift import Shift
from genie_sim.faults.attacks.spoof import Spoof
from genie_sim.report import data
from genie_sim.runs.folder import run_in_memory
from genie_sim.sim.forgeries import Forgeries
from tests.conformance import small

S = 1_000_000_000
NORTH = CameraPose(100.0, 50.0, 1.6, math.pi / 2)
NEAR = Detection("car", 0.6, (0.0, 0.0, 9.0, 9.0), (101.0, 62.0, 0.5), 0.6)
FAR = Detection("person", 0.4, None, (99.0, 95.0, 0.5), 0.4)
SOMEWHERE = replace(NEAR, location=None)


class Now:
    """The part of a network that attacks need."""

    cars = ("car1", "car2", "car3", "car4", "car5")

    def __init__(self) -> None:
        self.clock = self
        self.now = S
        self.forgeries = Forgeries()
        self.bends: dict[str, list] = {}

    def stream(self, *names):
        return stream(3, *names)

    def bend(self, host, bend):
        self.bends.setdefault(host, []).append(bend)

    def unbend(self, host, bend):
        self.bends[host].remove(bend)


class Picture:
    detections = (NEAR, FAR)


def scene(source: str = "picture", pose: CameraPose = NORTH, frame_id: str = "02") -> AttackedScene:
    return AttackedScene(Header(S, frame_id, "car1"), pose, 1.2, source, "car1", S)


def image(pose: CameraPose = NORTH, objects=(NEAR, FAR), stamp_ns: int = S) -> Image:
    picture = Picture()
    picture.detections = objects
    return Image(Header(stamp_ns, "02", "car1"), 100, "02/abc", 7, pose, 1.2, picture)


def leaving(attack, host: str, message, other: str = "edge1", *, network: Now | None = None):
    """The message as it leaves the host of an attacker, and the network."""
    network = network or Now()
    if not network.bends:
        attack.begin(network)
    (bend,) = network.bends[host]
    return bend.outward(message, other), network


def test_a_spoofed_object_stands_ahead_of_the_first_picture_and_is_seen_while_in_view():
    attack = Spoof(target="car1", ahead_m=20.0, label="truck", score=0.9)
    *others, ghost = attack.forge((NEAR,), scene())
    assert others == [NEAR] and (ghost.label, ghost.score, ghost.motion) == ("truck", 0.9, None)
    assert ghost.location == pytest.approx((100.0, 70.0, 1.6))
    later = NORTH._replace(north_m=65.0)
    assert attack.forge((), scene(pose=later))[0].location == ghost.location
    past = NORTH._replace(north_m=71.0)
    assert attack.forge((NEAR,), scene(pose=past)) == (NEAR,)


def test_a_spoofed_object_that_moves_stays_ahead_of_the_stream_that_showed_it_first():
    attack = Spoof(target="car1", ahead_m=20.0, moves=True)
    attack.forge((), scene())
    later = NORTH._replace(north_m=65.0)
    assert attack.forge((), scene(pose=later))[0].location == pytest.approx((100.0, 85.0, 1.6))
    east = NORTH._replace(north_m=66.0, heading_rad=0.0)
    assert attack.forge((), scene(pose=east, frame_id="left")) == ()


def test_a_spoofed_track_is_said_to_be_seen_by_somebody_else_now():
    attack = Spoof(target="edge1", score=0.9)
    behind = NORTH._replace(heading_rad=-math.pi / 2)
    attack.forge((), scene())
    assert attack.forge((), scene(pose=behind)) == ()
    (ghost,) = attack.forge((), scene(SHARED, pose=behind))
    assert ghost.motion is not None and ghost.motion.existence == 0.9
    assert ghost.motion.seen.stamp_ns == S and ghost.motion.seen.origin != "car1"


def test_objects_are_left_out_up_to_a_distance():
    attack = Remove(target="car1", radius_m=20.0)
    assert attack.forge((NEAR, FAR, SOMEWHERE), scene()) == (FAR, SOMEWHERE)


def test_objects_are_shifted_in_one_direction_that_is_drawn():
    attack, network = Shift(target="car1", by_m=4.0), Now()
    attack.start(network, "car1")
    near, far, nowhere = attack.forge((NEAR, FAR, SOMEWHERE), scene())
    away = [near.location[i] - NEAR.location[i] for i in range(3)]
    assert math.hypot(*away[:2]) == pytest.approx(4.0) and away[2] == 0
    assert far.location == pytest.approx(
        tuple(a + b for a, b in zip(FAR.location, away, strict=True))
    )
    assert nowhere == SOMEWHERE


def test_inflated_scores_are_those_of_trackers_too():
    track = replace(NEAR, motion=Motion((1.0, 0.0), 0.5, 0.4, Header(0, "02", "car2")))
    (item,) = Inflate(target="edge1", score=0.97).forge((track,), scene(SHARED))
    assert (item.score, item.confidence, item.motion.existence) == (0.97, 0.97, 0.97)
    assert item.location == NEAR.location


def test_a_replayed_picture_shows_what_was_there_at_the_pose_of_then():
    attack = Replay(target="car1", delay_ns=S)
    told, network = leaving(attack, "car1", image(objects=(NEAR,)))
    assert told.content.detections == (NEAR,), "nothing is old enough yet"
    later = NORTH._replace(north_m=60.0)
    told, _ = leaving(attack, "car1", image(later, (FAR,), 2 * S), network=network)
    assert told.content.detections == (NEAR,)
    assert told.pose == NORTH and told.header.stamp_ns == 2 * S
    changes = [(row.change, row.label) for row in network.forgeries]
    assert changes == [("added", "car"), ("left_out", "person")]


def test_until_there_is_something_so_old_the_newest_is_told():
    attack = Replay(target="edge1", delay_ns=2 * S)
    told = [
        attack.forge((item,), scene(SHARED)._replace(now_ns=now_ns))
        for item, now_ns in ((NEAR, S), (FAR, 2 * S), (SOMEWHERE, 3 * S - 1), (SOMEWHERE, 3 * S))
    ]
    assert told == [(NEAR,), (FAR,), (SOMEWHERE,), (NEAR,)]


def test_replayed_tracks_are_said_to_be_seen_now():
    attack = Replay(target="edge1", delay_ns=S)
    track = replace(NEAR, motion=Motion((1.0, 0.0), 0.5, 0.4, Header(0, "02", "car2")))
    attack.forge((track,), scene(SHARED))
    (item,) = attack.forge((), scene(SHARED)._replace(now_ns=2 * S))
    assert item.motion.seen == Header(2 * S, "02", "car2") and item.location == NEAR.location


def test_an_edge_forges_answers_looks_and_the_objects_beside_them():
    """It knows where a camera stands from the pictures that came, or from the look itself."""
    attack, network = Remove(target="edge1", radius_m=20.0), Now()
    header = Header(S, "02", "car1")
    answer = Detections(header, (NEAR, FAR))
    assert leaving(attack, "edge1", answer, "car1", network=network)[0] is answer
    network.bends["edge1"][0].inward(image(), "car1")
    assert leaving(attack, "edge1", answer, "car1", network=network)[0].objects == (FAR,)
    look = Detections(header, (), look=Look(header, NORTH, 1.2, (NEAR, FAR)))
    told, _ = leaving(attack, "edge1", look, "edge2", network=network)
    assert told.look.detections == (FAR,) and told.objects == ()
    assert {row.receiver for row in network.forgeries} == {"car1", "edge2"}
    attack.end(network)
    assert network.bends == {"edge1": []}


def test_what_is_not_applied_is_recorded_all_the_same():
    attack = Remove(target="car1", applied=False)
    told, network = leaving(attack, "car1", image())
    assert told.content.detections == (NEAR, FAR)
    assert [row.label for row in network.forgeries] == ["car", "person"]


def test_only_a_car_can_sign_a_look_of_its_own_that_is_forged():
    """An edge that changes a look, or a track, breaks its signatures."""
    header = Header(S, "02", "car1")
    look = Look(header, NORTH, 1.2, (NEAR, FAR), signed=True)
    message = Detections(header, (), look=look)
    told, _ = leaving(Remove(target="edge1", radius_m=20.0), "edge1", message, "edge2")
    assert told.look.detections == (FAR,) and not told.look.signed
    told, _ = leaving(Remove(target="edge1", radius_m=1.0), "edge1", message, "edge2")
    assert told.look.signed, "nothing was changed"
    told, _ = leaving(Remove(target="car1", radius_m=20.0), "car1", image().with_looks((look,)))
    assert told.looks[0].detections == (FAR,) and told.looks[0].signed

    motion = Motion((0.0, 0.0), 0.5, 0.9, header, ("car2",), signed=True)
    words = Detections(header, (replace(NEAR, motion=motion), replace(FAR, motion=motion)), SHARED)
    attack, network = Inflate(target="edge1", score=0.4), Now()
    attack.begin(network)
    network.bends["edge1"][0].inward(image(), "car1")
    told, _ = leaving(attack, "edge1", words, "car1", network=network)
    assert [item.motion.signed for item in told.objects] == [False, False]
    assert leaving(Remove(target="edge1", radius_m=1.0), "edge1", words, "car1")[0] is words


def test_a_larger_share_has_the_attackers_of_a_smaller_one():
    shares = [Spoof(share=share).drawn_targets(Now()) for share in (0.0, 0.2, 0.6, 1.0)]
    assert [len(cars) for cars in shares] == [0, 1, 3, 5]
    assert set(shares[1]) < set(shares[2]) < set(shares[3])


def test_a_forgery_lasts_from_its_first_message_to_the_last_and_ends_where_it_moves_on():
    forgeries = Forgeries()

    def tell(at_m: float, now_s: float, **changed) -> None:
        item = replace(NEAR, location=(at_m, 0.0, 0.0), **changed)
        hosts = {"attacker": "car1", "receiver": "edge1"}
        now_ns = round(now_s * S)
        forgeries.note("x", before=(FAR,), after=(item, FAR), now_ns=now_ns, **hosts)

    tell(0.0, 1.0)
    tell(0.9, 1.5)
    tell(1.5, 2.0)  # 1.5 m from where it began
    tell(0.2, 4.0)  # after more than a second
    rows = [(row.east_m, row.begin_ns / S, row.end_ns / S) for row in forgeries]
    assert rows == [(0.0, 1.0, 1.5), (1.5, 2.0, 2.0), (0.2, 4.0, 4.0)]
    assert {(row.attack, row.change, row.label) for row in forgeries} == {("x", "added", "car")}


def test_another_score_is_a_forgery_and_the_same_object_is_none():
    forgeries, hosts = Forgeries(), {"attacker": "car1", "receiver": "edge1", "now_ns": S}
    forgeries.note("x", before=(NEAR, FAR), after=(NEAR, FAR), **hosts)
    assert not list(forgeries)
    forgeries.note("x", before=(NEAR,), after=(replace(NEAR, score=0.9),), **hosts)
    assert [row.change for row in forgeries] == ["added"]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"target": "car7"}, r"faults\[0\].target: unknown car or edge 'car7' \(did you mean"),
        ({"target": ["car1", "edge9"]}, r"faults\[0\].target: unknown car or edge 'edge9'"),
        ({}, r"faults\[0\].target: missing; or give 'share', of all cars"),
        ({"target": "car1", "share": 0.5}, r"faults\[0\].share: has no effect beside 'target'"),
        ({"share": 1.5}, r"faults\[0\].share: must be from 0 to 1, not 1.5"),
        ({"share": 0.5, "score": -1}, r"faults\[0\].score: must be from 0 to 1, not -1"),
    ],
)
def test_attackers_that_do_not_exist_are_one_line(fault, message: str):
    with pytest.raises(UserError, match=message) as error:
        faults = [{"fault": "spoof", "begin": "1 s", **fault}]
        run_in_memory(small.scenario(["local"], faults=faults))
    assert "\n" not in str(error.value)


def test_a_run_records_who_forged_what():
    faults = [{"fault": "spoof", "target": "car1", "begin": "0.5 s", "end": "1 s", "label": "bus"}]
    run = run_in_memory(small.scenario(["local", "remote"], faults=faults))
    rows = run.attacks
    assert set(rows["method"]) == {"remote"}, "nothing leaves a car that keeps to itself"
    assert set(rows["attacker"]) == {"car1"} and set(rows["receiver"]) == {"edge1"}
    assert set(rows["label"]) == {"bus"} and (rows["begin_ns"] >= S // 2).all()
    (fault,) = run.faults.query("method == 'remote'").to_dict("records")
    assert fault["target"] == "car1" and fault["fault"] == "spoof"
    shaded = {"method": "remote", "fault": "spoof", "target": "car1", "from": 0.5, "to": 1.0}
    assert shaded in data.page_data(run)["faults"], "pages shade the time of attacks"


def test_what_is_not_applied_changes_no_byte_of_a_run():
    """Also under a Genie whose edges pass on looks."""
    dry = [
        {"fault": kind, "target": ["car1", "edge1"], "applied": False, "begin": "0.2 s"}
        for kind in ("spoof", "remove", "shift", "replay", "inflate")
    ]
    with_them, without = (
        small.tables(small.scenario(["remote", "genie"], faults=faults)) for faults in (dry, [])
    )
    assert len(with_them.pop("attacks")) and without.pop("attacks").empty
    with_them.pop("faults"), without.pop("faults")
    small.same(with_them, without)
