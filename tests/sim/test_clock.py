"""The clock of a run is SimPy's environment, in whole nanoseconds; devices take from queues that
keep the newest.
"""

from __future__ import annotations

import gc
import math
import random
from typing import Any, NamedTuple

import numpy as np
import pytest
import simpy

from genie_sim.base.errors import UserError
from genie_sim.sim.clock import Clock, NewestQueue, Occupancy
from tests.conformance import small


def course(env: Any, seed: int) -> list[tuple[Any, ...]]:
    """What a few processes do that wait, start others, interrupt them and wait for several things
    at once.
    """
    rng, noted = random.Random(seed), []

    def worker(name: str, depth: int):
        try:
            for step in range(4):
                yield env.timeout(rng.randrange(3))
                noted.append((env.now, name, step))
                if depth and rng.random() < 0.5:
                    child = env.process(worker(f"{name}.{step}", depth - 1))
                    if rng.random() < 0.3:
                        yield env.timeout(1) | child
                    if child.is_alive and rng.random() < 0.5:
                        child.interrupt(name)
        except simpy.Interrupt as interrupt:
            noted.append((env.now, name, interrupt.cause))
        return name

    workers = [env.process(worker(str(number), 2)) for number in range(4)]
    env.run(until=2)
    noted.append((env.now, env.peek()))
    noted.append((env.run(workers[0]), env.now))
    env.run()
    return [*noted, env.now]


@pytest.mark.parametrize("seed", range(20))
def test_processes_run_as_in_simpy(seed: int):
    assert course(Clock(), seed) == course(simpy.Environment(), seed)


def test_calls_and_events_of_one_instant_come_in_the_order_in_which_they_were_scheduled():
    env, noted = Clock(), []
    env.after(5, noted.append, ("first",))
    env.timeout(5).callbacks.append(lambda _: noted.append("second"))
    env.after(5, noted.append, ("third",))
    env.run(until=5)
    assert noted == [] and env.now == 5 and env.peek() == 5
    env.run(until=6)
    assert noted == ["first", "second", "third"] and env.now == 6


def test_a_failure_that_nobody_handles_ends_the_run_and_time_never_runs_backwards():
    env = Clock()

    def fails():
        yield env.timeout(1)
        raise KeyError("it")

    env.process(fails())
    with pytest.raises(KeyError, match="it"):
        env.run(until=3)
    with pytest.raises(ValueError):
        env.run(until=0)


@pytest.mark.parametrize("delay", [-1, -1.0, 1.7, 0.4, math.inf, math.nan, "3 ms", None])
def test_a_delay_is_a_whole_number_of_nanoseconds(delay: Any):
    env = Clock()
    with pytest.raises((ValueError, TypeError)):
        env.timeout(delay)
    with pytest.raises((ValueError, TypeError)):
        env.after(delay, list)
    env.run()
    assert env.now == 0


@pytest.mark.parametrize("delay", [3, 3.0, np.int64(3), np.float64(3.0)])
def test_numbers_of_other_types_are_taken_where_they_are_whole(delay: Any):
    env = Clock()
    env.run(env.timeout(delay))
    assert env.now == 3 and type(env.now) is int


def test_the_exception_of_a_process_is_raised_itself_with_its_place():
    env, broken = Clock(), KeyError("it")

    def fails():
        yield env.timeout(1)
        raise broken

    env.process(fails())
    with pytest.raises(KeyError) as raised:
        env.run(until=3)
    assert raised.value is broken and raised.traceback[-1].name == "fails"


def test_a_process_that_waits_for_another_may_handle_what_that_raises():
    env, noted = Clock(), []

    def fails():
        yield env.timeout(1)
        raise KeyError("it")

    def waits():
        try:
            yield env.process(fails())
        except KeyError:
            noted.append(env.now)

    env.process(waits())
    env.run(until=3)
    assert noted == [1]


def test_what_is_no_event_is_named():
    env = Clock()

    def wrong():
        yield 3

    env.process(wrong())
    with pytest.raises(UserError, match=r"test_clock.py.*in wrong.*a process yields the event"):
        env.run(until=3)


class Item(NamedTuple):
    flow: str
    number: int


def test_a_queue_keeps_the_newest_of_each_flow_and_gives_the_oldest():
    env, taken = Clock(), []
    queue = NewestQueue[Item](env, 2)
    pushed_out = [
        queue.put(Item(flow, number)) for number, flow in enumerate(["a", "b", "a", "a", "b", "a"])
    ]
    assert pushed_out == [None, None, None, Item("a", 0), None, Item("a", 2)]
    assert queue.oldest_of_full("a") == Item("a", 3) and queue.oldest_of_full("c") is None

    def takes():
        while True:
            taken.append((yield queue.get()))

    env.process(takes())
    env.run(until=1)
    assert [item.number for item in taken] == [1, 3, 4, 5] and not len(queue)
    queue.put(Item("a", 6))
    assert not len(queue), "the process that waits takes it"
    env.run(until=2)
    assert taken[-1] == Item("a", 6)


def test_takers_of_a_queue_take_turns():
    env, taken = Clock(), []
    queue = NewestQueue[Item](env, 5)

    def takes(name: str):
        while True:
            item = yield queue.get()
            yield env.timeout(10)
            taken.append((name, item.number, env.now))

    for name in ("first", "second"):
        env.process(takes(name))
    for number in range(3):
        env.after(number, queue.put, (Item("a", number),))
    env.run(until=100)
    assert taken == [("first", 0, 10), ("second", 1, 11), ("first", 2, 20)]


@pytest.mark.parametrize("method", ["remote", "genie"])
def test_while_time_runs_nothing_is_left_to_pythons_collector(method):
    small.simulated(small.scenario([method]))  # what is made once a process
    world, _ = small.world(small.scenario([method]))
    gc.disable()
    gc.freeze()  # what other tests left is not searched
    try:
        world.run()
        assert gc.collect() == 0
    finally:
        gc.unfreeze()
        gc.enable()


def test_a_queue_is_counted_between_samples_too():
    """Two come at 10, one is taken at 40, two more at 50, of which one pushes the other out."""
    clock = Clock()
    queue = NewestQueue[Item](clock, 2)

    def course():
        yield clock.timeout(10)
        queue.put(Item("a", 1))
        queue.put(Item("a", 2))
        yield clock.timeout(30)
        yield queue.get()
        yield clock.timeout(10)
        queue.put(Item("a", 3))
        queue.put(Item("a", 4))
        yield clock.timeout(40)
        assert (queue.occupancy.total_ns, queue.occupancy.most) == (150, 2)
        queue.clear()
        yield clock.timeout(100)

    clock.process(course())
    clock.run()
    assert queue.occupancy.total_ns == 2 * 30 + 10 + 2 * 40


def test_the_occupancy_is_the_integral_of_how_many_wait():
    clock, rng = Clock(), random.Random(5)
    waiting, total_ns, most = 0, 0, 0
    occupancy = Occupancy(clock)

    def course():
        nonlocal waiting, total_ns, most
        for _ in range(500):
            if waiting and rng.random() < 0.5:
                count = rng.randint(1, waiting)
                occupancy.leave(count)
                waiting -= count
            else:
                occupancy.enter()
                waiting += 1
            delay_ns = rng.randrange(50)
            most = max(most, waiting if delay_ns else 0)
            total_ns += waiting * delay_ns
            yield clock.timeout(delay_ns)
            assert occupancy.total_ns == total_ns
        assert occupancy.most == most

    clock.process(course())
    clock.run()
