"""Metrics are arithmetic on the tables: worked by hand where that is possible, against known truths
elsewhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from genie_sim.analysis import frame_metrics, genie_metrics, metrics
from genie_sim.analysis.statistics import Blocks, wilson
from genie_sim.analysis.tidy import across_seeds
from genie_sim.core.messages import Header
from genie_sim.record.columns import Columns
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, LOOKUPS, RESOURCES, FrameRow
from genie_sim.record.results import MethodInfo, MetricValue
from genie_sim.record.tables import Table
from tests import make
from tests.make import METHODS

MS = 1_000_000
S = 1_000_000_000


def six_frames() -> pd.DataFrame:
    """Three frames seen by local and by genie, one a second, each received 2 ms after its stamp.

    Local takes 300 and 200 ms and drops the second frame. Genie answers the first two at once (10
    and 30 ms; the second with nothing, its detection follows after 80 ms) and has not got to the
    third when the run ends.
    """
    table = Table(FRAMES)
    took = {
        "local": [(300, 300, 4), None, (200, 200, 5)],
        "genie": [(10, 10, 4), (30, 80, 0), None],
    }
    for method, answers in took.items():
        for frame, answer in enumerate(answers):
            received_ns = frame * S + 2 * MS
            row = OpenFrame(method, Header(frame * S, "camera_02", "car1"), frame)
            row.received_ns = received_ns
            if answer is not None:
                first_ms, fresh_ms, row.objects_served = answer
                row.first_answer_ns = received_ns + first_ms * MS
                row.fresh_answer_ns = received_ns + fresh_ms * MS
            elif method == "local":
                row.drop = "car1/detector:/image_raw"
            table.append(row.values())
    return table.to_frame()


def events(
    genie: str,
    kind: str,
    hits: list[int],
    requests: int = 1,
    requester: str = "client",
    method: str = "genie",
):
    """One look-up a second of a Genie on a car or an edge, as rows of ``lookups``."""
    return [
        make.row(
            LOOKUPS,
            method=method,
            t_ns=i * S,
            genie=genie,
            placement="edge" if genie.startswith("edge") else "car",
            kind=kind,
            requester=requester if kind == "image" else None,
            stamp_ns=i * S,
            requests=requests,
            hits=hit,
            updates=hit,
            boost_sum=0.1 * hit,
            entries=i + 1,
        )
        for i, hit in enumerate(hits)
    ]


def lookup_table(*rows: tuple) -> pd.DataFrame:
    return make.table(LOOKUPS, *rows).to_frame()


def sample(name: str, second: float, **cells: Any) -> tuple[Any, ...]:
    return make.row(RESOURCES, method="local", resource=name, t_ns=second * S, **cells)


def of_map(genie: str, kind: str, **counts: Any) -> tuple[Any, ...]:
    """A row of ``lookups``: of objects, on a car."""
    where = {"method": "genie", "genie": genie, "placement": "car"}
    return make.row(LOOKUPS, kind=kind, **where, **counts)


def of_tables(
    frames=None, lookups=None, resources=None, methods=METHODS
) -> dict[tuple[str, str], MetricValue]:
    """By name, and by resource or baseline, or where Genies run, or method."""
    given = {"frames": frames, "lookups": lookups, "resources": resources}
    known = {name: table for name, table in given.items() if table is not None}
    made = metrics.compute(methods, {"frames": Table(FRAMES).to_frame(), **known})
    assert len({(one.metric, one.method, one.placement, one.component) for one in made}) == len(
        made
    )
    where = [
        one.component or (one.method if one.placement == "all" else one.placement) for one in made
    ]
    return {(one.metric, place): one for one, place in zip(made, where, strict=True)}


def of_resources(*rows: tuple[Any, ...], **tables: pd.DataFrame) -> dict[Any, MetricValue]:
    return of_tables(resources=make.table(RESOURCES, *rows).to_frame(), **tables)


def test_six_frames_worked_by_hand():
    result = of_tables(frames=six_frames())
    value = {key: metric.value for key, metric in result.items()}
    assert value["first_answer_mean", "local"] == 252.0
    assert value["first_answer_p50", "genie"] == 22.0
    assert value["first_answer_p99", "genie"] == pytest.approx(31.8)
    assert value["fresh_answer_mean", "genie"] == 47.0
    assert value["improvement_first_answer", "local"] == pytest.approx(1 - 22 / 252)
    assert (
        value["answered_share", "local"] == value["answered_share", "genie"] == pytest.approx(2 / 3)
    )
    assert value["dropped_share", "local"] == pytest.approx(1 / 3)
    assert value["dropped_share", "genie"] == 0.0
    assert value["under_deadline_share", "genie"] == pytest.approx(2 / 3)  # of the published frames
    assert ("improvement_first_answer", "remote") not in value  # remote was not simulated


def test_a_frame_lost_after_its_first_answer_is_not_dropped():
    """Genie answers from the map, then the detector's queue drops the frame: the car did get an
    answer.
    """
    dropped = {"received_ns": 0, "first_answer_ns": 9 * MS, "drop": "car1/detector:/image_raw"}
    table = make.table(FRAMES, FrameRow("genie", "car1", "camera_02", 0, 0, 0, **dropped))
    result = of_tables(frames=table.to_frame())
    assert result["answered_share", "genie"].value == 1
    assert result["dropped_share", "genie"].value == 0


def test_what_is_not_defined_is_none():
    """No frame was ever answered, and the run was over within one second: no latency, and no
    interval.
    """
    table = make.table(FRAMES, FrameRow("local", "car1", "camera_02", 0, 0, 0))
    result = of_tables(frames=table.to_frame())
    assert result["first_answer_mean", "local"] == MetricValue(
        "first_answer_mean", "local", "all", "", None, "ms", n=0
    )
    share = result["answered_share", "local"]
    assert (share.value, share.low, share.high) == (0.0, None, None)
    assert of_tables() == {}


def autocorrelated_run(rng: np.random.Generator, mean_ms: float) -> pd.DataFrame:
    """Two cars, 20 frames a second for 40 s; latencies of neighbouring frames are correlated by
    0.8.
    """
    table = Table(FRAMES)
    for car in ("car1", "car2"):
        deviation = 0.0
        for frame in range(800):
            deviation = 0.8 * deviation + rng.standard_normal()
            answer_ns, stamp_ns = int((mean_ms + deviation) * MS), frame * 50 * MS
            table.append(
                FrameRow("genie", car, "camera_02", frame, 0, stamp_ns, 0, stamp_ns + answer_ns)
            )
    return table.to_frame()


@pytest.mark.slow
def test_the_interval_inside_a_run_covers_the_true_mean_and_median():
    """Nominal 95 %, 200 runs, seed 5. Taking the frames for independent would cover half of the
    times only.
    """
    rng = np.random.default_rng(5)
    covered, median_covered, naive = 0, 0, 0
    for _ in range(200):
        frames = autocorrelated_run(rng, mean_ms=30.0)
        result = of_tables(frames=frames)
        mean, median = result["first_answer_mean", "genie"], result["first_answer_p50", "genie"]
        covered += mean.low < 30.0 < mean.high
        median_covered += median.low < 30.0 < median.high
        taken_ms = (frames["first_answer_ns"] - frames["stamp_ns"]) / MS
        error = 1.96 * taken_ms.std() / np.sqrt(len(frames))
        naive += abs(mean.value - 30.0) < error
    print(
        f"covered: mean {covered}/200, median {median_covered}/200, frames taken for independent"
        f" {naive}/200"
    )
    assert 0.88 <= covered / 200 <= 0.99
    assert 0.88 <= median_covered / 200 <= 0.99
    assert naive / 200 < 0.75


def test_paired_frames_narrow_the_interval_of_an_improvement():
    """Genie takes a tenth of what local takes, second by second: so the improvement is exact, the
    means are not.
    """
    table = Table(FRAMES)
    # car2 drives under Genie alone
    table.append(FrameRow("genie", "car2", "camera_02", 0, 0, 0, 0, 900 * MS))
    for method, factor in (("local", 1.0), ("genie", 0.1)):
        for frame in range(100):
            stamp_ns = frame * 100 * MS
            answer_ns = stamp_ns + int(factor * (200 + 10 * (frame // 10)) * MS)
            table.append(FrameRow(method, "car1", "camera_02", frame, 0, stamp_ns, 0, answer_ns))
    result = of_tables(frames=table.to_frame())
    improvement, mean = (
        result["improvement_first_answer", "local"],
        result["first_answer_mean", "local"],
    )
    assert improvement.value == pytest.approx(0.9)
    assert mean.high - mean.low > 20
    assert improvement.high - improvement.low < 1e-9


@pytest.mark.parametrize(
    ("hits", "n"), [(0, 40), (1, 40), (13, 40), (39, 40), (40, 40), (5, 100_000)]
)
def test_the_interval_of_a_share_is_wilson_s(hits, n):
    """Source: SciPy, for rows that are independent."""
    from scipy import stats

    p = hits / n
    half = 1.959963984540054 * np.sqrt(p * (1 - p) / n)
    expected = stats.binomtest(hits, n).proportion_ci(0.95, method="wilson")
    assert wilson(p, half, n) == pytest.approx((expected.low, expected.high), abs=1e-12)


def over_seeds(metric: str, values: list[float], n: int | None = 1000) -> pd.Series:
    rows = {
        "metric": metric,
        "method": "genie",
        "placement": "all",
        "component": "",
        "unit": "1",
        "seed": list(range(len(values))),
        "value": values,
        "n": n,
        "point": 0,
    }
    return across_seeds(pd.DataFrame(rows), ["point"]).iloc[0]


def test_an_interval_over_seeds_is_students_t_within_what_is_possible():
    from scipy import stats

    values = [0.99, 1.0, 0.9]
    half = stats.t.ppf(0.975, 2) * stats.sem(values)
    share = over_seeds("answered_share", values)
    assert share["low"] == pytest.approx(np.mean(values) - half) and share["high"] == 1.0
    late = over_seeds("first_answer_mean", [1.0, 9.0, 3.0])
    assert late["low"] == 0.0 and late["high"] > 13
    boost = over_seeds("confidence_boost", values)
    assert boost["high"] == pytest.approx(np.mean(values) + half), "may be above 1"
    gain = over_seeds("improvement_first_answer", [0.1, 0.2, -0.1])
    assert gain["low"] < 0


def test_what_tells_little_has_no_interval_over_seeds():
    assert np.isnan(over_seeds("answered_share", [0.25, 0.5])["low"]), "two seeds"
    assert np.isnan(over_seeds("answered_share", [0.25] * 5)["low"]), "all equal"
    assert np.isnan(over_seeds("first_answer_p99", [1.0, 2.0, 3.0], n=99)["low"])
    for n in (100, None):  # None: of how many answers is not known
        assert not np.isnan(over_seeds("first_answer_p99", [1.0, 2.0, 3.0], n=n)["low"])


def test_a_car_of_one_block_does_not_take_the_interval_away():
    """Two cars of four seconds and one of a single frame; and a method's interval is its own."""
    frames = make.frames(cars=2, seconds=4).to_frame()
    last = frames[frames["car"] == "car2"].groupby("method", observed=True).head(1)
    with_third = pd.concat([frames, last.assign(car="car3")], ignore_index=True)
    result = of_tables(frames=with_third)["answered_share", "local"]
    assert result.low is not None and result.low < result.value < result.high
    of_local = with_third[with_third["method"] == "local"].assign(method="local")
    alone = of_tables(frames=of_local, methods=METHODS[:1])["answered_share", "local"]
    assert alone == result


def test_reuse_is_the_mean_over_the_genies_on_cars_or_edges():
    """Car 1 hits 10 of 20, car 2 1 of 4: the mean of the ratios is 0.375; pooled it is 11 of 24."""
    table = lookup_table(
        *events("car1/genie", "image", [0, 1] * 10),
        *events("car2/genie", "image", [1, 0, 0, 0]),
        *events("edge1/genie", "image", [1] * 5),
    )
    result = of_tables(lookups=table)
    assert result["image_reuse", "car"].value == 0.375
    assert result["image_reuse", "edge"].value == 1.0
    assert result["image_reuse_pooled", "car"].value == pytest.approx(11 / 24)
    assert result["image_reuse", "car"].n == 24
    assert result["image_reuse", "car"].low is None, "a range is no interval"
    assert result["stored_images", "car"].value == (20 + 4) / 2


def test_neighbours_requests_count_apart():
    own = events("edge1/genie", "image", [1, 0, 0, 0])
    neighbours = events("edge1/genie", "image", [1, 1, 1, 1], requester="neighbour")
    result = of_tables(lookups=lookup_table(*own, *neighbours))
    assert result["image_reuse_own", "edge"].value == 0.25
    assert result["image_reuse", "edge"].value == 5 / 8


def test_object_reuse_counts_look_ups_of_each_kind_not_messages():
    sightings = events("car1/genie", "sighting", [3, 0], requests=4)
    boosts = events("car1/genie", "boost", [2, 2], requests=2)
    result = of_tables(lookups=lookup_table(*sightings, *boosts))
    assert result["object_reuse", "car"].value == pytest.approx(7 / 12)
    assert result["image_reuse", "car"].value is None
    assert result["boost_per_sighting", "car"].value == pytest.approx(0.1)
    assert result["boost_per_sighting", "car"].n == 7
    assert result["confidence_boost", "car"].value == pytest.approx(0.7 / 3), "three were"


def test_a_range_is_from_the_lowest_to_the_highest_running_ratio_of_any_genie():
    """Car 1 has 1, 1/2, 2/3; car 2 has 0, 0."""
    one = events("car1/genie", "image", [1, 0, 1])
    metric = of_tables(lookups=lookup_table(*one, *events("car2/genie", "image", [0, 0])))[
        "image_reuse", "car"
    ]
    assert metric.value == pytest.approx((2 / 3 + 0) / 2)
    assert (metric.range_low, metric.range_high) == (0.0, 1.0)
    alone = of_tables(lookups=lookup_table(*one))["image_reuse", "car"]
    assert (alone.range_low, alone.range_high) == (0.5, 1.0)


def test_the_running_boost_is_confidence_added_over_objects_stored_so_far():
    table = lookup_table(
        of_map("g", "boost", t_ns=0, requests=1, hits=1, updates=1),
        of_map("g", "boost", t_ns=1, requests=1, boost_sum=0.10, entries=2),
        of_map("h", "sighting", t_ns=2, requests=3, hits=2, updates=2, boost_sum=0.06, entries=1),
        of_map("g", "boost", t_ns=3, requests=3, hits=3, updates=3, entries=1),
    )
    curve = genie_metrics.running_boost(Columns.of(table))
    assert list(curve["events"]) == [2, 3, 4]
    assert list(curve["boost"]) == pytest.approx([0.10 / 2, 0.16 / 3, 0.16 / 3])
    # after a warm-up a map holds ten objects; of four sighted ones three are new
    warm = of_map("g", "sighting", requests=4, updates=1, boost_sum=0.09, entries=13)
    curve = genie_metrics.running_boost(Columns.of(lookup_table(warm)))
    assert list(curve["boost"]) == pytest.approx([0.09 / 3])
    boost = of_tables(lookups=lookup_table(warm))["confidence_boost", "car"]
    assert (boost.value, boost.n) == (pytest.approx(0.09 / 3), 3)


def test_use_is_of_all_slots_and_a_queue_has_none():
    """An accelerator of 2 slots, busy for 3 of 2 x 2 slot-seconds."""
    accelerator = "edge1.accelerator"
    result = of_resources(
        sample(accelerator, 1, kind="accelerator", capacity=2, busy_ns=1 * S),
        sample(accelerator, 2, kind="accelerator", capacity=2, busy_ns=3 * S),
        sample("edge1:/image_raw", 2, kind="queue", queue=1, queue_max=1),
    )
    assert result["utilization", accelerator].value == 0.75
    assert ("utilization", "edge1:/image_raw") not in result


def test_utilization_is_not_diluted_by_the_wait_for_the_last_answers():
    """Busy all the time until the last frame at 2 s; the run goes on for 8 s to see what still
    comes.
    """
    name, frames = (
        "car1.accelerator",
        make.table(
            FRAMES,
            FrameRow("local", "car1", "camera_02", 0, 0, 0),
            FrameRow("local", "car1", "camera_02", 1, 0, 2 * S),
        ),
    )
    busy = (
        sample(name, second, kind="accelerator", capacity=1, busy_ns=min(second, 2) * S)
        for second in range(11)
    )
    result = of_resources(*busy, frames=frames.to_frame())
    assert result["utilization", name].value == 1.0


def test_the_order_of_frames_in_memory_does_not_matter():
    given = make.tables(1, 3)
    shuffled = given["frames"].sample(frac=1, random_state=3)
    made = (
        metrics.compute(METHODS, {**given, "frames": rows}) for rows in (given["frames"], shuffled)
    )
    for one, other in zip(*made, strict=True):
        unknown = {"value": None, "low": None, "high": None}
        assert one._replace(**unknown) == other._replace(**unknown)
        assert one.value == pytest.approx(other.value)


def test_what_is_stored_is_what_the_last_look_up_found():
    asked = [
        of_map("g", "image", t_ns=second * S, requests=1, requester="client", entries=entries)
        for second, entries in enumerate((3, 9, 4))
    ]
    assert of_tables(lookups=lookup_table(*asked))["stored_images", "car"].value == 4.0


def test_each_method_is_measured_and_compared_with_every_baseline():
    """Two that run Genies, of which one is the better; and two baselines, one of which did not
    run.
    """
    methods = [
        MethodInfo("swift", "Swift", baseline=False),
        MethodInfo("plain", "Plain", baseline=True),
        MethodInfo("slow", "Slow", baseline=False),
        MethodInfo("absent", "Absent", baseline=True),
    ]
    table = Table(FRAMES)
    for method, answer_ms in (("plain", 100), ("slow", 80), ("swift", 10)):
        for frame in range(20):
            stamp_ns = frame * 100 * MS
            row = FrameRow(method, "car1", "c", frame, 0, stamp_ns, 0, stamp_ns + answer_ms * MS)
            table.append(row)
    lookups = lookup_table(
        *events("car1/genie", "image", [0, 0], method="slow"),
        *events("car1/genie", "image", [1, 1], method="swift"),
    )
    made = metrics.compute(methods, {"frames": table.to_frame(), "lookups": lookups})
    assert list(dict.fromkeys(one.method for one in made)) == ["swift", "plain", "slow"]
    compared = {
        one.method: (one.component, one.value)
        for one in made
        if one.metric == "improvement_first_answer"
    }
    assert compared == {
        "swift": ("plain", pytest.approx(0.9)),
        "slow": ("plain", pytest.approx(0.2)),
    }
    reuse = {one.method: (one.placement, one.value) for one in made if one.metric == "image_reuse"}
    assert reuse == {"swift": ("car", 1.0), "slow": ("car", 0.0)}


def test_a_resource_is_placed_where_it_is():
    taken = (FrameRow("local", "car.one", "c", number, 0, number * S) for number in range(2))
    names = {"car.one.accelerator": "car", "edge1.cpu": "edge", "car.one->edge1": "all"}
    made = of_resources(
        *(sample(name, 1, kind="cpu", capacity=1) for name in names),
        frames=make.table(FRAMES, *taken).to_frame(),
    )
    assert {
        name: one.placement for (metric, name), one in made.items() if metric == "utilization"
    } == names


def test_a_deadline_is_met_before_it_and_not_at_it():
    frames = six_frames()
    late_ms = {"local": [33, 33, 33], "genie": [33, 33, 32]}
    for method, first_ms in late_ms.items():
        rows = (frames["method"] == method).to_numpy()
        stamps_ns = frames.loc[rows, "stamp_ns"].to_numpy()
        frames.loc[rows, "first_answer_ns"] = stamps_ns + np.array(first_ms) * MS
    result = of_tables(frames=frames)
    third = pytest.approx(1 / 3)
    assert result["under_deadline_share", "local"].value == 0.0
    assert result["under_deadline_share", "genie"].value == third


def test_the_use_of_a_cpu_is_that_of_each_of_its_cores():
    """Four cores that work 6 s in 2 s: each is busy for 1.5 s."""
    made = of_resources(
        *(
            sample("edge1.cpu", second, kind="cpu", capacity=4, busy_ns=busy_s * S)
            for second, busy_s in ((1, 2), (2, 6))
        )
    )
    assert made["utilization", "edge1.cpu"].value == 0.75


def test_an_interval_over_blocks_of_two_cars_by_hand():
    """Two cars, four blocks each: t with 2 x (4 - 1) degrees of freedom, not with 8 - 1."""
    from scipy import stats

    stamps_ns = np.tile(np.arange(4) * S, 2)
    cars = Columns.of(pd.DataFrame({"car": ["car1"] * 4 + ["car2"] * 4}))["car"]
    values = np.array([1.0, 2.0, 4.0, 5.0, 20.0, 24.0, 22.0, 26.0])
    blocks = Blocks(cars, stamps_ns)
    half = blocks.half_width(blocks.influence(values, np.ones(8)))
    moves = (values - values.mean()) / 8
    variance = sum(4 * np.var(part, ddof=1) for part in (moves[:4], moves[4:]))
    assert half == pytest.approx(stats.t.ppf(0.975, 6) * np.sqrt(variance), rel=1e-9)


def test_frames_without_an_answer_do_not_change_the_interval_of_the_mean():
    """Each second has answered frames, so leaving the others out changes no block."""
    frames = make.frames(cars=2, seconds=8).to_frame()
    local = frames[frames["method"] == "local"]
    dropped = local["first_answer_ns"].isna()
    assert dropped.any() and len(local[~dropped]) >= 2 * 8, "a second has answered frames"

    def mean(rows: pd.DataFrame) -> MetricValue:
        metrics_of_rows = metrics.compute(METHODS[:1], {"frames": rows})
        return next(row for row in metrics_of_rows if row.metric == "first_answer_mean")

    whole, answered = mean(local), mean(local[~dropped])
    assert whole.value == answered.value and whole.n == answered.n
    assert (whole.low, whole.high) == pytest.approx((answered.low, answered.high), rel=1e-9)


def test_a_look_at_a_later_frame_has_no_age():
    looks = pd.DataFrame({"stamp_ns": [S, S], "first_looked_ns": [S + 200 * MS, S - 100 * MS]})
    assert frame_metrics.look_age_ms(Columns.of(looks)).tolist() == [0.0, 100.0]
