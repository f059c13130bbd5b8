"""Paced remote execution: how many frames are on their way, and what becomes of the others."""

from __future__ import annotations

from genie_sim.core.messages import Detections, Expired, Publish
from genie_sim.recommended.paced_remote import PacedSender
from genie_sim.recommended.pacing import Pacer
from genie_sim.record.columns import Columns
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.method import IMAGES, OBJECTS, REMOTE
from tests.make import frame

MS = 1_000_000


def sender(in_flight: int) -> PacedSender:
    pacer = Pacer(every_ns=0, in_flight=in_flight, stale_ns=500 * MS)
    return PacedSender("car1/sender", pacer, (IMAGES,), (OBJECTS,))


def test_a_frame_goes_up_once_the_one_before_is_answered():
    paced, frames = sender(in_flight=1), [frame(0), frame(0.1), frame(0.2)]
    assert paced.on_message(IMAGES, frames[0], 0) == [Publish(IMAGES + REMOTE, frames[0])]
    assert paced.on_message(IMAGES, frames[1], 100 * MS) == [Expired(frames[1].header)]
    answer = Detections(frames[0].header, ())
    assert paced.on_message(OBJECTS + REMOTE, answer, 150 * MS) == [Publish(OBJECTS, answer)]
    assert paced.on_message(IMAGES, frames[2], 200 * MS) == [Publish(IMAGES + REMOTE, frames[2])]


def test_a_frame_that_is_never_answered_is_given_up_after_a_second():
    paced, lost = sender(in_flight=2), frame(0)
    paced.on_message(IMAGES, lost, 0)
    assert paced.next_deadline_ns() == 1000 * MS
    assert paced.on_deadline(999 * MS) == []
    assert paced.on_deadline(1000 * MS) == [Expired(lost.header)]


def test_a_frame_that_a_later_one_overtakes_is_given_up():
    """Answers keep their order: once the second frame is answered, the first never will be."""
    paced, frames = sender(in_flight=2), [frame(0), frame(0.1)]
    for number, image in enumerate(frames):
        paced.on_message(IMAGES, image, number * 100 * MS)
    answer = Detections(frames[1].header, ())
    effects = paced.on_message(OBJECTS + REMOTE, answer, 150 * MS)
    assert effects == [Expired(frames[0].header), Publish(OBJECTS, answer)]
    pacer = Pacer(every_ns=0, in_flight=2, stale_ns=500 * MS)
    for image in frames:
        pacer.dispatch(image.header, 0.0, image.header.stamp_ns)
    (loss,) = pacer.answered(frames[1].header, 150 * MS).losses
    assert (loss.header, loss.cause) == (frames[0].header, "overtaken")


def test_fewer_frames_go_up_than_with_remote_and_each_is_answered():
    settings = ["methods=[remote, paced_remote]", "cars[0].route.window=[0 s, 3 s]"]
    tables = run_in_memory(load_scenario("street_1car_hetero", settings)).tables
    frames = Columns.of(tables["frames"])
    sent, answered = {}, {}
    for method in ("remote", "paced_remote"):
        rows = frames.where(method=method)
        sent[method] = int((rows["bytes_up"] > 0).sum())
        answered[method] = int((rows.floats("result_answer_ns") > 0).sum())
    assert sent["remote"] == len(frames.where(method="remote"))
    assert 0.2 < sent["paced_remote"] / sent["remote"] < 0.8
    assert answered["paced_remote"] == sent["paced_remote"]


def test_a_car_without_an_edge_answers_nothing():
    settings = ["methods=[paced_remote]", "cars[0].edge=null", "cars[0].route.window=[0 s, 1 s]"]
    frames = Columns.of(
        run_in_memory(load_scenario("street_1car_hetero", settings)).tables["frames"]
    )
    assert not (frames.floats("first_answer_ns") > 0).any()
