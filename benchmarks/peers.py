"""The pipeline of ``plain_simpy`` in other simulators, each in its own words.

    python benchmarks/peers.py ciw < fleet.json

prints the answers and the processor time [s] as JSON, or why there are none. None of them is needed
by the project: they may live in a Python of their own, which needs nothing but the simulator and
SimPy. Only the simulation is timed, not the import.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks import plain_simpy
from benchmarks.plain_simpy import Answer, Fleet, Frame, Process, hop_ns

LONGEST_S = 600


def leafsim(fleet: Fleet) -> list[Answer]:
    """LEAF: plain SimPy, with a task on a node while a detection runs. A node has no queue, and a
    link carries flows and no messages.
    """
    from leaf.application import Task  # type: ignore[import-not-found]
    from leaf.infrastructure import Node  # type: ignore[import-not-found]

    def accelerator(env: Any, queue: Any, publish: plain_simpy.Answered) -> Process:
        node = Node("accelerator", cu=1)
        while True:
            frame = yield queue.get()
            task = Task(cu=1)
            task.allocate(node)
            yield env.timeout(frame.detection_ns)
            task.deallocate()
            publish(frame)

    return plain_simpy.simulate(fleet, accelerator)


def ciw(fleet: Fleet) -> list[Answer]:
    """Ciw: a network of stations through which each frame has a route. Its queues never drop the
    older frame for the newer one, so every frame is answered.
    """
    import ciw  # type: ignore[import-not-found]

    frames = sorted((frame for frames in fleet.cameras for frame in frames), key=lambda it: it[2])
    cars, edges = fleet.edge_of, fleet.edges
    flight, answer_hop = 2, 3  # the first station is the hop of images
    up = {car: 4 + 2 * number for number, car in enumerate(cars)}  # and down, the one after it
    accelerators = {edge: 4 + 2 * len(cars) + number for number, edge in enumerate(edges)}

    class Takes(ciw.dists.Distribution):  # type: ignore[misc]
        def __init__(self, time_ns: Callable[[Frame], int]) -> None:
            self.time_ns = time_ns

        def sample(self, t: float | None = None, ind: Any = None) -> float:
            return float(self.time_ns(frames[ind.id_number - 1]))

    def route(individual: Any, _: Any) -> list[int]:
        frame = frames[individual.id_number - 1]
        accelerator = accelerators[cars[frame.car]]
        return [up[frame.car], flight, accelerator, answer_hop, up[frame.car] + 1, flight]

    stations: list[Callable[[Frame], int]] = [
        lambda frame: hop_ns(fleet.car_hop_ns, frame.image_bytes),
        lambda _: fleet.flight_ns,
        lambda frame: hop_ns(fleet.edge_hop_ns, frame.answer_bytes),
        *[
            lambda frame: fleet.sending_ns(frame.image_bytes),
            lambda frame: fleet.sending_ns(frame.answer_bytes),
        ]
        * len(cars),
        *[lambda frame: frame.detection_ns] * len(edges),
    ]
    stamps = [0, *(frame.stamp_ns for frame in frames)]
    gaps = [float(later - earlier) for earlier, later in pairwise(stamps)]
    network = ciw.create_network(
        arrival_distributions=[ciw.dists.Sequential([*gaps, float("inf")])]
        + [None] * (len(stations) - 1),
        service_distributions=[Takes(time_ns) for time_ns in stations],
        number_of_servers=[float("inf")] * 3 + [1] * (len(stations) - 3),
        routing=ciw.routing.ProcessBased(route),
    )
    simulation = ciw.Simulation(network)
    simulation.simulate_until_max_customers(len(frames), method="Finish")
    left_ns: dict[int, float] = {}
    for record in simulation.get_all_records():
        number = record.id_number - 1
        left_ns[number] = max(left_ns.get(number, 0.0), record.exit_date)
    return [(*frames[number][:3], round(time_ns)) for number, time_ns in left_ns.items()]


def salabim(fleet: Fleet) -> list[Answer]:
    """salabim: a component for each frame, camera, link and accelerator, and a queue of its own for
    each server, from which a frame takes the one that it replaces.
    """
    import salabim as sim  # type: ignore[import-not-found]

    sim.yieldless(False)
    env = sim.Environment(trace=False)
    answers: list[Answer] = []

    class Server(sim.Component):  # type: ignore[misc]
        def setup(self, time_ns: Callable[[Frame], int], flow: Callable[[Frame], Any]) -> None:
            self.time_ns, self.flow = time_ns, flow
            self.queue = sim.Queue()

        def process(self) -> Iterator[Any]:
            while True:
                while not self.queue:
                    yield self.passivate()
                message = self.queue.pop()
                yield self.hold(self.time_ns(message.frame))
                message.activate()

    class Message(sim.Component):  # type: ignore[misc]
        def setup(self, frame: Frame) -> None:
            self.frame = frame

        def process(self) -> Iterator[Any]:
            frame = self.frame
            yield self.hold(hop_ns(fleet.car_hop_ns, frame.image_bytes))
            yield from self.through(up[frame.car])
            yield self.hold(fleet.flight_ns)
            yield from self.through(accelerators[fleet.edge_of[frame.car]])
            yield self.hold(hop_ns(fleet.edge_hop_ns, frame.answer_bytes))
            yield from self.through(down[frame.car])
            yield self.hold(fleet.flight_ns)
            answers.append((frame.car, frame.camera, frame.stamp_ns, round(env.now())))

        def through(self, server: Server) -> Iterator[Any]:
            for older in list(server.queue):
                if server.flow(older.frame) == server.flow(self.frame):
                    older.leave(server.queue)
                    older.cancel()
            self.enter(server.queue)
            if server.ispassive():
                server.activate()
            yield self.passivate()

    class Camera(sim.Component):  # type: ignore[misc]
        def setup(self, frames: list[Frame]) -> None:
            self.frames = frames

        def process(self) -> Iterator[Any]:
            for frame in self.frames:
                yield self.hold(till=frame.stamp_ns)
                Message(frame=frame)

    def link(size: str) -> Server:
        return Server(
            time_ns=lambda frame: fleet.sending_ns(getattr(frame, size)),
            flow=lambda frame: frame.camera,
        )

    def accelerator() -> Server:
        return Server(time_ns=lambda frame: frame.detection_ns, flow=lambda _: None)

    up = {car: link("image_bytes") for car in fleet.edge_of}
    down = {car: link("answer_bytes") for car in fleet.edge_of}
    accelerators = {edge: accelerator() for edge in fleet.edges}
    for frames in fleet.cameras:
        Camera(frames=frames)
    env.run()
    return answers


# The engine, and the package that must be importable for it.
PEERS: dict[str, tuple[Callable[[Fleet], list[Answer]], str]] = {
    "leafsim": (leafsim, "leaf"),
    "ciw": (ciw, "ciw"),
    "salabim": (salabim, "salabim"),
}
MOST_FRAMES = {"ciw": 15_000, "salabim": 15_000}  # more would take as long as all the rest


def run_peer(python: str, name: str, fleet: Fleet) -> dict[str, Any]:
    """Simulates a fleet with a peer in another process: ``answers``, ``cpu_s`` and ``version``, or
    ``skipped`` with the reason.
    """
    if fleet.frames > MOST_FRAMES.get(name, fleet.frames):
        return {"skipped": f"{fleet.frames:,} frames would take minutes"}
    try:
        ran = subprocess.run(
            [python, str(Path(__file__).resolve()), name],
            input=json.dumps(asdict(fleet)),
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return {"skipped": f"{type(error).__name__}: {error}"}
    if ran.returncode:
        return {"skipped": (ran.stderr.strip() or "no reason given").splitlines()[-1]}
    answer: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
    return answer


def main() -> None:
    engine, module = PEERS[sys.argv[1]]
    fleet = Fleet(**json.load(sys.stdin))
    fleet = replace(fleet, cameras=[[Frame(*one) for one in camera] for camera in fleet.cameras])
    try:
        importlib.import_module(module)
    except ImportError as error:
        print(json.dumps({"skipped": str(error)}))
        return
    engine(replace(fleet, cameras=[camera[:1] for camera in fleet.cameras[:1]]))  # imports
    began_s = time.process_time()
    answers = engine(fleet)
    cpu_s = time.process_time() - began_s
    version = metadata.version(sys.argv[1])
    print(json.dumps({"answers": answers, "cpu_s": cpu_s, "version": version}))


if __name__ == "__main__":
    main()
