"""The clock of a run is SimPy's environment: what happens at one instant happens in SimPy's
order.
"""

from __future__ import annotations

import gc
import random
from typing import Any

import pytest
import simpy

from genie_sim.runner import prepare, simulate
from genie_sim.sim.clock import Clock
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


def test_a_run_leaves_nothing_to_pythons_collector():
    prepared = prepare(small.scenario(cars=[small.car(1), small.car(2)]))
    simulate(prepared)
    gc.collect()
    gc.disable()
    try:
        simulate(prepared)
        assert gc.collect() == 0
    finally:
        gc.enable()
