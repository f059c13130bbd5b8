"""The same station in other simulators, each in its own Python if need be: none of them is needed
by the project.

    echo '{"phases_ns": [0, 5], "frames": 10, "servers": 1, "service_ns": 3, "period_ns": 10}' |
        python peers.py ciw

prints frames, processor time [s] and mean response [ns] as JSON, or why there are none. Only the
simulation is timed, not the import. Each is written as its documentation does, and the choice that
makes it faster is taken where there is one.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.station import Process, Station

Responses = list[float]
LONGEST_S = 120


def leafsim(station: Station) -> Responses:
    """LEAF: the SimPy idiom, with a task placed on a node for each frame. LEAF has no queue, so a
    ``Resource`` is.
    """
    import simpy
    from leaf.application import Task  # type: ignore[import-not-found]
    from leaf.infrastructure import Node  # type: ignore[import-not-found]

    env = simpy.Environment(initial_time=0)
    servers = simpy.Resource(env, station.servers)
    node = Node("edge", cu=station.servers)
    responses: Responses = []

    def camera(phase_ns: int, frames: int) -> Process:
        yield env.timeout(phase_ns)
        for _ in range(frames):
            env.process(frame())
            yield env.timeout(station.period_ns)

    def frame() -> Process:
        arrived_ns = env.now
        with servers.request() as server:
            yield server
            task = Task(cu=1)
            task.allocate(node)
            yield env.timeout(station.service_ns)
            task.deallocate()
        responses.append(env.now - arrived_ns)

    for number, phase_ns in enumerate(station.phases_ns):
        env.process(camera(phase_ns, station.frames_of(number)))
    env.run()
    return responses


def ciw(station: Station) -> Responses:
    """Ciw: one node. All cameras are merged into one arrival process; one for each camera would be
    slower.
    """
    import ciw  # type: ignore[import-not-found]

    arrivals = sorted(
        phase_ns + number * station.period_ns
        for camera, phase_ns in enumerate(station.phases_ns)
        for number in range(station.frames_of(camera))
    )
    gaps = [
        float(later - earlier) for earlier, later in zip([0, *arrivals], arrivals, strict=False)
    ]
    never = 2.0 * (arrivals[-1] + station.frames * station.service_ns)
    network = ciw.create_network(
        arrival_distributions=[ciw.dists.Sequential([*gaps, never])],
        service_distributions=[ciw.dists.Deterministic(float(station.service_ns))],
        number_of_servers=[station.servers],
    )
    simulation = ciw.Simulation(network)
    simulation.simulate_until_max_customers(station.frames, method="Finish")
    return [record.exit_date - record.arrival_date for record in simulation.get_all_records()]


def salabim(station: Station) -> Responses:
    """salabim: a component for each camera and each frame, and a resource."""
    import salabim as sim  # type: ignore[import-not-found]

    sim.yieldless(False)
    env = sim.Environment(trace=False)
    servers = sim.Resource("servers", capacity=station.servers)
    responses: Responses = []

    class Frame(sim.Component):  # type: ignore[misc]
        def process(self) -> Iterator[Any]:
            arrived = env.now()
            yield self.request(servers)
            yield self.hold(station.service_ns)
            self.release(servers)
            responses.append(env.now() - arrived)

    class Camera(sim.Component):  # type: ignore[misc]
        def process(self, phase_ns: int, frames: int) -> Iterator[Any]:
            yield self.hold(phase_ns)
            for _ in range(frames):
                Frame()
                yield self.hold(station.period_ns)

    for number, phase_ns in enumerate(station.phases_ns):
        Camera(phase_ns=phase_ns, frames=station.frames_of(number))
    env.run()
    return responses


# The engine, and the package that must be importable for it.
PEERS: dict[str, tuple[Callable[[Station], Responses], str]] = {
    "leafsim": (leafsim, "leaf"),
    "ciw": (ciw, "ciw"),
    "salabim": (salabim, "salabim"),
}

MAX_CARS = {"salabim": 100}  # more would take as long as all the rest of the benchmark


def run_peer(python: str, name: str, station: Station) -> dict[str, Any]:
    """Simulates the station with a peer in another process: ``frames``, ``cpu_s``,
    ``mean_response_ns`` and ``version``, or ``skipped`` with the reason.
    """
    try:
        ran = subprocess.run(
            [python, str(Path(__file__).resolve()), name],
            input=json.dumps(asdict(station)),
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
    name = sys.argv[1]
    engine, module = PEERS[name]
    given = json.load(sys.stdin)
    station = Station(**{**given, "phases_ns": tuple(given["phases_ns"])})
    try:
        importlib.import_module(module)
    except ImportError as error:
        print(json.dumps({"skipped": str(error)}))
        return
    # what it imports late is not timed
    engine(Station((0,), frames=1, servers=1, service_ns=1, period_ns=2))
    began_s = time.process_time()
    responses = engine(station)
    cpu_s = time.process_time() - began_s
    mean_ns = sum(responses) / len(responses)
    version = metadata.version(name)
    print(
        json.dumps(
            {
                "frames": len(responses),
                "cpu_s": cpu_s,
                "mean_response_ns": mean_ns,
                "version": version,
            }
        )
    )


if __name__ == "__main__":
    main()
