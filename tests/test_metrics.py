"""Metrics are arithmetic on the tables: worked by hand where that is possible, against known truths elsewhere."""

from __future__ import annotations

import made_up_run
import numpy as np
import pandas as pd
import pytest

from genie_sim.analysis import metrics
from genie_sim.analysis.metrics import Metric, compute
from genie_sim.recording.records import Frame, FrameTable, LookupTable, ResourceTable

MS = 1_000_000
S = 1_000_000_000


def six_frames() -> pd.DataFrame:
    """Three frames seen by local and by genie, one a second, each received 2 ms after its stamp.

    Local takes 300 and 200 ms and drops the second frame. Genie answers the first two at once (10 and 30 ms; the
    second with nothing, its detection follows after 80 ms) and has not got to the third when the run ends.
    """
    table = FrameTable()
    took = {"local": [(300, 300, 4), None, (200, 200, 5)], "genie": [(10, 10, 4), (30, 80, 0), None]}
    for method, answers in took.items():
        for frame, answer in enumerate(answers):
            received_ns = frame * S + 2 * MS
            row = Frame(method, "car1", "camera_02", frame, 0, frame * S, received_ns)
            if answer is not None:
                first_ms, fresh_ms, row.objects_served = answer
                row.first_answer_ns = received_ns + first_ms * MS
                row.fresh_answer_ns = received_ns + fresh_ms * MS
            elif method == "local":
                row.drop = "car1/detector:/image_raw"
            table.add(row)
    return table.to_frame()


def events(genie: str, role: str, kind: str, hits: list[int], requests: int = 1, asker: str | None = "client"):
    """One look-up event a second, as rows for ``LookupTable.add``."""
    asker = asker if kind == "image" else None
    return [
        (i * S, genie, role, kind, asker, "car1", "camera_02", i * S, None, requests, hit, hit, 0.1 * hit, i + 1)
        for i, hit in enumerate(hits)
    ]


def lookup_table(*rows: tuple) -> pd.DataFrame:
    table = LookupTable()
    for row in rows:
        table.add(*row)
    return table.to_frame()


def found(all_metrics: list[Metric]) -> dict[tuple[str, str], Metric]:
    assert len({(metric.name, metric.role) for metric in all_metrics}) == len(all_metrics)
    return {(metric.name, metric.role): metric for metric in all_metrics}


def of_tables(frames=None, lookups=None, resources=None) -> dict[tuple[str, str], Metric]:
    empty = [kind().to_frame() for kind in (FrameTable, LookupTable, ResourceTable)]
    given = (frames, lookups, resources)
    return found(compute(*(e if table is None else table for table, e in zip(given, empty, strict=True))))


def test_six_frames_worked_by_hand():
    result = of_tables(frames=six_frames())
    value = {key: metric.value for key, metric in result.items()}
    assert value["first_answer_mean", "local"] == 250.0
    assert value["first_answer_p50", "genie"] == 20.0
    assert value["first_answer_p99", "genie"] == pytest.approx(29.8)
    assert value["fresh_answer_mean", "genie"] == 45.0
    assert value["improvement_first_answer", "local"] == pytest.approx(1 - 20 / 250)
    assert value["improvement_fresh_answer", "local"] == pytest.approx(1 - 45 / 250)
    assert value["answered_share", "local"] == value["answered_share", "genie"] == pytest.approx(2 / 3)
    assert value["dropped_share", "local"] == pytest.approx(1 / 3)
    assert value["dropped_share", "genie"] == 0.0
    assert value["under_deadline_share", "genie"] == pytest.approx(2 / 3)  # of the published frames
    assert value["under_deadline_share_of_answered", "genie"] == 1.0
    assert value["fresh_under_deadline_share", "genie"] == pytest.approx(1 / 3)
    assert value["empty_answer_share", "genie"] == pytest.approx(1 / 3)
    # local: two fresh answers between the first stamp and the last answer at 2.202 s
    assert value["fresh_answer_throughput", "local"] == pytest.approx(2 / 2.202)
    assert ("improvement_first_answer", "remote") not in value  # remote was not simulated


@pytest.mark.parametrize("seed", [1, 2])
def test_every_published_frame_is_answered_or_dropped_or_in_flight(seed):
    frames = made_up_run.frames(cars=2, seconds=4, seed=seed).to_frame()
    for table in (six_frames(), frames):
        value = {key: metric.value for key, metric in of_tables(frames=table).items()}
        for method in set(table["method"]):
            parts = [value[f"frames_{part}", method] for part in ("answered", "dropped", "in_flight")]
            assert sum(parts) == value["frames_published", method] == (table["method"] == method).sum()


def test_a_frame_that_is_dropped_after_a_first_answer_is_not_a_dropped_frame():
    """Genie answers from the map, then the detector's queue drops the frame: the car did get an answer."""
    table = FrameTable()
    dropped = {"received_ns": 0, "first_answer_ns": 9 * MS, "drop": "car1/detector:/image_raw"}
    table.add(Frame("genie", "car1", "camera_02", 0, 0, 0, **dropped))
    result = of_tables(frames=table.to_frame())
    assert result["frames_answered", "genie"].value == 1
    assert result["frames_dropped", "genie"].value == 0


def test_what_is_not_defined_is_none():
    """No frame was ever answered, and the run was over within one second: no latency, and no interval."""
    table = FrameTable()
    table.add(Frame("local", "car1", "camera_02", 0, 0, 0))
    result = of_tables(frames=table.to_frame())
    assert result["first_answer_mean", "local"] == Metric("first_answer_mean", "local", None, "ms")
    assert result["under_deadline_share_of_answered", "local"].value is None
    share = result["answered_share", "local"]
    assert (share.value, share.low, share.high) == (0.0, None, None)
    assert of_tables() == {}


def autocorrelated_run(rng: np.random.Generator, mean_ms: float) -> pd.DataFrame:
    """Two cars, 20 frames a second for 40 s; latencies of neighbouring frames are correlated by 0.8."""
    table = FrameTable()
    for car in ("car1", "car2"):
        deviation = 0.0
        for frame in range(800):
            deviation = 0.8 * deviation + rng.standard_normal()
            answer_ns = int((mean_ms + deviation) * MS)
            table.add(Frame("genie", car, "camera_02", frame, 0, frame * 50 * MS, 0, answer_ns))
    return table.to_frame()


def test_the_interval_inside_a_run_covers_the_true_mean_and_median():
    """Nominal 95 %, 200 runs, seed 5. Taking the frames for independent would cover half of the times only."""
    rng = np.random.default_rng(5)
    covered, median_covered, naive = 0, 0, 0
    for _ in range(200):
        frames = autocorrelated_run(rng, mean_ms=30.0)
        result = of_tables(frames=frames)
        mean, median = result["first_answer_mean", "genie"], result["first_answer_p50", "genie"]
        covered += mean.low < 30.0 < mean.high
        median_covered += median.low < 30.0 < median.high
        error = 1.96 * (frames["first_answer_ns"] / MS).std() / np.sqrt(len(frames))
        naive += abs(mean.value - 30.0) < error
    print(f"covered: mean {covered}/200, median {median_covered}/200, frames taken for independent {naive}/200")
    assert 0.88 <= covered / 200 <= 0.99
    assert 0.88 <= median_covered / 200 <= 0.99
    assert naive / 200 < 0.75


def test_the_interval_of_an_improvement_narrows_when_both_arms_share_their_ups_and_downs():
    """Genie takes a tenth of what local takes, second by second: so the improvement is exact, the means are not."""
    table = FrameTable()
    for method, factor in (("local", 1.0), ("genie", 0.1)):
        for frame in range(100):
            answer_ns = int(factor * (200 + 10 * (frame // 10)) * MS)
            table.add(Frame(method, "car1", "camera_02", frame, 0, frame * 100 * MS, 0, answer_ns))
    result = of_tables(frames=table.to_frame())
    improvement, mean = result["improvement_first_answer", "local"], result["first_answer_mean", "local"]
    assert improvement.value == pytest.approx(0.9)
    assert mean.high - mean.low > 20
    assert improvement.high - improvement.low < 1e-9


def test_reuse_is_the_mean_over_the_genies_of_a_role():
    """Car 1 hits 10 of 20, car 2 1 of 4: the mean of the ratios is 0.375, not 11 of 24."""
    table = lookup_table(
        *events("car1/genie", "local", "image", [0, 1] * 10),
        *events("car2/genie", "local", "image", [1, 0, 0, 0]),
        *events("edge1/genie", "remote", "image", [1] * 5),
    )
    result = of_tables(lookups=table)
    assert result["image_reuse", "local"].value == 0.375
    assert result["image_reuse", "remote"].value == 1.0
    assert result["image_reuse", "local"].n == 24
    assert result["image_reuse", "local"].low is None  # nobody made 50 requests
    assert result["stored_images", "local"].value == (20 + 4) / 2


def test_neighbours_requests_count_apart():
    own = events("edge1/genie", "remote", "image", [1, 0, 0, 0])
    neighbours = events("edge1/genie", "remote", "image", [1, 1, 1, 1], asker="neighbour")
    result = of_tables(lookups=lookup_table(*own, *neighbours))
    assert result["image_reuse", "remote"].value == 0.25
    assert result["image_reuse_with_neighbours", "remote"].value == 5 / 8


def test_object_reuse_counts_look_ups_not_messages_and_tells_its_kinds_apart():
    sightings = events("car1/genie", "local", "sighting", [3, 0], requests=4)
    boosts = events("car1/genie", "local", "boost", [2, 2], requests=2)
    result = of_tables(lookups=lookup_table(*sightings, *boosts))
    assert result["object_reuse", "local"].value == pytest.approx(7 / 12)
    assert result["object_reuse_sighting", "local"].value == 3 / 8
    assert result["object_reuse_boost", "local"].value == 1.0
    assert result["image_reuse", "local"].value is None
    assert result["confidence_boost", "local"].value == pytest.approx(0.1)
    assert result["confidence_boost", "local"].n == 7


def test_error_bars_are_the_extreme_windows_of_50_requests():
    """100 misses, 40 hits, 60 misses: the best 50 requests in a row hold all 40 hits, the worst none."""
    table = lookup_table(*events("car1/genie", "local", "image", [0] * 100 + [1] * 40 + [0] * 60))
    metric = of_tables(lookups=table)["image_reuse", "local"]
    assert (metric.value, metric.low, metric.high) == (0.2, 0.0, 0.8)


def test_windows_of_objects_hold_whole_messages():
    """20 requests a message: a window needs three messages, 60 requests, to hold 50."""
    table = lookup_table(*events("car1/genie", "local", "sighting", [20, 0, 10, 20], requests=20))
    windows = metrics.windowed_reuse(table)
    assert list(windows["t_ns"]) == [2 * S, 3 * S]
    assert list(windows["ratio"]) == [30 / 60, 30 / 60]


def test_the_running_boost_weighs_updates_not_events():
    table = lookup_table(
        (0, "g", "local", "boost", None, "car1", "c", 0, None, 1, 1, 1, 0.10, 1),
        (1, "g", "local", "boost", None, "car1", "c", 0, None, 1, 0, 0, 0.00, 1),
        (2, "g", "local", "boost", None, "car1", "c", 0, None, 3, 3, 3, 0.06, 1),
    )
    curve = metrics.running_boost(table)
    assert list(curve["updates"]) == [1, 4]
    assert list(curve["boost"]) == pytest.approx([0.10, 0.04])


def test_resources_tell_utilisation_queue_and_throughput():
    """An accelerator of 2 slots, busy for 3 of 2 x 2 slot-seconds; a queue of 0 and 4 messages."""
    table = ResourceTable()
    table.add("genie", 1 * S, "edge1.accelerator", "accelerator", 2, 1 * S, 0, 10, 0, None)
    table.add("genie", 2 * S, "edge1.accelerator", "accelerator", 2, 3 * S, 4, 30, 1, None)
    table.add("genie", 2 * S, "edge1:/image_raw", "queue", None, 0, 1, 5, 7, None)
    table.add("genie", 2 * S, "car1->edge1", "link", 1, 1 * S, 0, 3, 0, 4_000)
    result = of_tables(resources=table.to_frame())
    accelerator = "genie: edge1.accelerator"
    assert result["utilisation", accelerator].value == 0.75
    assert result["queue_mean", accelerator].value == 2.0
    assert result["queue_max", accelerator].value == 4
    assert result["throughput", accelerator].value == 15.0
    assert result["dropped", "genie: edge1:/image_raw"].value == 7
    assert ("utilisation", "genie: edge1:/image_raw") not in result
    assert result["bytes", "genie: car1->edge1"].value == 4_000
    assert ("bytes", accelerator) not in result


def test_utilisation_is_not_diluted_by_the_wait_for_the_last_answers():
    """Busy all the time until the last frame at 2 s; the run goes on for 8 s to see what still comes."""
    frames, resources = FrameTable(), ResourceTable()
    frames.add(Frame("local", "car1", "camera_02", 0, 0, 0))
    frames.add(Frame("local", "car1", "camera_02", 1, 0, 2 * S))
    for second in range(11):
        busy_ns, done = min(second, 2) * S, min(3 * second, 7)
        resources.add("local", second * S, "car1.accelerator", "accelerator", 1, busy_ns, 0, done, 0, None)
    result = of_tables(frames=frames.to_frame(), resources=resources.to_frame())
    assert result["utilisation", "local: car1.accelerator"].value == 1.0
    assert result["throughput", "local: car1.accelerator"].value == 3.0
    assert result["completed", "local: car1.accelerator"].value == 7


def test_the_order_of_frames_in_memory_does_not_matter():
    tables = made_up_run.frames(1, 3), made_up_run.lookups(1, 100), made_up_run.resources(1, 10)
    frames, lookups, resources = (table.to_frame() for table in tables)
    shuffled = frames.sample(frac=1, random_state=3)
    for one, other in zip(compute(frames, lookups, resources), compute(shuffled, lookups, resources), strict=True):
        assert (one.name, one.role, one.n) == (other.name, other.role, other.n)
        assert one.value == pytest.approx(other.value)


def test_what_is_stored_is_what_the_last_look_up_found():
    lookups = LookupTable()
    for second, entries in enumerate((3, 9, 4)):
        at = second * S
        lookups.add(at, "car1/genie", "local", "image", "client", "car1", "c", at, "miss", 1, 0, 0, 0.0, entries)
    assert of_tables(lookups=lookups.to_frame())["stored_images", "local"].value == 4.0
