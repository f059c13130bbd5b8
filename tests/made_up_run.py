"""A made-up run with plausible numbers, so that tables can be tested without simulating."""

from __future__ import annotations

import numpy as np

from genie_sim.core.messages import Header
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, LOOKUPS, RESOURCES
from genie_sim.record.results import MethodInfo
from genie_sim.record.tables import Table

MS = 1_000_000
METHODS = (
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)
STREAMS = ("camera_00", "camera_01", "camera_02", "camera_03")
# Median service times [ms] of a TX2 (local) and an AGX Xavier (remote); how many streams a detector
# keeps up with.
DETECTOR_MS = {"local": 310.0, "remote": 65.0}
KEPT = {"local": 0.08, "remote": 0.37}


def frames(cars: int = 3, seconds: int = 10, seed: int = 1, speed: float = 1.0) -> Table:
    """Detectors drop what they cannot keep up with; Genie answers at once and fresh when the
    detection is there.

    ``speed`` divides the remote detector's time.
    """
    rng = np.random.default_rng(seed)
    table = Table(FRAMES)
    for method in ("local", "remote", "genie"):
        for car in range(1, cars + 1):
            for s, stream in enumerate(STREAMS):
                for frame in range(10 * seconds):
                    stamp_ns = (100 * frame + 25 * s) * MS
                    row = OpenFrame(method, Header(stamp_ns, stream, f"car{car}"), frame)
                    received_ns = stamp_ns + 3 * MS
                    row.received_ns = received_ns
                    if method == "genie":
                        _answer_by_genie(row, received_ns, rng, speed)
                    elif rng.random() < KEPT[method] * (speed if method == "remote" else 1):
                        fast = speed if method == "remote" else 1.0
                        took_ms = (
                            DETECTOR_MS[method]
                            / fast
                            * (0.85 + 0.15 * np.exp(0.6 * rng.standard_normal()))
                        )
                        _set(row, received_ns + int(took_ms * MS), "own_detector", rng.poisson(3))
                    else:
                        row.drop = f"{method}/detector:/image_raw"
                    table.append(row.values())
    return table


def _set(row: OpenFrame, t_ns: int, source: str, objects: int) -> None:
    for column in ("first_answer_ns", "fresh_answer_ns"):
        setattr(row, column, t_ns)
    for column in ("objects_served", "objects_fresh"):
        setattr(row, column, int(objects))
    row.source = source


def _answer_by_genie(
    row: OpenFrame, received_ns: int, rng: np.random.Generator, speed: float
) -> None:
    genie_ms = 8.8 * (0.6 + 0.4 * np.exp(0.5 * rng.standard_normal()))
    first_ns = received_ns + int(genie_ms * MS)
    hit = bool(rng.random() < 0.2)
    row.image_hit = hit
    row.coalesced = False
    if hit:
        _set(row, first_ns, "own_cache", rng.poisson(3))
        return
    row.first_answer_ns = first_ns
    row.source = "map"
    row.objects_served = int(rng.poisson(1))
    if rng.random() < 0.4 * speed:
        row.fresh_answer_ns = first_ns + int((20 + 65 / speed * rng.gamma(4, 0.3)) * MS)
        row.objects_fresh = int(rng.poisson(3))


def lookups(cars: int = 3, messages: int = 400, seed: int = 1, lift: float = 1.0) -> Table:
    """Genies on cars and edges; hits become more frequent as the caches fill. ``lift`` multiplies
    them.
    """
    rng = np.random.default_rng(seed)
    table = Table(LOOKUPS)
    for i in range(messages):
        t_ns = i * 25 * MS
        for car in range(1, cars + 1):
            for place, base in (("car", 0.06), ("edge", 0.1)):
                name, level = f"{place}{car}/genie", lift * (0.4 + 0.6 * i / messages)
                hit = bool(rng.random() < base * level)
                outcome, stream = "hit" if hit else "miss", STREAMS[i % 4]
                frame = f"car{car}", stream, t_ns
                what = "genie", t_ns, name, place
                table.append((*what, "image", "client", *frame, outcome, 1, int(hit), 0, 0.0, i))
                asked = 1 + int(rng.poisson(3))
                hits = int(rng.binomial(asked, min(4 * base * level, 1)))
                boost = 0.04 * hits * level * rng.random()
                table.append((*what, "sighting", None, *frame, None, asked, hits, hits, boost, i))
    return table


def resources(cars: int = 3, samples: int = 100) -> Table:
    """Saturated accelerators on the cars, edges half busy with Genie, links one third."""
    table = Table(RESOURCES)
    for method in ("local", "remote", "genie"):
        for i in range(1, samples + 1):
            t_ns = i * 100 * MS
            for car in range(1, cars + 1):
                serving = (
                    (f"car{car}.accelerator", "accelerator", 1 - 0.02 * car, i // 3, None),
                    (f"edge{car}.accelerator", "accelerator", 0.2 * car, i, None),
                    (f"car{car}->edge{car}", "link", 0.1 * car, i, i * 1_397_297),
                )
                for name, kind, busy, completed, carried in serving:
                    used = (1, int(busy * t_ns), 0, completed, 0, carried, 0, 0)
                    table.append((method, t_ns, name, kind, *used))
                name = f"car{car}/detector:/image_raw"
                waiting_ns = sum((k + car) % 3 * 100 * MS for k in range(1, i + 1))
                used = (None, 0, (i + car) % 3, i, 2 * i, None, waiting_ns, 2)
                table.append((method, t_ns, name, "queue", *used))
    return table
