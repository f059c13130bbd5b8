"""Theory against everything at once: cars in a world, their tables read as a user reads them.

Frames come at random (Poisson), detections take what the shipped law of a device says, a shifted
log-normal one. So a detector under ``local`` is M/G/1: Pollaczek-Khinchine gives the mean response.
Little's law and the utilization law join what is sampled every 100 ms with what each frame and each
law says: none of them is true by construction.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from genie_sim.base.settings import from_plain, plain_data
from genie_sim.core.header import Header
from genie_sim.data.trace import Trace
from genie_sim.runs import build
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Device, ServiceTime
from genie_sim.sim.host import Host
from genie_sim.sim.monitor import SpanLabel
from tests.make import drive, scenario, street
from tests.sim.processes import then
from tests.theory.replications import equivalent, replicate
from tests.theory.test_queues import arrivals, pollaczek_khinchine

pytestmark = [pytest.mark.no_cover, pytest.mark.slow]

DEVICE, MODEL, FRAMES = "agx_xavier", "autoware_vision_detector", 3000
WARM_UP = 300  # frames before the queue has forgotten that it began empty
SPREAD = "loaded"  # the widest of the shipped laws
NS_PER_S = 10**9
RHO = 0.7


def squared_variation(law: ServiceTime) -> float:
    """Variance over squared mean of median (loc + (1 - loc) exp(sigma Z))."""
    variance = (
        (law.median_ns * (1 - law.loc)) ** 2 * math.expm1(law.sigma**2) * math.exp(law.sigma**2)
    )
    return variance / law.mean_ns**2


@functools.cache
def without_hops() -> DeviceProfile:
    """The shipped device on which messages between processes take no time."""
    written = plain_data(load_profile(DEVICE))
    for hop in written["hop"].values():
        hop["value"] = "0 ms"
    return from_plain(DeviceProfile, written)


def device() -> Device:
    return build.device(without_hops(), MODEL, SPREAD)


def test_the_law_in_use_is_log_normal_and_spread():
    """Else the tests below would be those of M/D/1."""
    law = device().detector_time
    assert 0 < law.loc < 1 and squared_variation(law) > 0.01
    drawn = np.fromiter(
        (law.at(z) for z in np.random.default_rng(1).standard_normal(200_000)), float
    )
    assert drawn.mean() == pytest.approx(law.mean_ns, rel=0.005)
    assert drawn.var() / drawn.mean() ** 2 == pytest.approx(squared_variation(law), rel=0.05)


@pytest.mark.nightly
def test_detections_on_a_host_match_m_g_1():
    """A host's accelerator as nodes use it: the host draws the times, from the log-normal law."""
    made = replace(device(), detector_time=replace(device().detector_time, loc=0.2, sigma=0.8))
    law = made.detector_time

    def experiment(rng: np.random.Generator) -> float:
        env = Clock()
        host = Host(env, "car1", made, seed=int(rng.integers(2**31)))
        took: list[int] = []

        def come(number: int) -> None:
            came_ns = env.now
            label = SpanLabel("inference", "car1")
            inference = host.infer(Header(number, "camera", "car1"), label)
            then(env, inference, lambda: took.append(env.now - came_ns))

        mean_gap = law.mean_ns / 65_000_000  # ``arrivals`` counts in service times of 65 ms
        env.process(arrivals(env, rng, RHO / mean_gap, 1, 6000, come))
        env.run()
        assert host.accelerator.completed == len(took) == 6000 and host.cpu.completed == 0
        return float(np.mean(took[WARM_UP:])) / law.mean_ns

    took = replicate(experiment, replications=30, seed=11)
    assert equivalent(
        took, expected=1 + pollaczek_khinchine(RHO, squared_variation(law)), margin=0.08
    )


def at_random(rng: np.random.Generator, rate_per_s: float) -> Trace:
    """Frames that come as a Poisson process."""
    stamps_ns = np.cumsum(
        np.maximum(rng.exponential(NS_PER_S / rate_per_s, FRAMES).astype(np.int64), 1)
    )
    one = street(seconds=0.1, recordings=("02",)).frames["02"][0]
    frames = [
        replace(one, index=index, stamp_ns=int(stamp_ns), digest=str(index), detections=())
        for index, stamp_ns in enumerate(stamps_ns)
    ]
    return Trace("street", (49.0, 8.4, 110.0), {"02": tuple(frames)}, {"made_by": "tests"})


@functools.cache
def worlds(method: str, replications: int) -> tuple[dict[str, float], ...]:
    """What a whole world gives, in each replication: rates, responses, queues and use of what bears
    the load.
    """
    law, found = device().detector_time, []
    rate_per_s = RHO * NS_PER_S / law.mean_ns

    def experiment(rng: np.random.Generator) -> float:
        car = {"name": "car1", "device": DEVICE, "edge": "edge1", "link": "ethernet_1g"}
        setting = scenario(
            [car],
            methods=[method],
            seed=int(rng.integers(2**31)),
            queue_length=10**6,
            spread=SPREAD,
            cameras=[{"name": "front", "recording": "02"}],
        )
        devices = {DEVICE: without_hops()}
        tables = drive(setting, at_random(rng, rate_per_s), devices)
        frames, samples = tables["frames"], tables["resources"]
        assert frames["first_answer_ns"].notna().all(), "nothing is dropped"
        end_ns = int(frames["received_ns"].max())
        samples = samples[samples["t_ns"] <= end_ns]
        host = "car1" if method == "local" else "edge1"
        waiting = samples[samples["resource"].str.startswith(f"{host}/vision_darknet_detect")]
        last = waiting.iloc[-1]
        used = samples[samples["resource"] == f"{host}.accelerator"].iloc[-1]
        took_ns = (frames["first_answer_ns"] - frames["received_ns"]).to_numpy(float)
        found.append(
            {
                "response": took_ns[WARM_UP:].mean() / law.mean_ns,
                "all_responses_ns": took_ns.mean(),
                "queue": last["queue_ns"] / last["t_ns"],
                "rate_per_ns": FRAMES / end_ns,
                "service_ns": used["busy_ns"] / used["completed"],
                "utilization": used["busy_ns"] / used["t_ns"],
                "link": sum(samples[samples["resource"] == "car1->edge1"]["busy_ns"].iloc[-1:])
                / end_ns,
            }
        )
        return 0.0

    replicate(experiment, replications=replications, seed=12)
    return tuple(found)


def test_a_world_under_local_matches_m_g_1():
    law = device().detector_time
    expected = 1 + pollaczek_khinchine(RHO, squared_variation(law))
    assert equivalent(
        [one["response"] for one in worlds("local", 30)], expected=expected, margin=0.06
    )


def test_little_s_law_holds_in_a_world():
    """Images that wait on average, against the frames' rate times their own mean wait."""
    ratios = [
        one["queue"] / (one["rate_per_ns"] * (one["all_responses_ns"] - one["service_ns"]))
        for one in worlds("local", 30)
    ]
    assert equivalent(ratios, expected=1.0, margin=0.03)


@pytest.mark.parametrize(("method", "replications"), [("local", 30), ("remote", 4)])
def test_the_utilization_law_holds_in_a_world(method: str, replications: int):
    """Of the accelerator that detects: its use, sampled, against the frames' rate times the mean of
    its law.
    """
    service_ns = device().detector_time.mean_ns
    ratios = [
        one["utilization"] / (one["rate_per_ns"] * service_ns)
        for one in worlds(method, replications)
    ]
    assert equivalent(ratios, expected=1.0, margin=0.02)


def test_the_utilization_law_holds_for_a_link():
    """Of 1 Gbit/s Ethernet: the bits of an image, with 90 bytes more a segment of 1,448, times the
    frames' rate.
    """
    image_ns = 8 * (1_397_297 + 90 * math.ceil(1_397_297 / 1448))
    ratios = [one["link"] / (one["rate_per_ns"] * image_ns) for one in worlds("remote", 4)]
    assert equivalent(ratios, expected=1.0, margin=0.02)
