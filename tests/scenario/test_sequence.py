"""Traces of one sequence: several cars that were recorded together are replayed together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.trace import Trace, TraceFrame, write_trace
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import notes, prepare
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario

MS = 1_000_000
ORIGIN = (49.0, 8.4, 115.0)


def recording(name: str, begin: int, end: int, sequence: str | None = "street 7") -> str:
    """A lidar's trace of frames ``begin`` to ``end`` - 1 of a sequence at 10 Hz: its path."""
    frames = [
        TraceFrame(
            camera="lidar",
            index=index,
            stamp_ns=100 * MS * index,
            width=0,
            height=0,
            size_bytes=960_000,
            digest=f"{name} {index}",
            dhash=index,
            pose=CameraPose(0.1 * index, 0.0, 1.9, 0.0),
            horizontal_fov_rad=6.283185,
            detections=(Detection("car", 0.9, None, (-9.0, 4.0, 0.8), 0.9, "made up"),),
            kind="lidar",
        )
        for index in range(begin, end)
    ]
    path = Path(f"{name}.parquet")
    write_trace(path, Trace(name, ORIGIN, {"lidar": tuple(frames)}, {}, sequence))
    return f"./{path}"


def scenario(*routes: dict[str, Any], **settings: Any) -> Scenario:
    cars = [
        {"name": f"car{n}", "device": "jetson_tx2", "edge": "edge1", "route": route}
        for n, route in enumerate(routes, 1)
    ]
    plain = {
        "name": "together",
        "methods": ["local", "genie"],
        "start_jitter": "0 s",
        "perception": {"trace": routes[0]["trace"]},
        "cameras": [{"name": "lidar", "recording": "lidar"}],
        "edges": [{"name": "edge1", "device": "rtx_a4500"}],
        "cars": cars,
    }
    return read_scenario(plain | settings)


@pytest.fixture
def ego() -> str:
    return recording("ego", 0, 20)


@pytest.fixture
def partner() -> str:
    """Comes 0.7 s later, and stays 0.5 s longer."""
    return recording("partner", 7, 25)


def stamps_ms(run: Any, car: str) -> list[int]:
    frames = run.frames[(run.frames["car"] == car) & (run.frames["method"] == "local")]
    return [int(stamp_ns) // MS for stamp_ns in frames["stamp_ns"]]


def test_what_was_recorded_at_one_time_is_replayed_at_one_time(ego: str, partner: str):
    together = scenario({"trace": ego}, {"trace": partner})
    assert (together.sequence, together.is_one_world) == ("street 7", True)
    run = run_in_memory(together)
    assert stamps_ms(run, "car1") == [100 * n for n in range(20)]
    assert stamps_ms(run, "car2") == [100 * n for n in range(7, 25)]


def test_laps_last_as_long_for_all_cars(ego: str, partner: str):
    laps = {"laps": 2, "pause": "1 s"}
    run = run_in_memory(scenario({"trace": ego, **laps}, {"trace": partner, **laps}))
    lap_ms = 2400 + 1000  # one nanosecond after the last stamp, and the pause
    assert stamps_ms(run, "car1")[20] == lap_ms
    assert stamps_ms(run, "car2")[18] == 700 + lap_ms


def test_recordings_of_two_drives_begin_when_their_cars_do(ego: str):
    other = recording("other", 7, 25, sequence="street 8")
    apart = scenario({"trace": ego}, {"trace": other})
    assert (apart.sequence, apart.is_one_world) == (None, False)
    assert stamps_ms(run_in_memory(apart), "car2")[0] == 0


def test_edges_tell_cars_of_one_sequence_of_one_another(ego: str, partner: str):
    def said(*routes: dict[str, str]) -> list[str]:
        return notes(scenario(*routes, methods=["recommended"]))

    assert said({"trace": ego}, {"trace": partner}) == []
    assert "edges share nothing with cars" in said({"trace": ego}, {"trace": ego})[0]


@pytest.mark.parametrize(
    ("routes", "settings", "message"),
    [
        ([{}, {}], {"start_jitter": "100 ms"}, "start_jitter: .*on one clock: must be 0 s"),
        (
            [{}, {"start": "1 s"}],
            {},
            r"cars\[1\].route: .*all routes must be alike but for 'trace'",
        ),
        ([{"window": ["0 s", "1 s"]}, {}], {}, r"cars\[1\].route: .*on one clock"),
        ([{}, {"laps": 2}], {}, r"cars\[1\].route: .*on one clock"),
        ([{}, {}, {}], {}, r"cars\[2\].route.trace: .*each needs a recording of it, its own"),
    ],
)
def test_what_would_break_the_common_clock_is_refused(
    ego: str, partner: str, routes: list[Any], settings: Any, message: str
):
    traces = [ego, partner, ego]
    with pytest.raises(UserError, match=message):
        scenario(
            *({"trace": trace, **route} for trace, route in zip(traces, routes, strict=False)),
            **settings,
        )


def test_a_car_from_another_drive_does_not_join_a_sequence(ego: str, partner: str):
    other = recording("other", 0, 20, sequence=None)
    with pytest.raises(UserError, match=r"cars\[2\].route.trace: the cars drive together in"):
        scenario({"trace": ego}, {"trace": partner}, {"trace": other})


def test_a_broken_recording_is_one_line(ego: str, partner: str):
    Path("partner.parquet").write_bytes(b"nothing")
    with pytest.raises(UserError, match=r"partner\.parquet: not a readable Parquet file"):
        prepare(scenario({"trace": ego}, {"trace": partner}))


def test_with_paced_looks_a_car_without_cameras_lives_on_what_others_saw(ego: str, partner: str):
    """It rides behind the car that sees, and asks another edge."""
    together = scenario(
        {"trace": ego},
        {"trace": partner},
        methods=["recommended"],
        edges=[{"name": name, "device": "rtx_a4500"} for name in ("edge1", "edge2")],
        cars=[
            {"name": "car1", "device": "jetson_tx2", "edge": "edge1", "route": {"trace": ego}},
            {
                "name": "car2",
                "device": "jetson_tx2",
                "edge": "edge2",
                "cameras": False,
                "route": {"trace": partner},
            },
        ],
    )
    frames = run_in_memory(together).tables["frames"].to_frame()
    blind = frames[frames["car"] == "car2"]
    assert len(blind) == 18 and blind["first_answer_ns"].notna().all()
    assert blind["objects_served"].sum() > 0
