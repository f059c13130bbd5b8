"""Input that is whole on the outside and wrong within, drawn by Hypothesis: it works, or one line
says why not.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import math
import re
import shutil
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from itertools import count, islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from genie_sim.base.errors import UserError
from genie_sim.base.settings import plain_data
from genie_sim.base.units import NS_PER_S
from genie_sim.cli.main import main
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data import fetch
from genie_sim.data.intake import write_cars
from genie_sim.data.table_import import cars_of_tables
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.data.truth import (
    RecordedTruth,
    TruthRow,
    TruthTable,
    path_beside,
    truth_beside,
    write_truth,
)
from genie_sim.record import provenance
from genie_sim.report.output import Output
from genie_sim.runs.folder import run_to_folder
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.worlds.traffic.source import RecordedTraffic
from tests.conformance import own, small
from tests.conformance.wrong_types import HOOKS
from tests.data.pose_tables import DETECTIONS, POSES, TRUTH
from tests.make import KARLSRUHE, trace_frame
from tests.worlds.traffic.fcd_files import fcd_text
from tools.fuzz.mutation import VALUES
from tools.fuzz.settings import LONG_NS, TINY

pytestmark = pytest.mark.slow
checked = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
INTEGERS = (0, 1, -1, 2, 255, 2**31 - 1, 2**31, 2**62, 2**63 - 1, -(2**63))
NUMBERS = (0.0, -0.0, 1e-300, 0.5, 3.2, 90.0, 4e7, 1e150, 1e308, math.nan, math.inf, -math.inf)
TEXTS = ("", " ", "x", "car", "person", "02", "\n", "\0", "é\u202e", "<b>", "=1+1", "x" * 5000)
UNWRITABLE = (ValueError, TypeError, ArithmeticError, AttributeError, pa.ArrowException)


@contextlib.contextmanager
def works_or_is_refused() -> Iterator[None]:
    """What is done inside works, or raises a ``UserError`` of one line."""
    try:
        yield
    except UserError as error:
        assert "\n" not in str(error) and len(str(error)) < 12_000


def run_command(*line: str) -> None:
    """A command works, or says in one line why not."""
    said, wrong = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(wrong):
        status = main(line)
    assert status in (0, 1) and "Traceback" not in wrong.getvalue(), wrong.getvalue()
    assert status == 0 or wrong.getvalue().rstrip("\n").splitlines()[-1].startswith("genie-sim: ")


def like(value: Any) -> st.SearchStrategy[Any]:
    """Another value, mostly of the same type."""
    anything = st.sampled_from(VALUES)
    if isinstance(value, bool):
        return st.just(not value) | anything
    if isinstance(value, int):
        return st.sampled_from(INTEGERS) | anything
    if isinstance(value, float):
        return st.sampled_from((*NUMBERS, -value, 10 * value, 1e6 * value)) | anything
    return st.sampled_from(TEXTS) | anything


@st.composite
def with_other_fields(draw: st.DrawFn, row: Any) -> Any:
    """The same row, frozen dataclass or named tuple, with one or two other values."""
    is_tuple = hasattr(row, "_fields")
    names = row._fields if is_tuple else [each.name for each in fields(row)]
    chosen = draw(st.lists(st.sampled_from(names), min_size=1, max_size=2, unique=True))
    values = {name: draw(like(getattr(row, name))) for name in chosen if name != "features"}
    return row._replace(**values) if is_tuple else replace(row, **values)


@st.composite
def traces(draw: st.DrawFn) -> Trace:
    """A trace of which a frame and a detection have other values."""
    rows = [trace_frame("02", index) for index in range(4)]
    place = draw(st.integers(0, 3))
    seen = rows[place]
    if draw(st.booleans()) and seen.detections:
        other = draw(with_other_fields(seen.detections[0]))
        rows[place] = replace(seen, detections=(other, *seen.detections[1:]))
    else:
        rows[place] = draw(with_other_fields(seen))
    origin = draw(st.just(KARLSRUHE) | st.tuples(*map(like, KARLSRUHE)))
    about = draw(st.just({"detector": "x"}) | st.sampled_from(VALUES).map(lambda x: {"model": x}))
    return Trace("wrong", origin, {"02": tuple(rows)}, about)


@checked
@given(wrong=traces())
def test_a_trace_with_a_right_digest_and_other_values(tmp_path: Path, wrong: Trace):
    path = tmp_path / "wrong.parquet"
    try:
        write_trace(path, wrong)
    except (*UNWRITABLE, UserError):
        assume(False)
    with works_or_is_refused():
        trace = read_trace(path)
        trace.rebased((-89.9, 0.0, 0.0))
        if max(seen.stamp_ns for seen in trace.frames["02"]) < 10 * LONG_NS:
            street = yaml.safe_load(TINY) | {"name": "tiny", "perception": {"trace": str(path)}}
            street["cameras"] = [{"name": "front", "recording": "02"}]
            simulate(prepare(read_scenario(street)))


@checked
@given(data=st.data())
def test_a_truth_table_with_a_right_digest_and_other_values(tmp_path: Path, data: st.DataObject):
    path = tmp_path / "drive.parquet"
    whole = Trace("drive", KARLSRUHE, {"02": tuple(trace_frame("02", i) for i in range(4))}, {})
    write_trace(path, whole)
    rows = [
        TruthRow("02", i, 103_380_000 * i, 7, "car", False, True, 5.0 + i, 17.5, -0.5)
        for i in range(4)
    ]
    place = data.draw(st.integers(0, 3))
    rows[place] = data.draw(with_other_fields(rows[place]))
    digest = data.draw(st.just(whole.digest) | st.sampled_from(TEXTS))
    origin = data.draw(st.just(KARLSRUHE) | st.tuples(*map(like, KARLSRUHE)))
    try:
        about = {"drive": "x", "trace": "drive"}
        write_truth(path_beside(path), TruthTable(digest, origin, tuple(rows), about))
    except (*UNWRITABLE, UserError):
        assume(False)
    with works_or_is_refused():
        table = truth_beside(path, whole)
        assert table is not None
        truth = RecordedTruth(table.rebased((48.0, 9.0, 0.0)))
        for seen in whole.frames["02"]:
            truth.visible(seen)  # type: ignore[arg-type]
            truth.are_there([seen], ["car"], np.array([5.0]), np.array([17.5]))  # type: ignore[arg-type]


# Where a header's numbers stand: signature, offsets and lengths in bytes (APPNOTE 4.3).
HEADERS = {
    b"PK\x03\x04": ((4, 2), (6, 2), (8, 2), (14, 4), (18, 4), (22, 4), (26, 2), (28, 2)),
    b"PK\x01\x02": ((8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (30, 2), (38, 4), (42, 4)),
    b"PK\x05\x06": ((4, 2), (6, 2), (8, 2), (10, 2), (12, 4), (16, 4), (20, 2)),
}


@st.composite
def archives(draw: st.DrawFn) -> bytes:
    """An archive one or two of whose headers say something else than its content."""
    kinds = st.sampled_from(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    names = st.sampled_from(("a/1.txt", "1", "a", "a/b", "ü.txt", "a/../b", "../x", "/x"))
    output = io.BytesIO()
    with zipfile.ZipFile(output, "w") as packed, warnings.catch_warnings(action="ignore"):
        for name in draw(st.lists(names, min_size=1, max_size=4)):
            entry = zipfile.ZipInfo(name)
            entry.compress_type = draw(kinds)
            entry.external_attr = draw(st.sampled_from((0, 0o100644, 0o120777, 0o060600))) << 16
            packed.writestr(entry, draw(st.sampled_from((b"", b"text" * 50, bytes(2**20)))))
    content = bytearray(output.getvalue())
    for _ in range(draw(st.integers(1, 2))):
        signature = draw(st.sampled_from(sorted(HEADERS)))
        places = [place.start() for place in re.finditer(re.escape(signature), content)]
        offset, size = draw(st.sampled_from(HEADERS[signature]))
        begin, limit = draw(st.sampled_from(places)) + offset, 256**size - 1
        before = int.from_bytes(content[begin : begin + size], "little")
        number = draw(st.sampled_from((0, 1, before + 1, before - 1, 2 * before, limit)))
        content[begin : begin + size] = (number & limit).to_bytes(size, "little")
    return bytes(content)


@checked
@given(content=archives())
def test_nothing_of_an_archive_lies_outside_of_its_folder(tmp_path: Path, content: bytes):
    path = tmp_path / "in" / "wrong.zip"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    with works_or_is_refused():
        fetch.unpack(path, path.parent / "unpacked")
    assert {entry.name for entry in tmp_path.iterdir()} == {"in"}
    assert {entry.name for entry in path.parent.iterdir()} <= {"wrong.zip", "unpacked"}
    shutil.rmtree(path.parent)


class Unspeakable:
    """What neither can be shown nor compared."""

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        raise RuntimeError("no word")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")


ODD = (
    *(object(), b"x", set(), iter(()), (), (None,), [()], 1j, 2**63, -1, SimpleNamespace()),
    *(CameraPose(0.0, 0.0, 0.0, math.nan), Detection("car", 2.0, None, None, 0.5, "x")),
    *(SimpleNamespace(stamp_ns=0), float("nan"), lambda *_: None, Unspeakable()),
    *({"a": {"b": object()}}, {"a": "b"}, {"a": {"features": 3}}, {"a": {"detector": []}}),
)
USUAL = {"perception": {"source": f"{own.__name__}:Street", "speed_mps": 1.0, "seconds": 0.3}}
CASES = [(street, cls, name) for street, cls, names in HOOKS for name in names.split()]
TABLES_ALONE = Output(page=False)
ANSWERS = st.tuples(st.sampled_from((*VALUES, *ODD)), st.integers(0, 3))


@settings(checked, max_examples=2)
@given(answers=st.lists(ANSWERS, min_size=len(CASES), max_size=len(CASES)))
def test_a_class_of_ones_own_may_return_anything(tmp_path: Path, answers: list[tuple[Any, int]]):
    """Whatever it is asked for, from the first or from a later call on."""
    for (street, cls, name), (value, after) in zip(CASES, answers, strict=True):
        usual = getattr(cls, name, None)
        replaced = answering(usual, value, after) if callable(usual) else value
        with mock.patch.object(cls, name, replaced, create=True), works_or_is_refused():
            run_to_folder(
                small.scenario(**{**USUAL, **street}), tmp_path / "results", output=TABLES_ALONE
            )
        assert not list(tmp_path.glob("results/.*")), (cls, name)
        shutil.rmtree(tmp_path / "results", ignore_errors=True)


def answering(usual: Callable[..., Any], value: Any, after: int) -> Callable[..., Any]:
    """Answers as usual so many times, and with the value from then on."""
    calls = count()

    def answer(*given: Any, **more: Any) -> Any:
        return usual(*given, **more) if next(calls) < after else value

    return answer


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny run."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "tiny.yaml").write_text(TINY)
    run = run_to_folder(load_scenario(folder / "tiny.yaml"), folder / "runs").folder
    assert run is not None
    return run


READERS = (
    *(("report",), ("table",), ("table", "--format", "csv"), ("table", "--format", "latex")),
    *(("compare",), ("figures", "--format", "svg")),
)


@settings(checked, max_examples=12)
@given(data=st.data(), command=st.sampled_from(READERS))
def test_a_result_with_right_digests_and_other_values(
    tmp_path: Path, result: Path, data: st.DataObject, command: tuple[str, ...]
):
    folder = tmp_path / "run"
    shutil.copytree(result, folder)
    path = folder / data.draw(st.sampled_from(sorted(x.name for x in folder.glob("*.parquet"))))
    table = pq.ParquetFile(path).read()
    column = data.draw(st.integers(0, table.num_columns - 1))
    values = table.column(column).to_pylist()
    if values:
        values[0] = data.draw(like(values[-1]))
        field = table.schema.field(column)
        with contextlib.suppress(*UNWRITABLE, OverflowError, UnicodeError):
            table = table.set_column(column, field, pa.array(values, field.type))
    pq.write_table(table, path)
    about = json.loads((folder / "run.json").read_bytes())
    about["digests"] = provenance.digests(folder, about["digests"])
    provenance.write_json(folder / "run.json", about)
    with mock.patch("genie_sim.analysis.figures.save"):
        run_command(command[0], str(folder), *command[1:])
    shutil.rmtree(folder)


QUANTITIES = ("0", "1", "2.5", "30", "0.5", "100", "-1", "1e-9", "1e9", "9" * 30, "nan")
UNITS = ("ns", "ms", "s", "min", "B", "kB", "MB", "Mbit/s", "Gbit/s", "m", "km", "deg", "rad")
WORDS = ("exact", "dhash", "lru", "ttl", "default", "own", "literal", "tracker", "jpeg80", "wifi")


def typed(value: Any) -> st.SearchStrategy[Any]:
    """Another value that is written in the same way."""
    if isinstance(value, int | float):
        return st.sampled_from((0, 1, 2, 3, 0.5, 1.0, 0.25, -1, 1e-9, 10**6, 2**63, not value))
    if isinstance(value, str) and (quantity := re.fullmatch(r"-?[0-9.]+ (\S+)", value)):
        units = st.just(quantity[1]) | st.sampled_from(UNITS)
        return st.builds("{} {}".format, st.sampled_from(QUANTITIES), units)
    return st.sampled_from((*WORDS, None, "1 s", "1 m", 3, "car1", "edge1"))


def leaves(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every holder of a plain value, and its key there."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, dict | list):
            yield from leaves(value)
        else:
            yield tree, key


@settings(checked, max_examples=60)
@given(data=st.data())
def test_a_scenario_written_out_with_other_values_of_their_type(data: st.DataObject):
    """What is accepted is the same when it is written and read again, and is simulated."""
    street = yaml.safe_load(TINY) | {"name": "tiny", "methods": ["remote", "genie", "recommended"]}
    tree = json.loads(json.dumps(plain_data(read_scenario(street))))
    places = list(leaves(tree))
    for place in data.draw(st.lists(st.integers(0, len(places) - 1), min_size=1, max_size=3)):
        holder, key = places[place]
        holder[key] = data.draw(typed(holder[key]))
    with works_or_is_refused():
        scenario = read_scenario(tree)
        assert read_scenario(plain_data(scenario)) == scenario
        windows_ns = [car.route.window_ns or (0, 20 * LONG_NS) for car in scenario.cars]
        routes = [
            car.route.start_ns + car.route.laps * (car.route.pause_ns + end - begin)
            for car, (begin, end) in zip(scenario.cars, windows_ns, strict=True)
        ]
        waits = (scenario.start_jitter_ns, *(camera.phase_ns for camera in scenario.cameras))
        if max(*routes, *waits) < 5 * LONG_NS:
            simulate(prepare(scenario))


OTHER_NUMBERS = ("nan", "inf", "-1e308", "1e-300", "0", "-0.0", "1e9", "9" * 400, "", "x", "٣")


@st.composite
def with_another_number(draw: st.DrawFn, text: str) -> str:
    """A text one of whose numbers is another one, or none; or that ends early."""
    numbers = list(re.finditer(r"-?\d+(?:\.\d+)?", text))
    number = draw(st.sampled_from(numbers))
    if draw(st.integers(0, 9)) == 0:
        return text[: number.start()]
    return text[: number.start()] + draw(st.sampled_from(OTHER_NUMBERS)) + text[number.end() :]


def traffic_text() -> str:
    """Two vehicles for four seconds, and a truck for two of them."""
    steps = []
    for k in range(8):
        places = {"a": (10.0 * k, 0.0, 90.0), "b.1": (10.0 * k - 20, 0.0, 90.0 - 3 * k)}
        if 2 <= k <= 5:
            places["c"] = (60.0, -6.0 + k, 0.0)
        steps.append((50 + 0.5 * k, places))
    return fcd_text(steps, types={"c": "truck"})


@checked
@given(
    text=with_another_number(traffic_text()),
    pack=st.sampled_from((bytes, gzip.compress)),
    begin_ns=st.sampled_from((None, 51 * NS_PER_S)),
)
def test_traffic_with_another_number(
    tmp_path: Path, text: str, pack: Callable[[bytes], bytes], begin_ns: int | None
):
    path = tmp_path / "traffic.xml"
    path.write_bytes(pack(text.encode()))
    with works_or_is_refused():
        source = RecordedTraffic(fcd=str(path), begin_ns=begin_ns, duration_ns=3 * NS_PER_S)
        frames = source.open(1, None)
        for car, start_ns in frames.starts_ns().items():
            for seen in islice(frames.drive(car, None, start_ns).frames["02"], 20):
                _ = seen.detections, seen.truth()


TABLES = {"poses": POSES, "detections": DETECTIONS, "truth": TRUTH}


@checked
@given(data=st.data(), name=st.sampled_from(sorted(TABLES)))
def test_a_table_with_another_number(tmp_path: Path, data: st.DataObject, name: str):
    for other, text in TABLES.items():
        content = data.draw(with_another_number(text)) if other == name else text
        (tmp_path / f"{other}.csv").write_text(content, encoding="utf-8")
    poses, detections, truth = (tmp_path / f"{other}.csv" for other in TABLES)
    with works_or_is_refused():
        imported = cars_of_tables(poses, detections, truth)
        shutil.rmtree(tmp_path / "traces", ignore_errors=True)
        write_cars(tmp_path / "traces", imported)
